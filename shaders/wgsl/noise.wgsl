// The noise texture (gpu/noise.ts): r = gradient noise fbm, g = ridged fbm, both 0..1; ba = gradient of r. Tiles; its
// mipmaps fade detail out before it can shimmer.
const NOISE_GRADIENT: f32 = 8.0;

struct Footprint {
  dx: vec3f,   // change of the world position from pixel to pixel
  dy: vec3f,
};

fn noise_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  return textureSampleGrad(noise, smooth_repeat, at * k, dx * k, dy * k);
}

fn ground_noise(p: vec3f, f: Footprint, scale: f32) -> vec4f {
  return noise_sample(p.xy, f.dx.xy, f.dy.xy, scale);
}

// Gradient of the noise per metre of ground, times its scale: a slope.
fn noise_slope(n: vec4f) -> vec2f {
  return (n.ba - 0.5) * NOISE_GRADIENT;
}

// The same rock on all faces: sampled on three planes, weighted by the normal.
fn rock_noise(p: vec3f, n: vec3f, f: Footprint, scale: f32) -> vec4f {
  var w = n * n;
  w = w * w;
  w /= w.x + w.y + w.z;
  let flat = noise_sample(p.xy, f.dx.xy, f.dy.xy, scale);
  if (w.z > 0.985) { return flat; }
  let east = noise_sample(p.yz, f.dx.yz, f.dy.yz, scale);
  let north = noise_sample(p.xz, f.dx.xz, f.dy.xz, scale);
  return flat * w.z + east * w.x + north * w.y;
}
