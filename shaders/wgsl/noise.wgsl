// The noise texture (gpu/noise.ts): r = gradient noise fbm, g = ridged fbm, both 0..1; ba = gradient of r. Tiles; its
// mipmaps fade detail out before it can shimmer.
const NOISE_TEXELS: f32 = 256.0;
const NOISE_GRADIENT: f32 = 8.0;

struct Footprint {
  dx: vec3f,   // change of the world position from pixel to pixel
  dy: vec3f,
};

// `scale`: metres (or whatever `at` is in) that the texture covers once.
fn noise_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  if (DETAIL > 1u) { return textureSampleGrad(noise, smooth_repeat, at * k, dx * k, dy * k); }
  let texels = max(dot(dx, dx), dot(dy, dy)) * (k * k * NOISE_TEXELS * NOISE_TEXELS);
  return textureSampleLevel(noise, smooth_repeat, at * k, max(0.5 * log2(max(texels, 1.0e-6)), 0.0));
}

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

// The same rock on all faces: sampled on three planes, weighted by the normal.
fn rock_noise(p: vec3f, n: vec3f, f: Footprint, scale: f32) -> vec4f {
  var w = n * n;
  w = w * w;
  w /= w.x + w.y + w.z;
  let flat = ground_noise(p, f, scale, vec2f(0.829, 0.559));
  if (w.z > 0.97 || DETAIL < 2u) { return flat; }
  let east = noise_sample(p.yz, f.dx.yz, f.dy.yz, scale);
  let north = noise_sample(p.xz, f.dx.xz, f.dy.xz, scale);
  return flat * w.z + east * w.x + north * w.y;
}
