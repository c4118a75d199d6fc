// The functions of detail_rich.wgsl for adapters that draw on the CPU: one sample where the others take many.
const NOISE_TEXELS: f32 = 256.0;
// Steps of the march for what the water mirrors.
const MIRROR_STEPS: i32 = 4;
// What is left of the height on faces: the noise there is drawn out downhill, as water cuts rock.
const DRAWN: f32 = 0.38;

fn noise_sample(at: vec2f, dx: vec2f, dy: vec2f, scale: f32) -> vec4f {
  let k = 1.0 / scale;
  let texels = max(dot(dx, dx), dot(dy, dy)) * (k * k * NOISE_TEXELS * NOISE_TEXELS);
  return textureSampleLevel(noise, smooth_repeat, at * k, max(0.5 * log2(max(texels, 1.0e-6)), 0.0));
}

// On the plane that the surface faces most; on faces drawn out downhill, as water cuts rock. One sample for all three: these
// adapters compute both sides of a branch.
fn rock_noise(p: vec3f, n: vec3f, f: Footprint, scale: f32) -> vec4f {
  let a = abs(n);
  let level = a.z > 0.70;
  let east = a.x > a.y;
  let turn = vec2f(0.829, 0.559);
  let at = select(vec2f(select(p.x, p.y, east), p.z * DRAWN), turned(p.xy, turn), level);
  let dx = select(vec2f(select(f.dx.x, f.dx.y, east), f.dx.z * DRAWN), turned(f.dx.xy, turn), level);
  let dy = select(vec2f(select(f.dy.x, f.dy.y, east), f.dy.z * DRAWN), turned(f.dy.xy, turn), level);
  let s = noise_sample(at, dx, dy, scale);
  let g = s.ba - 0.5;
  let lying = vec2f(g.x * turn.x + g.y * turn.y, g.y * turn.x - g.x * turn.y) + 0.5;
  let standing = select(vec2f(s.b, 0.5), vec2f(0.5, s.b), east);
  return vec4f(s.rg, select(standing, lying, level));
}

struct FineNoise {
  medium: vec4f,
  small: vec4f,
};

fn fine_noise(p: vec3f, n: vec3f, f: Footprint, coarse: vec4f) -> FineNoise {
  let medium = ground_noise(p, f, 31.0, vec2f(0.707, -0.707));
  return FineNoise(medium, vec4f(medium.g, medium.r, 0.5, 0.5));
}

fn ripple_slope(along: vec2f, phase: f32, footprint: f32) -> vec2f {
  return vec2f(0.0);
}

fn small_waves(p: vec2f, drift: vec2f, lod: f32) -> vec2f {
  return vec2f(0.0);
}
