// Sun visibility with a soft penumbra and openness to the sky, per sample of a tile, by marching the heightfield.
// Distant steps read coarser levels: the march crosses tiles freely and costs the same everywhere. The value depends on
// the world position and the level only, so tiles agree on shared edges.
struct Job {
  slot: u32,
  level: u32,
  x: u32,
  y: u32,
};

struct SunList {
  size: f32,          // side of the domain, metres
  count: u32,
  high: f32,          // highest ground: above it every ray is free
  levels: u32,        // finest level of the page table
  sun: vec4f,         // unit vector to the sun; w = tangent of the penumbra's half angle
  jobs: array<Job, 1024>,
};

const NO_SLOT: u32 = 0xffffffffu;
const PLACES: u32 = 4096u;
// Fewer on software adapters (gpu/tilecompute.ts).
override SUN_STEPS: i32 = 60;
override SUN_GROWTH: f32 = 0.1;
override SKY_DIRECTIONS: i32 = 8;
override SKY_STEPS: i32 = 6;

@group(0) @binding(0) var<storage, read> list: SunList;
@group(0) @binding(1) var heights: texture_2d_array<f32>;
@group(0) @binding(2) var<storage, read> pages: array<vec2u, PLACES>;  // (tile key, slot) by hash (gpu/pagetable.ts)
@group(0) @binding(3) var light_out: texture_storage_2d_array<rgba8unorm, write>;

fn page(level: u32, tile: vec2u) -> u32 {
  let key = (level << 24u) | (tile.y << 12u) | tile.x;
  var place = (key * 0x9e3779b1u) >> 20u;
  var entry = pages[place];
  while (entry.x != key && entry.x != NO_SLOT) {
    place = (place + 1u) % PLACES;
    entry = pages[place];
  }
  return select(NO_SLOT, entry.y, entry.x == key);
}

struct Place {
  texel: vec2i,
  layer: i32,
  part: vec2f,
};

// Where a world position lies in the atlas: in `wanted` or the nearest coarser level that is there.
fn locate(at: vec2f, wanted: u32) -> Place {
  let p = clamp(at / list.size, vec2f(0.0), vec2f(0.999999));
  var level = wanted;
  var slot = page(level, vec2u(p * f32(1u << level)));
  while (slot == NO_SLOT && level > 0u) {
    level -= 1u;
    slot = page(level, vec2u(p * f32(1u << level)));
  }
  let in_tile = fract(p * f32(1u << level)) * f32(TILE_CELLS);
  let i = vec2i(in_tile);
  return Place(slot_origin(slot) + i, slot_layer(slot), in_tile - vec2f(i));
}

fn ground(at: vec2f, wanted: u32) -> f32 {
  let q = locate(at, wanted);
  let a = textureLoad(heights, q.texel, q.layer, 0).x;
  let b = textureLoad(heights, q.texel + vec2i(1, 0), q.layer, 0).x;
  let c = textureLoad(heights, q.texel + vec2i(0, 1), q.layer, 0).x;
  let d = textureLoad(heights, q.texel + vec2i(1, 1), q.layer, 0).x;
  return mix(mix(a, b, q.part.x), mix(c, d, q.part.x), q.part.y);
}

fn nearest_ground(at: vec2f, wanted: u32) -> f32 {
  let q = locate(at, wanted);
  return textureLoad(heights, q.texel + vec2i(q.part + 0.5), q.layer, 0).x;
}

// The level whose cells suit a step of this length.
fn level_for(step: f32, finest: u32) -> u32 {
  let level = floor(log2(list.size / (f32(TILE_CELLS) * step)) + 0.5);
  return u32(clamp(level, 0.0, f32(finest)));
}

fn inside(at: vec2f) -> bool {
  return all(at >= vec2f(0.0)) && all(at <= vec2f(list.size));
}

// 1: the whole disc is free; 0: all of it is hidden.
fn sun_visibility(origin_m: vec3f, cell: f32, level: u32) -> f32 {
  let flat = length(list.sun.xy);
  if (list.sun.z <= 0.0) { return 0.0; }
  if (flat < 1.0e-4) { return 1.0; }
  let dir = list.sun.xy / flat;
  let rise = list.sun.z / flat;
  var free = 1.0;
  var t = cell;
  for (var i = 0; i < SUN_STEPS; i += 1) {
    let at = origin_m.xy + dir * t;
    let z = origin_m.z + rise * t;
    if (z > list.high || !inside(at)) { break; }
    let step = max(cell, t * SUN_GROWTH);
    // How far the ray clears the ground, in half penumbras; never sharper than the samples can show.
    let gap = (z - ground(at, level_for(0.7 * step, level))) / (t * list.sun.w + 0.5 * cell * rise);
    free = min(free, 0.5 + 0.5 * gap);
    if (free <= 0.0) { return 0.0; }
    t += step;
  }
  return smoothstep(0.0, 1.0, clamp(free, 0.0, 1.0));
}

// Part of the sky, weighted by the cosine, that is above the horizon.
fn sky_visibility(origin_m: vec3f, cell: f32, level: u32) -> f32 {
  if (origin_m.z >= list.high) { return 1.0; }
  var open = 0.0;
  for (var k = 0; k < SKY_DIRECTIONS; k += 1) {
    let a = (f32(k) + 0.5) * 6.2831853 / f32(SKY_DIRECTIONS);
    let dir = vec2f(cos(a), sin(a));
    var horizon = 0.0;
    var t = cell * 1.5;
    for (var i = 0; i < SKY_STEPS; i += 1) {
      let at = origin_m.xy + dir * t;
      if (!inside(at)) { break; }
      horizon = max(horizon, (nearest_ground(at, level_for(t * 0.5, level)) - origin_m.z) / t);
      t *= 2.0;
    }
    // Cosine-weighted openness of a sector above elevation e is cos(e)^2 = 1 / (1 + tan(e)^2).
    open += 1.0 / (1.0 + horizon * horizon);
  }
  return open / f32(SKY_DIRECTIONS);
}

@compute @workgroup_size(8, 8, 1)
fn compute_sun(@builtin(global_invocation_id) id: vec3u) {
  let at = vec2i(id.xy) - 1;
  if (any(at > vec2i(TILE_SAMPLES)) || id.z >= list.count) { return; }
  let job = list.jobs[id.z];
  let cell = list.size / f32(u32(TILE_CELLS) << job.level);
  let world = vec2f(vec2i(i32(job.x), i32(job.y)) * TILE_CELLS + at) * cell;
  let origin = slot_origin(job.slot);
  let layer = slot_layer(job.slot);
  let start = vec3f(world, textureLoad(heights, origin + at, layer, 0).x + 0.02 * cell);
  let value = vec4f(sun_visibility(start, cell, job.level), sky_visibility(start, cell, job.level), 0.0, 1.0);
  textureStore(light_out, origin + at, layer, value);
}
