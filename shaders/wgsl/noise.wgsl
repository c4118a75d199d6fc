// The noise texture (gpu/synthesis/noise.ts): r = gradient noise fbm, g = ridged fbm, both 0..1; ba = gradient of r. Tiles; its
// mipmaps fade detail out before it can shimmer.
const NOISE_GRADIENT: f32 = 8.0;

struct Footprint {
  dx: vec3f,   // change of the world position from pixel to pixel
  dy: vec3f,
};

// Layers are turned against each other, so that their repeats never line up.
fn turned(p: vec2f, turn: vec2f) -> vec2f {
  return vec2f(p.x * turn.x - p.y * turn.y, p.x * turn.y + p.y * turn.x);
}

fn ground_noise(p: vec3f, f: Footprint, scale: f32, turn: vec2f) -> vec4f {
  var n = noise_sample(turned(p.xy, turn), turned(f.dx.xy, turn), turned(f.dy.xy, turn), scale);
  // The gradient turns back into world axes.
  let g = n.ba - 0.5;
  n = vec4f(n.rg, vec2f(g.x * turn.x + g.y * turn.y, g.y * turn.x - g.x * turn.y) + 0.5);
  return n;
}

// Gradient of the noise in slopes: its relief is as high as it is wide.
fn noise_slope(n: vec4f) -> vec2f {
  return (n.ba - 0.5) * NOISE_GRADIENT;
}
