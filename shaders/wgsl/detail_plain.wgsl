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

// On the plane that the surface faces most; on faces drawn out downhill, as water cuts rock.
fn rock_noise(p: vec3f, n: vec3f, f: Footprint, scale: f32) -> vec4f {
  let a = abs(n);
  if (a.z > 0.70) { return ground_noise(p, f, scale, vec2f(0.829, 0.559)); }
  let east = a.x > a.y;
  let s = noise_sample(
    vec2f(select(p.x, p.y, east), p.z * DRAWN), vec2f(select(f.dx.x, f.dx.y, east), f.dx.z * DRAWN),
    vec2f(select(f.dy.x, f.dy.y, east), f.dy.z * DRAWN), scale);
  return select(vec4f(s.rg, s.b, 0.5), vec4f(s.rg, 0.5, s.b), east);
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
