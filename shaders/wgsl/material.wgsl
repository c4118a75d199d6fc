// What the ground is made of: by what grows and lies on it (Attributes), slope, height, curvature and noise.
struct Material {
  albedo: vec3f,
  slope: vec2f,      // gradient of the fine relief, added to that of the surface
  gloss: f32,        // strength of the sun's sheen (snow, wet ground)
  soft: f32,         // how far light goes round the edge of a shadow (snow, leaves)
};

// What the synthesis says of a place (DESIGN 10), 0..1 each.
struct Attributes {
  snow: f32,
  wet: f32,
  foam: f32,
  smoothness: f32,   // half the exponent h: 0 rough, 1 smooth
  grass: f32,
  forest: f32,
  grain: f32,        // the noise of the place's own level
};

// Waves of a lake run up so many times less than those of the sea.
const LAKE_SHORES: f32 = 4.0;

struct Site {
  p: vec3f,
  n: vec3f,          // normal of the surface
  steep: f32,        // tangent of the slope
  height: f32,       // above the sea or zero, as a fraction of the relief: the domain, or the climate of a real place
  shore: f32,        // above the nearest water, the same for shores: those of lakes are narrower
  inland: f32,       // 1 where that water is a lake
  curvature: f32,
  footprint: f32,    // metres that a pixel covers
  f: Footprint,
  bent: vec3f,       // the place where the finer layers are read
  macro1: vec4f,     // features of a third and of a fifteenth of the domain
  macro2: vec4f,
  fine1: vec4f,      // features of some 50 m, 8 m and 1 m
  fine2: vec4f,
  fine3: vec4f,
  cover: Attributes,
};

fn survey(p: vec3f, gradient: vec2f, curvature: f32, f: Footprint, cover: Attributes, above_lake: f32) -> Site {
  let n = normalize(vec3f(-gradient, 1.0));
  var s: Site;
  s.p = p;
  s.n = n;
  s.steep = length(gradient);
  let above = p.z - view.sea;
  s.height = above / view.relief;
  let coast = select(FAR_ABOVE, above, view.has_sea > 0.5);
  s.shore = min(coast, LAKE_SHORES * above_lake) / view.shore;
  s.inland = select(0.0, 1.0, LAKE_SHORES * above_lake < coast);
  s.curvature = curvature;
  s.footprint = sqrt(max(max(dot(f.dx, f.dx), dot(f.dy, f.dy)), 1.0e-8));
  s.f = f;
  s.macro1 = ground_noise(p, f, view.size * 1.37, vec2f(0.917, -0.399));
  s.macro2 = ground_noise(p, f, view.size * 0.27, vec2f(0.602, 0.799));
  // The finer layers are pushed about: what repeats is not seen to repeat. By waves, not by noise: where a texture of 8
  // bits is filtered in 8 bits, its steps would be cuts through the ground.
  s.bent = p + vec3f(sin(p.yx * vec2f(0.0071, 0.0059) + sin(p.xy * vec2f(0.0043, 0.0037)) * 1.7) * 45.0, 0.0);
  s.fine1 = rock_noise(s.bent, n, f, 211.0);
  let fine = fine_noise(s.bent, n, f, s.fine1);
  s.fine2 = fine.medium;
  s.fine3 = fine.small;
  s.cover = cover;
  return s;
}

// 1 where there is more than half of a cover, its edge frayed by noise (`fray` about 0, a few tenths wide).
fn covered(amount: f32, fray: f32, soft: f32) -> f32 {
  return smoothstep(0.5 - soft, 0.5 + soft, amount + fray);
}

// 1 where the ground is steeper than `at`, wandering with the noise.
fn steeper(s: Site, at: f32, soft: f32) -> f32 {
  return smoothstep(at - soft, at + soft, s.steep + (s.fine1.r - 0.5) * 0.36 + (s.macro2.r - 0.5) * 0.22);
}

// Where the eye is near, the ground's own samples show the relief that a layer stands for further off.
fn fine_slope(s: Site, strength: f32) -> vec2f {
  let near = 0.45 + 0.55 * smoothstep(vec4f(0.0), vec4f(6.0, 1.0, 0.16, 0.020), vec4f(s.footprint));
  // Rough ground is rough at every size: the smoothness channel sets the drawn relief too.
  let g = strength * near * (1.35 - 0.7 * s.cover.smoothness);
  return 0.20 * g.x * noise_slope(s.macro2) + 0.40 * g.y * noise_slope(s.fine1) + 0.42 * g.z * noise_slope(s.fine2)
    + 0.36 * g.w * noise_slope(s.fine3);
}

// Beds of rock, tilted and warped: a column of noise that is read along the height and drawn out sideways, so beds are thick
// and thin, run out, and fade before they are finer than pixels. rg as the noise; a: of a bed's top (above 0.5) or foot.
fn strata(s: Site) -> vec4f {
  let unit = view.size / 4096.0;
  let dip = vec3f(0.11, -0.06, 1.0);
  let run = vec3f(0.034, 0.026, 0.0);
  let warp = (s.macro2.r - 0.5) * 62.0 + (s.fine1.r - 0.5) * 7.0;
  let at = vec2f(dot(s.p, run), dot(s.p, dip)) / unit + vec2f(0.0, warp);
  return noise_sample(at, vec2f(dot(s.f.dx, run), dot(s.f.dx, dip)) / unit, vec2f(dot(s.f.dy, run), dot(s.f.dy, dip)) / unit, 330.0);
}

