// What water does to the ground beside it.

// Wet ground is darker, richer in colour, smoother, and shines.
fn soaked(m: Material, wet: f32) -> Material {
  let colour = m.albedo * mix(vec3f(1.0), vec3f(0.58, 0.55, 0.52), wet);
  return Material(colour, m.relief * (1.0 - 0.4 * wet), max(m.gloss, 0.22 * wet), m.soft, m.open, m.high);
}

fn shore(m: Material, s: Site, colour: vec3f) -> Material {
  if (max(view.has_sea, view.has_lakes) < 0.5) { return m; }
  let wander = (s.macro2.r - 0.5) * 0.006 + (s.fine1.r - 0.5) * 0.003;
  let low = 1.0 - smoothstep(0.0012, 0.0034, s.shore + wander * 0.7);
  let gentle = 1.0 - smoothstep(0.42, 0.75, s.steep + (s.fine1.g - 0.5) * 0.3);
  var out = m;
  if (low * gentle > 0.0) {
    // Beaches of sand by the sea, of pebbles and mud by a lake.
    var beach = sand(s, colour);
    if (s.inland > 0.0) {
      let pebbles = Material(colour * vec3f(0.58, 0.60, 0.64) * (0.72 + 0.5 * s.near.r), fine_relief(s, 0.22), 0.0, 0.0, mix(0.7, 1.0, s.near.r), s.near.r);
      beach = mix_in(beach, heaped(pebbles, s, 1.0), s.inland);
    }
    out = laid(m, beach, low * gentle);
  }
  // Below the water and a hand above it.
  let wet = 1.0 - smoothstep(-0.0002, 0.0010, s.shore + wander * 0.3);
  return soaked(out, wet);
}
