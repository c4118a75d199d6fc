// The functions of detail_rich.wgsl for adapters that draw on the CPU: one sample where the others take many.
const NOISE_TEXELS: f32 = 256.0;

fn noise_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  let texels = max(dot(dx, dx), dot(dy, dy)) * (k * k * NOISE_TEXELS * NOISE_TEXELS);
  return textureSampleLevel(noise, smooth_repeat, at * k, max(0.5 * log2(max(texels, 1.0e-6)), 0.0));
}

// On the plane that the surface faces most.
fn rock_noise(p: vec3f, n: vec3f, f: Footprint, scale: f32) -> vec4f {
  let a = abs(n);
  if (a.z > 0.62) { return ground_noise(p, f, scale, vec2f(0.829, 0.559)); }
  let east = a.x > a.y;
  return noise_sample(
    vec2f(select(p.x, p.y, east), p.z), vec2f(select(f.dx.x, f.dx.y, east), f.dx.z), vec2f(select(f.dy.x, f.dy.y, east), f.dy.z), scale);
}

struct FineNoise {
  medium: vec4f,
  small: vec4f,
};

fn fine_noise(p: vec3f, n: vec3f, f: Footprint, coarse: vec4f) -> FineNoise {
  return FineNoise(vec4f(coarse.g, coarse.r, coarse.ba), vec4f(0.5));
}

fn ripple_slope(along: vec2f, phase: f32, footprint: f32) -> vec2f {
  return vec2f(0.0);
}

fn small_waves(p: vec2f, drift: vec2f, lod: f32) -> vec2f {
  return vec2f(0.0);
}
