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
  macro1: vec4f,     // features of a third and of a fifteenth of the domain
  macro2: vec4f,
  fine1: vec4f,      // features of some 25 m, 6 m and 1 m
  fine2: vec4f,
  fine3: vec4f,
};

fn survey(p: vec3f, gradient: vec2f, curvature: f32, f: Footprint) -> Site {
  let n = normalize(vec3f(-gradient, 1.0));
  var s: Site;
  s.p = p;
  s.n = n;
  s.steep = length(gradient);
  s.height = (p.z - select(0.0, view.sea, view.has_sea > 0.5)) / view.size;
  s.curvature = curvature;
  s.macro1 = ground_noise(p, f, view.size * 1.37, vec2f(0.917, -0.399));
  s.macro2 = ground_noise(p, f, view.size * 0.27, vec2f(0.602, 0.799));
  s.fine1 = rock_noise(p, n, f, 103.0);
  if (DETAIL > 1u) {
    s.fine2 = rock_noise(p, n, f, 25.0);
    s.fine3 = ground_noise(p, f, 4.9, vec2f(0.707, -0.707));
  } else {
    s.fine2 = vec4f(s.fine1.g, s.fine1.r, s.fine1.ba);
    s.fine3 = vec4f(0.5);
  }
  return s;
}

// 1 where the ground is steeper than `at`, wandering with the noise.
fn steeper(s: Site, at: f32, soft: f32) -> f32 {
  return smoothstep(at - soft, at + soft, s.steep + (s.fine1.r - 0.5) * 0.30 + (s.macro2.r - 0.5) * 0.22);
}

