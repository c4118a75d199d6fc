// What the ground is made of, by slope, height, curvature and noise.
struct Material {
  albedo: vec3f,
  slope: vec2f,      // gradient of the fine relief, added to that of the surface
  gloss: f32,        // strength of the sun's sheen (snow, wet sand)
};

struct Site {
  p: vec3f,
  n: vec3f,          // normal of the surface
  steep: f32,        // tangent of the slope
  height: f32,       // above the sea or zero, as a fraction of the domain
  curvature: f32,
  gain: vec4f,       // of the fine relief, features of a fifteenth of the domain to those of 1 m: 1 where nothing is asked
  macro1: vec4f,     // features of a third and of a fifteenth of the domain
  macro2: vec4f,
  fine1: vec4f,      // features of some 25 m, 6 m and 1 m
  fine2: vec4f,
  fine3: vec4f,
};

// What strokes ask of the fine relief: amplitude raises all of it, most what does not repeat within sight; roughness tips
// it from broad to small features.
fn relief_gain(detail: vec2f) -> vec4f {
  let strength = 1.0 - exp(-detail.x * view.amplitude / (0.004 * view.size));
  return (1.0 + strength * vec4f(6.0, 0.6, 1.5, 1.5)) * exp2((detail.y - 0.5) * vec4f(-1.2, 0.2, 1.2, 2.0));
}

fn survey(p: vec3f, gradient: vec2f, curvature: f32, f: Footprint, detail: vec2f) -> Site {
  let n = normalize(vec3f(-gradient, 1.0));
  var s: Site;
  s.p = p;
  s.n = n;
  s.steep = length(gradient);
  s.height = (p.z - select(0.0, view.sea, view.has_sea > 0.5)) / view.size;
  s.curvature = curvature;
  s.gain = relief_gain(detail);
  s.macro1 = ground_noise(p, f, view.size * 1.37, vec2f(0.917, -0.399));
  s.macro2 = ground_noise(p, f, view.size * 0.27, vec2f(0.602, 0.799));
  s.fine1 = rock_noise(p, n, f, 103.0);
  let fine = fine_noise(p, n, f, s.fine1);
  s.fine2 = fine.medium;
  s.fine3 = fine.small;
  return s;
}

// 1 where the ground is steeper than `at`, wandering with the noise.
fn steeper(s: Site, at: f32, soft: f32) -> f32 {
  return smoothstep(at - soft, at + soft, s.steep + (s.fine1.r - 0.5) * 0.30 * s.gain.y + (s.macro2.r - 0.5) * 0.22);
}

fn fine_slope(s: Site, strength: f32) -> vec2f {
  let g = strength * s.gain;
  return 0.22 * g.x * noise_slope(s.macro2) + 0.34 * g.y * noise_slope(s.fine1) + 0.42 * g.z * noise_slope(s.fine2)
    + 0.36 * g.w * noise_slope(s.fine3);
}

fn rock_colour(s: Site, light: vec3f, dark: vec3f) -> vec3f {
  // Beds, tilted and warped, and the grain of weathered faces.
  let z = s.p.z + 0.10 * s.p.x + (s.macro2.r - 0.5) * view.size * 0.035 + (s.fine1.r - 0.5) * 12.0;
  let bed = 0.5 + 0.5 * sin(z * 380.0 / view.size + 2.0 * sin(z * 97.0 / view.size));
  let grain = 0.42 * s.fine1.g + 0.32 * s.fine2.g + 0.16 * s.macro2.g + 0.10 * s.fine3.r;
  return mix(dark, light, clamp((grain - 0.5) * 1.5 + 0.42 + (bed - 0.5) * 0.26, 0.0, 1.0));
}

fn mix_in(under: Material, over: Material, amount: f32) -> Material {
  return Material(mix(under.albedo, over.albedo, amount), mix(under.slope, over.slope, amount), mix(under.gloss, over.gloss, amount));
}

fn shore(m: Material, s: Site) -> Material {
  if (view.has_sea < 0.5) { return m; }
  let wander = (s.macro2.r - 0.5) * 0.006 + (s.fine1.r - 0.5) * 0.003;
  let low = 1.0 - smoothstep(0.0012, 0.0034, s.height + wander * 0.7);
  let gentle = 1.0 - smoothstep(0.42, 0.75, s.steep);
  let dry = vec3f(0.44, 0.37, 0.25) * (0.86 + 0.28 * s.fine2.r);
  // Wet below and just above the water line.
  let wet = 1.0 - smoothstep(-0.0002, 0.0016, s.height + wander * 0.4);
  let sand = Material(mix(dry, dry * vec3f(0.50, 0.47, 0.44), wet), fine_slope(s, 0.10), 0.15 * wet);
  return mix_in(m, sand, low * gentle);
}
