// The functions of detail_rich.wgsl for adapters that draw on the CPU: one sample where the others take many.

// Steps of the march for what the water mirrors.
const MIRROR_STEPS: i32 = 4;
// These adapters sample each pixel as if it were as wide as it is long.
const LONGEST: f32 = 2.0;

fn noise_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  let texels = max(dot(dx, dx), dot(dy, dy)) * (k * k * NOISE_TEXELS * NOISE_TEXELS);
  return textureSampleLevel(noise, smooth_repeat, at * k, max(0.5 * log2(max(texels, 1.0e-6)), 0.0));
}

// On the plane that the surface faces most: one sample for all three, as these adapters compute both sides of a branch.
fn rough_at(p: vec3f, n: vec3f, f: Footprint, scale: f32, turn: vec2f) -> Rough {
  let a = abs(n);
  let level = a.z > 0.64;
  let east = a.x > a.y;
  let at = select(vec2f(select(p.x, p.y, east), p.z), turned(p.xy, turn), level);
  let dx = select(vec2f(select(f.dx.x, f.dx.y, east), f.dx.z), turned(f.dx.xy, turn), level);
  let dy = select(vec2f(select(f.dy.x, f.dy.y, east), f.dy.z), turned(f.dy.xy, turn), level);
  let s = noise_sample(at, dx, dy, scale);
  let g = noise_slope(s);
  let flat = vec3f(g.x * turn.x + g.y * turn.y, g.y * turn.x - g.x * turn.y, 0.0);
  let face = select(vec3f(g.x, 0.0, g.y), vec3f(0.0, g), east);
  return Rough(s.r, s.g, select(face, flat, level));
}

fn medium_noise(p: vec3f, n: vec3f, f: Footprint) -> Rough {
  return rough_at(p, n, f, 31.0, vec2f(0.707, -0.707));
}

fn broad_following(p: vec3f, n: vec3f, f: Footprint, footprint: f32, fine: Rough) -> Rough {
  return fine;
}

fn ripple_slope(along: vec2f, phase: f32, footprint: f32, length: f32) -> vec2f {
  return along * cos(phase) * smoothstep(0.30 * length, 0.08 * length, footprint);
}

fn small_waves(p: vec2f, drift: vec2f, lod: f32) -> vec2f {
  return vec2f(0.0);
}
