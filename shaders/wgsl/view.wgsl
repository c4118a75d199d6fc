// Everything that all passes of one frame share. The host reads the layout of `View` from this text (gpu/layout.ts).
struct View {
  eye_proj: mat4x4f,     // from places relative to the eye to clip space; depth 1 at the near plane, 0 at the far one
  eye: vec4f,            // xyz; w = 1 for an orthographic camera
  eye_low: vec4f,        // xyz: what float32 leaves of the eye
  eye_cell: vec2f,       // the eye on the lattice of the finest level, whole cells,
  eye_part: vec2f,       // and the metres beyond
  right: vec4f,          // camera axes; w of right, up: tangent of half the field of view, horizontally and vertically
  up: vec4f,
  forward: vec4f,        // w: metres per pixel at distance 1 (orthographic: metres per pixel)
  sun: vec4f,            // unit vector to the sun; w = sine of its elevation
  viewport: vec2f,       // pixels that are drawn
  guard: vec2f,          // what part of the viewport in which patches are drawn they are (gpu/passes/guard.ts)
  time: f32,
  size: f32,             // side of the domain, metres
  base: f32,             // height of the plane on which the block stands, metres
  sea: f32,              // sea level, metres; without a sea, where elevations count from
  has_sea: f32,          // 1 or 0
  has_lakes: f32,        // 1 or 0
  has_rivers: f32,       // 1 or 0
  exposure: f32,
  haze: f32,             // extinction per metre at the ground
  low: f32,              // lowest and highest ground, metres
  high: f32,
  grid: f32,             // strength of the scale grid, 0..1
  contour: f32,          // contour interval, metres
  contour_strength: f32,
  line_scale: f32,       // contours are this many times as wide
  exaggeration: f32,     // heights are seen so many times larger than they are; places here are true
  finest_cell: f32,      // metres between samples of level MAX_SYNTHESIS_LEVEL
  amplitude: f32,        // metres of noise amplitude that the value 1 of `channels` stands for
  relief: f32,           // metres of elevation that count as 1, for stone and plants
  shore: f32,            // and for the sea's shores
  shade: f32,            // how far hollows and joints go dark, 0..1
  look: u32,
  overlay: u32,
  cursor_count: u32,
  cursors: array<vec4f, 64>,  // pairs: (x, y, radius in metres, line width in metres), (rgb, opacity)
};

const LOOK_NATURAL: u32 = 0u;
const LOOK_ALPINE: u32 = 1u;
const LOOK_DESERT: u32 = 2u;
const LOOK_PAPER: u32 = 3u;

const OVERLAY_NONE: u32 = 0u;
const OVERLAY_CONTOURS: u32 = 1u;
const OVERLAY_SLOPE: u32 = 2u;
const OVERLAY_PATCHES: u32 = 3u;
const OVERLAY_DETAIL: u32 = 4u;
const OVERLAY_INFLUENCE: u32 = 5u;
const OVERLAY_PAINTED: u32 = 6u;
const OVERLAY_WATERSHED: u32 = 7u;
const OVERLAY_DIFFERENCE: u32 = 8u;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var heights: texture_2d_array<f32>;
@group(0) @binding(2) var slopes: texture_2d_array<f32>;
@group(0) @binding(3) var light: texture_2d_array<f32>;
@group(0) @binding(4) var sky_lut: texture_2d<f32>;
@group(0) @binding(5) var<uniform> skylight: array<vec4f, 8>;  // sky/tables.wgsl, bake_ambient
@group(0) @binding(6) var noise: texture_2d<f32>;
@group(0) @binding(7) var smooth_clamp: sampler;
@group(0) @binding(8) var smooth_repeat: sampler;
@group(0) @binding(9) var channels: texture_2d<f32>;  // over the domain, 0..1: amplitude, roughness, reach of a stroke
@group(0) @binding(10) var attributes0: texture_2d_array<f32>;  // synthesised: snow, wet, foam, smoothness / 2
@group(0) @binding(11) var attributes1: texture_2d_array<f32>;  // grass, forest, grain, size of the next level's detail
@group(0) @binding(12) var stones: texture_2d<f32>;  // stones_rich.wgsl
@group(0) @binding(13) var lake_map: texture_2d<f32>;  // over the domain, metres: ground and level of a sample (water/lakes.wgsl)
@group(0) @binding(14) var river_map: texture_2d<f32>;  // water/rivers.wgsl

// Clip position of a point given relative to the eye.
fn clip_of(relative: vec3f) -> vec4f {
  return view.eye_proj * vec4f(relative, 1.0);
}

// Clip position for the viewport in which patches are drawn, of one for that of the picture.
fn guarded(clip: vec4f) -> vec4f {
  return vec4f(clip.xy * view.guard, clip.zw);
}

fn to_clip(p: vec3f) -> vec4f {
  return clip_of((p - view.eye.xyz) - view.eye_low.xyz);
}

// Vector from the eye to a point; for an orthographic camera all rays are parallel.
fn ray_to(p: vec3f) -> vec3f {
  return select(normalize(p - view.eye.xyz), view.forward.xyz, view.eye.w > 0.5);
}

// Ray through a pixel, not normalised. `ndc` from -1 to 1.
fn ray_through(ndc: vec2f) -> vec3f {
  let d = view.forward.xyz + ndc.x * view.right.w * view.right.xyz + ndc.y * view.up.w * view.up.xyz;
  return select(normalize(d), view.forward.xyz, view.eye.w > 0.5);
}

// Metres from the eye to a point in the world as it is seen.
fn seen_distance(p: vec3f) -> f32 {
  let d = p - view.eye.xyz;
  return length(vec3f(d.xy, d.z * view.exaggeration));
}

// Metres that one pixel covers at a point.
fn pixel_size(p: vec3f) -> f32 {
  return select(seen_distance(p), 1.0, view.eye.w > 0.5) * view.forward.w;
}