// Dark lines where the ridges of a noise run together.
fn cracks(ridged: f32) -> f32 {
  return smoothstep(0.66, 0.90, ridged);
}

// Weathered rock: beds that stand out as ledges, streaks and joints down the faces, broad stains.
fn rock(s: Site, light: vec3f, dark: vec3f, relief: f32) -> Material {
  let beds = strata(s);
  let bed = smoothstep(0.38, 0.60, beds.r) - 0.5;
  let grain = (s.fine1.r - 0.5) * 0.85 + (s.fine2.g - 0.5) * 0.30 + (s.fine3.r - 0.5) * 0.25;
  let tone = clamp(0.44 + bed * 0.36 + grain + (s.macro2.g - 0.5) * 0.6, 0.0, 1.0);
  // Stains: rust where iron weathers out of some beds, grey lichen elsewhere.
  let rust = smoothstep(0.42, 0.74, s.macro2.r * 0.75 + beds.g * 0.25 + (s.fine1.g - 0.5) * 0.3);
  let hue = mix(vec3f(0.93, 0.99, 1.08), vec3f(1.10, 0.99, 0.87), rust);
  // Dark where water runs and where light does not reach: in hollows, joints, under ledges.
  let seep = smoothstep(0.03, 0.35, s.curvature + (s.fine1.r - 0.5) * 0.25);
  let joint = 0.50 * cracks(s.fine1.g) + 0.34 * cracks(s.fine2.g) + 0.40 * cracks(beds.g);
  let shade = (1.0 - 0.30 * seep) * (1.0 - min(joint, 0.75));
  let ledge = s.n.xy * ((beds.a - 0.5) * 2.6 * min(s.steep, 1.2));
  return broken(Material(mix(dark, light, tone) * hue * shade, fine_slope(s, relief) + ledge, 0.0, 0.0), s, 1.0);
}

// Stones below the faces.
fn scree(s: Site, colour: vec3f) -> Material {
  let grain = 0.42 + 0.34 * s.fine1.r + 0.46 * s.fine2.g + 0.30 * s.fine3.r;
  return heaped(Material(colour * grain, fine_slope(s, 0.26), 0.0, 0.0), s, 1.0);
}

// How much of a forest's crowns is seen: who stands among the trees sees what grows below them.
fn afar(s: Site) -> f32 {
  return 0.25 + 0.75 * smoothstep(0.04, 0.35, s.footprint);
}

// Crowns: a relief of their own, dark between.
fn canopy(s: Site, dark: vec3f, light: vec3f) -> Material {
  let crown = smoothstep(0.22, 0.78, 0.30 * s.fine1.g + 0.55 * s.fine2.r + 0.15 * s.fine3.r);
  let stand = smoothstep(0.25, 0.75, s.macro2.g * 0.6 + s.fine1.r * 0.4);
  return crowned(Material(mix(dark, light, stand) * (0.28 + 1.30 * crown), fine_slope(s, 0.62), 0.0, 0.20), s);
}

fn snowfield(s: Site) -> Material {
  let drift = 0.97 + 0.05 * (s.macro2.r - 0.5) + 0.03 * (s.fine1.r - 0.5);
  return Material(vec3f(0.80, 0.83, 0.87) * drift, fine_slope(s, 0.07), 0.5, 0.30);
}

fn mix_in(under: Material, over: Material, amount: f32) -> Material {
  return Material(mix(under.albedo, over.albedo, amount), mix(under.slope, over.slope, amount),
    mix(under.gloss, over.gloss, amount), mix(under.soft, over.soft, amount));
}

// Wet ground is darker, richer in colour, and shines.
fn soaked(m: Material, wet: f32) -> Material {
  return Material(m.albedo * mix(vec3f(1.0), vec3f(0.58, 0.55, 0.52), wet), m.slope * (1.0 - 0.4 * wet), max(m.gloss, 0.22 * wet), m.soft);
}

fn shore(m: Material, s: Site, colour: vec3f) -> Material {
  if (max(view.has_sea, view.has_lakes) < 0.5) { return m; }
  let wander = (s.macro2.r - 0.5) * 0.006 + (s.fine1.r - 0.5) * 0.003;
  let low = 1.0 - smoothstep(0.0012, 0.0034, s.shore + wander * 0.7);
  let gentle = 1.0 - smoothstep(0.42, 0.75, s.steep + (s.fine1.g - 0.5) * 0.3);
  // Beaches of sand by the sea, of pebbles and mud by a lake.
  let beach = mix(colour, colour * vec3f(0.58, 0.60, 0.64), s.inland) * (0.86 + 0.28 * s.fine2.r);
  let sand = Material(beach, fine_slope(s, 0.08 + 0.10 * s.inland), 0.0, 0.0);
  // Below the water and a hand above it.
  let wet = 1.0 - smoothstep(-0.0002, 0.0010, s.shore + wander * 0.3);
  return soaked(mix_in(m, sand, low * gentle), wet);
}
