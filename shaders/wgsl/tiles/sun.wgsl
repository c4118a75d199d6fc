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
  pad: u32,
  sun: vec4f,         // unit vector to the sun; w = tangent of the penumbra's half angle
  jobs: array<Job, 1024>,
};

// Fewer on software adapters (gpu/atlas/tilecompute.ts).
override SUN_STEPS: i32 = 60;
override SUN_GROWTH: f32 = 0.1;
override SKY_DIRECTIONS: i32 = 8;
override SKY_STEPS: i32 = 6;

@group(0) @binding(0) var<storage, read> list: SunList;
@group(0) @binding(1) var heights: texture_2d_array<f32>;
@group(0) @binding(2) var<storage, read> pages: array<vec2u, PLACES>;  // by hash, see gpu/atlas/pagetable.ts
@group(0) @binding(3) var light_out: texture_storage_2d_array<rgba8unorm, write>;

// Where a march begins: a sample on the lattice of its level. Places are told by whole samples and metres from there:
// a share of the domain in float32 could not tell the cells of fine levels apart.
struct Start {
  sample: vec2i,
  level: u32,
  cell: f32,     // metres
  z: f32,
};

struct Place {
  slot: u32,
  cell: vec2i,   // of the tile
  part: vec2f,
};

// Where the place `offset` metres from the start lies on a level, at most the start's; outside the domain its border.
fn place_on(start: Start, offset: vec2f, level: u32) -> Place {
  let shift = start.level - level;
  let below = start.sample & vec2i((1 << shift) - 1);
  let at = (vec2f(below) + offset / start.cell) / f32(1u << shift);
  let whole = floor(at);
  let cell = (start.sample >> vec2u(shift)) + vec2i(whole);
  let kept = clamp(cell, vec2i(0), vec2i((TILE_CELLS << level) - 1));
  let part = select(at - whole, select(vec2f(1.0), vec2f(0.0), cell < kept), cell != kept);
  return Place(page(level, vec2u(kept / TILE_CELLS)), kept % TILE_CELLS, part);
}

// Returns the place in the atlas: on `wanted` or the nearest coarser level that is there.
fn locate(start: Start, offset: vec2f, wanted: u32) -> Place {
  var level = wanted;
  var found = place_on(start, offset, level);
  while (found.slot == NO_SLOT && level > 0u) {
    level -= 1u;
    found = place_on(start, offset, level);
  }
  return found;
}

fn ground(start: Start, offset: vec2f, wanted: u32) -> f32 {
  let q = locate(start, offset, wanted);
  let texel = slot_origin(q.slot) + q.cell;
  let layer = slot_layer(q.slot);
  let a = textureLoad(heights, texel, layer, 0).x;
  let b = textureLoad(heights, texel + vec2i(1, 0), layer, 0).x;
  let c = textureLoad(heights, texel + vec2i(0, 1), layer, 0).x;
  let d = textureLoad(heights, texel + vec2i(1, 1), layer, 0).x;
  return mix(mix(a, b, q.part.x), mix(c, d, q.part.x), q.part.y);
}

fn nearest_ground(start: Start, offset: vec2f, wanted: u32) -> f32 {
  let q = locate(start, offset, wanted);
  return textureLoad(heights, slot_origin(q.slot) + q.cell + vec2i(q.part + 0.5), slot_layer(q.slot), 0).x;
}

// The level whose cells suit a step of this length.
fn level_for(step: f32, finest: u32) -> u32 {
  let level = floor(log2(list.size / (f32(TILE_CELLS) * step)) + 0.5);
  return u32(clamp(level, 0.0, f32(finest)));
}

fn inside(start: Start, offset: vec2f) -> bool {
  let at = vec2f(start.sample) * start.cell + offset;
  return all(at >= vec2f(0.0)) && all(at <= vec2f(list.size));
}

// 1: the whole disc is free; 0: all of it is hidden.
fn sun_visibility(start: Start) -> f32 {
  let flat = length(list.sun.xy);
  if (list.sun.z <= 0.0) { return 0.0; }
  if (flat < 1.0e-4) { return 1.0; }
  let dir = list.sun.xy / flat;
  let rise = list.sun.z / flat;
  var free = 1.0;
  var t = start.cell;
  for (var i = 0; i < SUN_STEPS; i += 1) {
    let offset = dir * t;
    let z = start.z + rise * t;
    if (z > list.high || !inside(start, offset)) { break; }
    let step = max(start.cell, t * SUN_GROWTH);
    // How far the ray clears the ground, in half penumbras; never sharper than the samples can show.
    let over = z - ground(start, offset, level_for(0.7 * step, start.level));
    free = min(free, 0.5 + 0.5 * over / (t * list.sun.w + 0.5 * start.cell * rise));
    if (free <= 0.0) { return 0.0; }
    t += step;
  }
  return smoothstep(0.0, 1.0, clamp(free, 0.0, 1.0));
}

// Part of the sky, weighted by the cosine, that is above the horizon.
fn sky_visibility(start: Start) -> f32 {
  if (start.z >= list.high) { return 1.0; }
  var open = 0.0;
  for (var k = 0; k < SKY_DIRECTIONS; k += 1) {
    let a = (f32(k) + 0.5) * 6.2831853 / f32(SKY_DIRECTIONS);
    let dir = vec2f(cos(a), sin(a));
    var horizon = 0.0;
    var t = start.cell * 1.5;
    for (var i = 0; i < SKY_STEPS; i += 1) {
      let offset = dir * t;
      if (!inside(start, offset)) { break; }
      horizon = max(horizon, (nearest_ground(start, offset, level_for(t * 0.5, start.level)) - start.z) / t);
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
  let origin = slot_origin(job.slot);
  let layer = slot_layer(job.slot);
  let cell = list.size / f32(u32(TILE_CELLS) << job.level);
  let sample = vec2i(i32(job.x), i32(job.y)) * TILE_CELLS + at;
  let start = Start(sample, job.level, cell, textureLoad(heights, origin + at, layer, 0).x + 0.02 * cell);
  textureStore(light_out, origin + at, layer, vec4f(sun_visibility(start), sky_visibility(start), 0.0, 1.0));
}
