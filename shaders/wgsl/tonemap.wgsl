// AgX by Troy Sobotka, as fitted by Benjamin Wrensch ("Minimal AgX Implementation", 2023): hues stay natural in bright
// light. In: linear; out: display-encoded sRGB.
fn agx_curve(x: vec3f) -> vec3f {
  let x2 = x * x;
  let x4 = x2 * x2;
  return 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
}

fn tone_map(linear: vec3f) -> vec3f {
  let inset = mat3x3f(
    0.842479062253094, 0.0423282422610123, 0.0423756549057051,
    0.0784335999999992, 0.878468636469772, 0.0784336,
    0.0792237451477643, 0.0791661274605434, 0.879142973793104);
  let outset = mat3x3f(
    1.19687900512017, -0.0528968517574562, -0.0529716355144438,
    -0.0980208811401368, 1.15190312990417, -0.0980434501171241,
    -0.0990297440797205, -0.0989611768448433, 1.15107367264116);
  let low = -12.47393;
  let high = 4.026069;
  let exposed = max(linear * view.exposure, vec3f(1.0e-10));
  let v = clamp((log2(inset * exposed) - low) / (high - low), vec3f(0.0), vec3f(1.0));
  var c = agx_curve(v);
  // A little more contrast and colour than the neutral base.
  c = pow(max(c, vec3f(0.0)), vec3f(1.27));
  c = mix(vec3f(dot(c, vec3f(0.2126, 0.7152, 0.0722))), c, 1.34);
  return clamp(outset * c, vec3f(0.0), vec3f(1.0));
}

// Breaks up bands in smooth gradients (interleaved gradient noise, Jimenez 2014).
fn dither(pixel: vec2f) -> f32 {
  return (fract(52.9829189 * fract(dot(pixel, vec2f(0.06711056, 0.00583715)))) - 0.5) / 255.0;
}

fn display(linear: vec3f, pixel: vec2f) -> vec4f {
  return vec4f(tone_map(linear) + dither(pixel), 1.0);
}
