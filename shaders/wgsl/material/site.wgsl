// A place on the ground as materials see it, what they are, and how one lies over another.
struct Material {
  albedo: vec3f,
  relief: vec3f,     // gradient of the fine relief in the world's axes, in slopes: it turns the normal on any slope alike
  gloss: f32,        // strength of the sun's sheen (snow, wet ground)
  soft: f32,         // how far light goes round the edge of a shadow (snow, leaves)
  open: f32,         // share of the sky that the fine relief leaves: less in joints and between stones
  high: f32,         // how high the fine relief stands here, 0..1: what is high shows first through what lies on it
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
// Float32 tells places of the domain this share of its side apart.
const FINEST_PLACE: f32 = 1.0e-7;

struct Site {
  p: vec3f,
  n: vec3f,          // normal of the surface
  faces: vec3f,      // which way the drawn triangle faces, a little smoothed: noise is read on the planes that this says
  steep: f32,        // tangent of the slope
  height: f32,       // above the sea or zero, as a fraction of the relief: the domain, or the climate of a real place
  shore: f32,        // above the nearest water, the same for shores: those of lakes are narrower
  inland: f32,       // 1 where that water is a lake
  curvature: f32,
  footprint: f32,    // metres that a pixel covers, as it is sampled
  f: Footprint,
  bent: vec3f,       // the place where the finer layers are read
  macro1: vec4f,     // features of a third and of a fifteenth of the domain
  macro2: vec4f,
  fine1: Rough,      // features of some 50 m and 8 m
  fine2: Rough,
  near: Rough,       // features of two to some ten pixels
  wide: Rough,       // and of ten to some hundred, wherever the eye is
  cover: Attributes,
};

fn survey(p: vec3f, gradient: vec2f, curvature: f32, f: Footprint, cover: Attributes, above_lake: f32) -> Site {
  let n = normalize(vec3f(-gradient, 1.0));
  var s: Site;
  s.p = p;
  s.n = n;
  s.faces = faced(n, f);
  s.steep = length(gradient);
  let above = p.z - view.sea;
  s.height = above / view.relief;
  let coast = select(FAR_ABOVE, above, view.has_sea > 0.5);
  s.shore = min(coast, LAKE_SHORES * above_lake) / view.shore;
  s.inland = select(0.0, 1.0, LAKE_SHORES * above_lake < coast);
  s.curvature = curvature;
  s.footprint = sampled_footprint(p, s.faces);
  s.f = f;
  s.macro1 = ground_noise(p, f, view.size * 1.37, vec2f(0.917, -0.399));
  s.macro2 = ground_noise(p, f, view.size * 0.27, vec2f(0.602, 0.799));
  // The finer layers are pushed about: what repeats is not seen to repeat. By waves, not by noise: where a texture of 8
  // bits is filtered in 8 bits, its steps would be cuts through the ground.
  s.bent = p + vec3f(sin(p.yx * vec2f(0.0071, 0.0059) + sin(p.xy * vec2f(0.0043, 0.0037)) * 1.7) * 45.0, 0.0);
  s.fine1 = rough_at(s.bent, s.faces, f, 211.0, vec2f(0.829, 0.559));
  s.fine2 = medium_noise(s.bent, s.faces, f);
  let footprint = max(s.footprint, view.size * FINEST_PLACE);
  s.near = following(s.p, s.faces, f, footprint, 1.2);
  s.wide = broad_following(s.p, s.faces, f, footprint, s.near);
  s.cover = cover;
  return s;
}

// Where a wall stands between two samples, the smooth normal lies half-way between it and the level ground, and noise read by it
// would be drawn out on the wall.
fn faced(n: vec3f, f: Footprint) -> vec3f {
  let across = cross(f.dx, f.dy);
  let area = max(length(across), 1.0e-12);
  let face = across * (select(1.0, -1.0, across.z < 0.0) / area);
  return normalize(n + 2.0 * face);
}

// Metres that a pixel covers. Where the ground is seen at a flat angle, a sampler covers its length with several samples.
fn sampled_footprint(p: vec3f, n: vec3f) -> f32 {
  return pixel_size(p) * clamp(1.0 / (LONGEST * max(abs(dot(n, ray_to(p))), 0.02)), 1.0, 12.0);
}

// 1 where there is more than half of a cover, its edge frayed by noise (`fray` about 0, a few tenths wide).
fn covered(amount: f32, fray: f32, soft: f32) -> f32 {
  return smoothstep(0.5 - soft, 0.5 + soft, amount + fray);
}

// How much of a cover lies where there is some of it: a wide border in which it breaks into patches, thins out and keeps to the
// places that `hold` it (about 0, some tenths wide); none where there is none, all where there is all.
fn scattered(amount: f32, hold: f32) -> f32 {
  let border = 4.0 * amount * (1.0 - amount);
  return smoothstep(0.18, 0.82, amount + hold * border);
}

// 1 where the ground is steeper than `at`, wandering with the noise.
fn steeper(s: Site, at: f32, soft: f32) -> f32 {
  let ragged = (s.fine1.r - 0.5) * 0.36 + (s.macro2.r - 0.5) * 0.22 + (s.fine2.r - 0.5) * 0.20 + (s.near.r - 0.5) * 0.10;
  return smoothstep(at - soft, at + soft, s.steep + ragged);
}

// The relief that layers stand for. Where the eye is near, the ground's own samples show that of the broad ones.
fn fine_relief(s: Site, strength: f32) -> vec3f {
  let near = smoothstep(vec3f(0.0), vec3f(6.0, 1.0, 0.16), vec3f(s.footprint));
  // Rough ground is rough at every size: the smoothness channel sets the drawn relief too.
  let g = strength * (1.35 - 0.7 * s.cover.smoothness);
  let far = (0.45 + 0.55 * near) * g;
  return vec3f(0.20 * far.x * noise_slope(s.macro2), 0.0) + 0.34 * far.y * s.fine1.lean + 0.34 * far.z * s.fine2.lean
    + (0.40 * s.near.lean + 0.34 * s.wide.lean) * g;
}

// What other materials are laid on where nothing of it will be seen.
fn bare_material() -> Material {
  return Material(vec3f(0.15), vec3f(0.0), 0.0, 0.0, 1.0, 0.5);
}

fn mix_in(under: Material, over: Material, amount: f32) -> Material {
  return Material(mix(under.albedo, over.albedo, amount), mix(under.relief, over.relief, amount),
    mix(under.gloss, over.gloss, amount), mix(under.soft, over.soft, amount), mix(under.open, over.open, amount),
    mix(under.high, over.high, amount));
}

// The same with a broken edge: what stands high below shows through first, what stands high above lies on first.
fn laid(under: Material, over: Material, amount: f32) -> Material {
  let border = 4.0 * amount * (1.0 - amount);
  let part = amount + (over.high - under.high) * 0.7 * border;
  return mix_in(under, over, smoothstep(0.30, 0.70, part));
}
