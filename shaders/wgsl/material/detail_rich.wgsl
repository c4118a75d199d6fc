// Fine detail for real GPUs. detail_plain.wgsl has the same functions for adapters that draw on the CPU; one of the two
// is part of each module. (Branches would not do: a CPU adapter computes both sides of them.)

// Steps of the march for what the water mirrors.
const MIRROR_STEPS: i32 = 16;
// Pixels are sampled so many times as long as wide where the ground is seen at a flat angle.
const LONGEST: f32 = 6.0;

// `scale`: metres (or whatever `at` is in) that the texture covers once.
fn noise_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  return textureSampleGrad(noise, smooth_repeat, at * k, dx * k, dy * k);
}

// Shares of the three planes in what lies on a surface: on most ground one or two of them.
fn plane_shares(n: vec3f) -> vec3f {
  let q = n * n;
  let w = max(q * q - 0.05, vec3f(0.0));
  return w / (w.x + w.y + w.z);
}

// Noise on the planes that a surface faces, so that it is not drawn out on any slope.
fn rough_at(p: vec3f, n: vec3f, f: Footprint, scale: f32, turn: vec2f) -> Rough {
  let w = plane_shares(n);
  var out = Rough(0.0, 0.0, vec3f(0.0));
  if (w.z > 0.0) {
    let t = ground_noise(p, f, scale, turn);
    out = Rough(t.r * w.z, t.g * w.z, vec3f(noise_slope(t) * w.z, 0.0));
  }
  if (w.x > 0.0) {
    let t = noise_sample(p.yz, f.dx.yz, f.dy.yz, scale);
    out = Rough(out.r + t.r * w.x, out.g + t.g * w.x, out.lean + vec3f(0.0, noise_slope(t) * w.x));
  }
  if (w.y > 0.0) {
    let t = noise_sample(p.xz, f.dx.xz, f.dy.xz, scale);
    let g = noise_slope(t) * w.y;
    out = Rough(out.r + t.r * w.y, out.g + t.g * w.y, out.lean + vec3f(g.x, 0.0, g.y));
  }
  return out;
}

// Features of some 8 m.
fn medium_noise(p: vec3f, n: vec3f, f: Footprint) -> Rough {
  return rough_at(p, n, f, 37.0, vec2f(0.707, -0.707));
}

// Features of some ten to some hundred pixels.
fn broad_following(p: vec3f, n: vec3f, f: Footprint, footprint: f32, fine: Rough) -> Rough {
  return following(p, n, f, footprint, 7.0);
}

// Slope of ripples (waves on water, wind on sand) at a phase, `footprint` metres a pixel, `length` metres from crest to crest.
fn ripple_slope(along: vec2f, phase: f32, footprint: f32, length: f32) -> vec2f {
  return along * (cos(phase) + 0.35 * cos(2.0 * phase + 0.7)) * smoothstep(0.30 * length, 0.08 * length, footprint);
}

fn small_waves(p: vec2f, drift: vec2f, lod: f32) -> vec2f {
  let c = textureSampleLevel(noise, smooth_repeat, (p - drift * 1.7) / 11.0, max(lod - log2(11.0), 0.0));
  return noise_slope(c) * 0.035;
}
