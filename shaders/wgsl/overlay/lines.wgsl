// Anti-aliased lines at the multiples of a value.

// Coverage of lines at the multiples of `every`, `half` pixels wide, where the value changes by `rate` per pixel.
fn lines(value: f32, every: f32, rate: f32, half: f32) -> f32 {
  let away = abs(fract(value / every - 0.5) - 0.5) * every;
  let width = max(rate, 1.0e-6);
  let cover = clamp(half + 0.5 - away / width, 0.0, 1.0);
  return cover * (1.0 - smoothstep(0.12, 0.38, width / every));
}