fn fine_slope(s: Site, strength: f32) -> vec2f {
  return strength * (0.22 * noise_slope(s.macro2) + 0.34 * noise_slope(s.fine1) + 0.42 * noise_slope(s.fine2) + 0.36 * noise_slope(s.fine3));
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

fn natural(s: Site) -> Material {
  // Meadows: lush in hollows and low down, dry and pale on rises and higher up.
  let dry = smoothstep(0.25, 0.85, 0.5 + (s.macro1.r - 0.5) * 1.5 + (s.macro2.r - 0.5) * 0.7 + s.height * 3.2 - s.curvature * 0.8);
  let tone = 0.86 + 0.26 * (s.fine1.r - 0.5) + 0.30 * (s.fine2.r - 0.5) + 0.20 * (s.macro2.g - 0.5);
  let meadow = mix(vec3f(0.088, 0.122, 0.034), vec3f(0.215, 0.186, 0.084), dry) * tone;
  var m = Material(meadow, fine_slope(s, 0.13), 0.0);
  // Forest in large woods with frayed edges, on gentle and moderate slopes below the tree line.
  let line = 0.085 + (s.macro1.g - 0.5) * 0.03 + (s.macro2.r - 0.5) * 0.02;
  let below = 1.0 - smoothstep(line * 0.62, line, s.height);
  let grows = (1.0 - smoothstep(0.70, 1.0, s.steep)) * below;
  let cover = s.macro1.g * 0.50 + s.macro2.r * 0.42 + s.fine1.r * 0.12 + clamp(s.steep, 0.0, 0.6) * 0.16 + clamp(s.curvature, -0.1, 0.1) * 0.9;
  let wood = smoothstep(0.575, 0.64, cover) * grows;
  let crown = mix(vec3f(0.024, 0.046, 0.018), vec3f(0.052, 0.074, 0.024), s.macro2.g) * (0.55 + 0.9 * s.fine2.r);
  m = mix_in(m, Material(crown, fine_slope(s, 0.55), 0.0), wood * 0.94);
  // Scree and rubble below the faces, and the bare ground above the meadows.
  let rubble = Material(vec3f(0.225, 0.200, 0.168) * (0.74 + 0.5 * s.fine2.r), fine_slope(s, 0.26), 0.0);
  m = mix_in(m, rubble, steeper(s, 0.72, 0.17) * 0.8);
  let alp = smoothstep(0.105, 0.165, s.height + (s.macro2.r - 0.5) * 0.05 + (s.fine1.r - 0.5) * 0.02);
  m = mix_in(m, rubble, alp * 0.75);
  let rock = Material(rock_colour(s, vec3f(0.300, 0.262, 0.222), vec3f(0.098, 0.088, 0.080)), fine_slope(s, 0.62), 0.0);
  m = mix_in(m, rock, steeper(s, 0.93, 0.19));
  m = shore(m, s);
  // Snow: high, not too steep, lower on the north side and in hollows.
  let snow_line = 0.150 - 0.030 * clamp(s.n.y, -1.0, 1.0) - clamp(s.curvature, -0.4, 0.4) * 0.05 + (s.macro2.r - 0.5) * 0.040 + (s.fine1.r - 0.5) * 0.022;
  let snow = smoothstep(snow_line, snow_line + 0.014, s.height) * (1.0 - smoothstep(0.85, 1.35, s.steep + (s.fine1.g - 0.5) * 0.8));
  return mix_in(m, Material(vec3f(0.80, 0.83, 0.87), fine_slope(s, 0.10), 0.5), snow);
}

fn alpine(s: Site) -> Material {
  let snow_colour = vec3f(0.78, 0.81, 0.86) * (0.94 + 0.10 * s.macro2.r);
  var m = Material(snow_colour, fine_slope(s, 0.15), 0.5);
  let line = 0.075 + (s.macro1.g - 0.5) * 0.03;
  let trees = (1.0 - smoothstep(line * 0.6, line, s.height)) * (1.0 - smoothstep(0.7, 1.0, s.steep));
  let cover = s.macro1.g * 0.48 + s.macro2.r * 0.42 + s.fine1.r * 0.14 + clamp(s.steep, 0.0, 0.6) * 0.2 + clamp(s.curvature, -0.1, 0.1) * 0.9;
  let wood = smoothstep(0.56, 0.64, cover) * trees;
  let crown = mix(vec3f(0.026, 0.038, 0.030), vec3f(0.34, 0.37, 0.40), smoothstep(0.52, 0.75, s.fine2.r));
  m = mix_in(m, Material(crown, fine_slope(s, 0.6), 0.1), wood * 0.92);
  let rock = Material(rock_colour(s, vec3f(0.215, 0.200, 0.190), vec3f(0.070, 0.068, 0.070)), fine_slope(s, 0.85), 0.0);
  // Snow keeps to ledges: the fine relief decides.
  let bare = smoothstep(0.78, 1.22, s.steep + (s.fine1.g - 0.5) * 0.62 + (s.fine2.r - 0.5) * 0.3 + (s.macro2.r - 0.5) * 0.3 + clamp(-s.curvature, -0.3, 0.3) * 0.6);
  m = mix_in(m, rock, bare);
  return shore(m, s);
}

fn desert(s: Site) -> Material {
  let sand = mix(vec3f(0.50, 0.335, 0.190), vec3f(0.58, 0.430, 0.270), s.macro1.r) * (0.90 + 0.20 * s.fine1.r);
  // Ripples across the wind, bent by the noise.
  let phase = dot(s.p.xy, vec2f(0.62, 0.78)) * 0.55 + s.fine1.r * 9.0 + s.macro2.r * 30.0;
  var m = Material(sand, fine_slope(s, 0.10) + vec2f(0.62, 0.78) * cos(phase) * 0.05 * f32(DETAIL > 1u) * smoothstep(6.0, 1.0, length(fwidth_safe(s.p))), 0.0);
  let z = s.p.z + (s.macro2.r - 0.5) * view.size * 0.010 + (s.fine1.r - 0.5) * 5.0;
  let thick = fract(z * 27.0 / view.size);
  let thin = fract(z * 121.0 / view.size + 0.3);
  var bed = mix(vec3f(0.385, 0.185, 0.105), vec3f(0.50, 0.300, 0.180), smoothstep(0.25, 0.5, thick) - smoothstep(0.75, 1.0, thick));
  bed = mix(bed, vec3f(0.62, 0.47, 0.34), 0.45 * (smoothstep(0.62, 0.7, thin) - smoothstep(0.88, 0.96, thin)));
  let varnish = mix(vec3f(0.55), vec3f(1.05), clamp(s.fine1.g * 0.7 + s.fine2.g * 0.45, 0.0, 1.0));
  let rock = Material(bed * varnish, fine_slope(s, 0.75), 0.0);
  m = mix_in(m, rock, steeper(s, 0.56, 0.16));
  let brush = smoothstep(0.60, 0.70, s.fine2.r * 0.6 + s.macro2.r * 0.5) * (1.0 - smoothstep(0.2, 0.5, s.steep)) * 0.55;
  m = mix_in(m, Material(vec3f(0.135, 0.125, 0.060), fine_slope(s, 0.4), 0.0), brush);
  return shore(m, s);
}

fn paper(s: Site) -> Material {
  let grain = 0.97 + 0.05 * (s.fine2.r - 0.5) + 0.03 * (s.fine3.r - 0.5);
  return Material(vec3f(0.80, 0.705, 0.545) * grain, fine_slope(s, 0.02), 0.0);
}

fn fwidth_safe(p: vec3f) -> vec2f {
  return vec2f(pixel_size(p));
}

fn ground_material(s: Site) -> Material {
  switch (view.look) {
    case LOOK_ALPINE: { return alpine(s); }
    case LOOK_DESERT: { return desert(s); }
    case LOOK_PAPER: { return paper(s); }
    default: { return natural(s); }
  }
}
