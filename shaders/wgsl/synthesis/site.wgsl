// What the rule is told of a place: settings (gpu/synthesis/site.ts writes them), the ground, what strokes ask for.
// vec4f: the four children of a parent's cell, see synthesis/interpolate.wgsl.
struct SynthLevel {
  keys: vec4u,            // of the four streams of noise
  inverse_spacing: f32,   // of the samples that derivatives are taken from, 1/m: the parent's; level 0: its own
  tie: f32,               // how strictly channels follow their targets
  channel_noise: f32,
  smoothness_noise: f32,
  gully_key: u32,         // of the stream of gullies
  wave: f32,              // wavelength of the level's octave of gullies, metres
  depth: f32,             // its depth on a slope of 1, metres; level 0 has none, and tells that of level 1 by it
  pad0: f32,
};

struct SynthSite {
  size: f32,              // side of the domain, metres
  amplitude: f32,         // of the coarsest octave on steep ground, metres
  sea: f32,               // elevations count from here, metres
  has_sea: f32,           // 1 or 0
  snow_line: f32,         // of the look, elevations as shares of `relief`
  tree_line: f32,
  plants: f32,
  solved: u32,            // finest level whose guide is what was sent
  cyclic: u32,            // 1: the domain's east edge is its west edge
  channel_bits: u32,      // the channels' grid has 2^channel_bits cells a side
  varied: u32,            // 1: the channels differ from place to place
  biased: u32,            // 1: paint asks for snow, plants or wetness somewhere
  surveyed: u32,          // 1: elevation data hold detail back somewhere
  relief: f32,            // elevations are shares of it, metres
  shore: f32,             // those of wet shores of this
  stride: u32,            // pairs of a node of the channels: 3, or 5 where there are data or gullies
  eroded: u32,            // 1: there are gullies somewhere
  gully_side: i32,        // side of a cell of their lattice, samples
  erosion: f32,           // their strength
  hold: f32,              // how strictly what strokes fix keeps its height, 0..1
  far: f32,               // distance of which the channel is a share, metres
  far_margin: f32,        // what is taken off it, metres
  pad0: u32,
  pad1: u32,
  levels: array<SynthLevel, 18>,
};

// The parent's ground with its detail.
struct Ground {
  height: vec4f,
  slope_x: vec4f,
  slope_y: vec4f,
  concavity: vec4f,       // -1..1, positive in valleys
  guide_slope: vec4f,     // steepness of the guide alone
};

struct Asked {
  amplitude: vec4f,       // metres
  roughness: vec4f,       // 0..1
  snow: vec4f,            // the rest -1..1
  grass: vec4f,
  forest: vec4f,
  wetness: vec4f,
  survey: vec4f,          // level whose spacing is that of the finest elevation data
  far: vec4f,             // distance from what strokes fix, 0..1
  erosion: vec4f,         // -1..1
};

struct SynthState {
  d: vec4f,               // detail, metres
  h: vec4f,               // smoothness exponent
  snow: vec4f,
  wet: vec4f,
  grass: vec4f,
  forest: vec4f,
  foam: vec4f,
  finer: vec4f,           // not stored: the most that the next level's noise would add here, metres
};

// Share of the detail of a level that may be heard: none down to the spacing of the data, then all of it.
fn audible(level: f32, survey: vec4f) -> vec4f {
  return clamp(level - survey, vec4f(0.0), vec4f(1.0));
}

// What data make of all that levels below this one may add, as a share: their noise falls by 2^-exponent a level, and
// begins below the data.
fn hushed(level: f32, survey: vec4f, exponent: vec4f) -> vec4f {
  let silent = max(vec4f(0.0), survey - level);
  let whole = floor(silent);
  return exp2(-exponent * whole) * (1.0 - (silent - whole) * (1.0 - exp2(-exponent)));
}

// Words of the four streams, and the children's columns and rows, as the hash takes them.
struct SynthNoise {
  a: vec4u,
  b: vec4u,
  c: vec4u,
  d: vec4u,
  i: vec2i,
  j: vec2i,
};
