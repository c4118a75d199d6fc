// Lakes in basins (frontend/src/tiles/lakes/lakes.ts): a sample of `lake_map` says where the ground lies and at what level the lake
// stands that covers it, or whose shore it is.
const NO_LAKE: f32 = -1.0e9;
// Metres above a lake that mean: there is none.
const FAR_ABOVE: f32 = 1.0e4;

// Where a place lies between the samples of the map: the sample to its south-west in whole numbers, and the rest.
fn lake_lattice(p: vec2f) -> vec2f {
  return clamp(p / view.size, vec2f(0.0), vec2f(1.0)) * f32(textureDimensions(lake_map).x - 1u);
}

fn lake_cell(at: vec2f) -> vec2i {
  return min(vec2i(at), vec2i(i32(textureDimensions(lake_map).x) - 2));
}

fn lake_sample(i: vec2i) -> vec2f {
  return textureLoad(lake_map, i, 0).xy;
}

// Lower ground that is not the lake's: beyond its brim.
fn beyond(s: vec2f, lake: f32) -> bool {
  return s.y < lake && s.x < lake;
}

// Metres above the lake beside a place, FAR_ABOVE where none is near.
fn above_lake(p: vec3f) -> f32 {
  if (view.has_lakes < 0.5) { return FAR_ABOVE; }
  let i = lake_cell(lake_lattice(p.xy));
  let a = lake_sample(i);
  let b = lake_sample(i + vec2i(1, 0));
  let c = lake_sample(i + vec2i(0, 1));
  let d = lake_sample(i + vec2i(1, 1));
  let lake = max(max(a.y, b.y), max(c.y, d.y));
  if (beyond(a, lake) || beyond(b, lake) || beyond(c, lake) || beyond(d, lake)) { return FAR_ABOVE; }
  return min(p.z - lake, FAR_ABOVE);
}

// Ground at a place, metres.
fn lake_ground(p: vec2f) -> f32 {
  let at = lake_lattice(p);
  let i = lake_cell(at);
  let f = at - vec2f(i);
  let south = mix(lake_sample(i).x, lake_sample(i + vec2i(1, 0)).x, f.x);
  let north = mix(lake_sample(i + vec2i(0, 1)).x, lake_sample(i + vec2i(1, 1)).x, f.x);
  return mix(south, north, f.y);
}

fn covers(s: vec2f, lake: f32) -> bool {
  return s.y == lake && s.x < lake;
}

// Returns how far one sample lies inside a lake or above it, metres; below zero on lower ground that is not the lake's.
fn lake_side(s: vec2f, lake: f32) -> f32 {
  return select(s.x - lake, lake - s.x, covers(s, lake));
}

// Returns whether a place between samples lies in a lake. A lake ends where the ground outside its basin falls below it.
// Where the lake covers none of the four samples around, all four must be its shore: beyond the brim finer ground may dip
// below the lake.
fn inside_lake(p: vec2f, lake: f32) -> f32 {
  let at = lake_lattice(p);
  let i = lake_cell(at);
  let f = at - vec2f(i);
  let a = lake_sample(i);
  let b = lake_sample(i + vec2i(1, 0));
  let c = lake_sample(i + vec2i(0, 1));
  let d = lake_sample(i + vec2i(1, 1));
  let shore = a.y == lake && b.y == lake && c.y == lake && d.y == lake;
  if (!shore && !(covers(a, lake) || covers(b, lake) || covers(c, lake) || covers(d, lake))) { return -1.0; }
  let south = mix(lake_side(a, lake), lake_side(b, lake), f.x);
  let north = mix(lake_side(c, lake), lake_side(d, lake), f.x);
  return mix(south, north, f.y);
}
