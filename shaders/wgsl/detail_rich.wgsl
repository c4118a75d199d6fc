// Fine detail for real GPUs. detail_plain.wgsl has the same functions for adapters that draw on the CPU; one of the two
// is part of each module. (Branches would not do: a CPU adapter computes both sides of them.)

// Steps of the march for what the water mirrors.
const MIRROR_STEPS: i32 = 16;
// What is left of the height on faces: the noise there is drawn out downhill, as water cuts rock.
const DRAWN: f32 = 0.38;

// `scale`: metres (or whatever `at` is in) that the texture covers once.
fn noise_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  return textureSampleGrad(noise, smooth_repeat, at * k, dx * k, dy * k);
}

// Rock that is the same on all faces: sampled on three planes, weighted by the normal. On faces it is drawn out
// downhill, as water cuts it.
fn rock_noise(p: vec3f, n: vec3f, f: Footprint, scale: f32) -> vec4f {
  var w = n * n;
  w = w * w;
  w /= w.x + w.y + w.z;
  let flat = ground_noise(p, f, scale, vec2f(0.829, 0.559));
  if (w.z > 0.97) { return flat; }
  let drawn = vec2f(1.0, DRAWN);
  let east = noise_sample(p.yz * drawn, f.dx.yz * drawn, f.dy.yz * drawn, scale);
  let north = noise_sample(p.xz * drawn, f.dx.xz * drawn, f.dy.xz * drawn, scale);
  // A face's own gradient runs along it and down: only the part along it turns a normal that is told by dz/dx, dz/dy.
  let e = vec4f(east.rg, 0.5, east.b);
  let o = vec4f(north.rg, north.b, 0.5);
  return flat * w.z + e * w.x + o * w.y;
}

struct FineNoise {
  medium: vec4f,   // features of some 9 m
  small: vec4f,    // and of 1 m
};

fn fine_noise(p: vec3f, n: vec3f, f: Footprint, coarse: vec4f) -> FineNoise {
  // Two sizes of small features, so that a texel is never seen large.
  let small = 0.55 * ground_noise(p, f, 4.9, vec2f(0.707, -0.707)) + 0.45 * ground_noise(p, f, 0.57, vec2f(0.436, 0.900));
  return FineNoise(rock_noise(p, n, f, 37.0), small);
}

// Slope of ripples (waves on water, wind on sand) at a phase, `footprint` metres a pixel.
fn ripple_slope(along: vec2f, phase: f32, footprint: f32) -> vec2f {
  return along * cos(phase) * 0.05 * smoothstep(6.0, 1.0, footprint);
}

fn small_waves(p: vec2f, drift: vec2f, lod: f32) -> vec2f {
  let c = textureSampleLevel(noise, smooth_repeat, (p - drift * 1.7) / 11.0, max(lod - log2(11.0), 0.0));
  return noise_slope(c) * 0.035;
}
