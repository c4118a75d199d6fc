// The noise texture (gpu/synthesis/noise.ts): r = gradient noise fbm, g = ridged fbm, both 0..1; ba = gradient of r. Tiles; its
// mipmaps fade detail out before it can shimmer.
const NOISE_GRADIENT: f32 = 8.0;
const NOISE_TEXELS: f32 = 256.0;

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

// Noise on a surface that may face any way.
struct Rough {
  r: f32,        // fbm, 0..1
  g: f32,        // ridged, 0..1
  lean: vec3f,   // gradient of r in the world's axes, in slopes
};

fn lying(n: vec4f) -> Rough {
  return Rough(n.r, n.g, vec3f(noise_slope(n), 0.0));
}

// Both as strong as one of them: what is mixed of two noises would be flatter than either.
fn between(a: Rough, b: Rough, t: f32) -> Rough {
  let k = inverseSqrt(t * t + (1.0 - t) * (1.0 - t));
  return Rough(0.5 + (mix(a.r, b.r, t) - 0.5) * k, 0.5 + (mix(a.g, b.g, t) - 0.5) * k, mix(a.lean, b.lean, t) * k);
}

// Noise whose features follow the distance: they are some pixels wide wherever the eye is, as rock and earth are rough at
// every size. `texel`: pixels that a texel of the noise covers, at least. Two scales, a factor of four apart, fade into each
// other; each is turned and moved its own way.
fn following(p: vec3f, n: vec3f, f: Footprint, footprint: f32, texel: f32) -> Rough {
  let e = 0.5 * log2(footprint * texel * NOISE_TEXELS);
  let step = floor(e);
  let t = smoothstep(0.15, 0.85, e - step);
  let scale = exp2(2.0 * step);
  let a = rough_at(p + vec3f(31.7, 77.3, 53.9) * step, n, f, scale, turn_of(step));
  let b = rough_at(p + vec3f(31.7, 77.3, 53.9) * (step + 1.0), n, f, 4.0 * scale, turn_of(step + 1.0));
  return between(a, b, t);
}

fn turn_of(step: f32) -> vec2f {
  return vec2f(cos(1.9 * step + 0.6), sin(1.9 * step + 0.6));
}
