// Per 16-cell sub-patch of a tile: lowest and highest height, distance to the parent's surface as the morph draws it
// (ground/patch.wgsl, parent_height), and how far the surface of its children can be from its own. One workgroup a tile; four
// invocations a sub-patch, each every fourth row of its 17 x 17 samples.
struct BoundsJob {
  slot: u32,
  level: u32,
  x: u32,
  y: u32,
  parent: u32,
  pad0: u32,
  pad1: u32,
  pad2: u32,
};

struct BoundsList {
  size: f32,        // side of the domain, metres
  pad0: u32,
  pad1: u32,
  pad2: u32,
  jobs: array<BoundsJob>,
};

@group(0) @binding(0) var<storage, read> list: BoundsList;
@group(0) @binding(1) var heights: texture_2d_array<f32>;
@group(0) @binding(2) var attributes1: texture_2d_array<f32>;
@group(0) @binding(3) var<storage, read_write> bounds: array<vec4f>;  // (lowest, highest, error, finer), metres

const FINER_MARGIN: f32 = 1.15;
const ROWS_AT_ONCE: i32 = 4;
var<workgroup> parts: array<vec4f, 64>;

fn height_at(slot: u32, at: vec2i) -> f32 {
  return textureLoad(heights, slot_origin(slot) + at, slot_layer(slot), 0).x;
}

// How far the parent's surface is from a sample: the parent's own, or the middle of the edge or diagonal it lies on.
fn distance_to_parent(job: BoundsJob, at: vec2i, z: f32) -> f32 {
  let low = vec2i(vec2u(job.x & 1u, job.y & 1u)) * (TILE_CELLS / 2) + (at >> vec2u(1u));
  let odd = at & vec2i(1);
  let there = 0.5 * (height_at(job.parent, low + vec2i(odd.x, 0)) + height_at(job.parent, low + vec2i(0, odd.y)));
  return abs(z - there);
}

// How far the surface of children that nobody holds can be from this one's: what interpolation makes of the bend, and the
// next level's noise, which the synthesis left coded in the texel (finer_code). Curvature changes from sample to sample:
// the margin takes that in.
fn finer_at(job: BoundsJob, at: vec2i, z: f32, cell: f32) -> f32 {
  let x = height_at(job.slot, at - vec2i(1, 0)) + height_at(job.slot, at + vec2i(1, 0)) - 2.0 * z;
  let y = height_at(job.slot, at - vec2i(0, 1)) + height_at(job.slot, at + vec2i(0, 1)) - 2.0 * z;
  let code = textureLoad(attributes1, slot_origin(job.slot) + at, slot_layer(job.slot), 0).w;
  let noise = select(cell * exp2(16.0 * (code + 0.5 / 255.0) - 12.0), 0.0, code == 0.0);
  return FINER_MARGIN * ((abs(x) + abs(y)) * 0.125 + noise);
}

@compute @workgroup_size(64)
fn compute_bounds(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
  let job = list.jobs[group.x];
  let cell = list.size / f32(u32(TILE_CELLS) << job.level);
  let sub = i32(lane) / ROWS_AT_ONCE;
  let first = vec2i(sub % SUBPATCHES, sub / SUBPATCHES) * PATCH_CELLS;
  var low = 3.0e38;
  var high = -3.0e38;
  var error = 0.0;
  var finer = 0.0;
  for (var row = i32(lane) % ROWS_AT_ONCE; row <= PATCH_CELLS; row += ROWS_AT_ONCE) {
    for (var col = 0; col <= PATCH_CELLS; col += 1) {
      let at = first + vec2i(col, row);
      let z = height_at(job.slot, at);
      low = min(low, z);
      high = max(high, z);
      if (job.level > 0u) { error = max(error, distance_to_parent(job, at, z)); }
      finer = max(finer, finer_at(job, at, z, cell));
    }
  }
  parts[lane] = vec4f(low, high, error, finer);
  workgroupBarrier();
  if (lane < u32(SUBPATCHES * SUBPATCHES)) {
    var all = parts[4u * lane];
    for (var k = 1u; k < 4u; k += 1u) {
      let part = parts[4u * lane + k];
      all = vec4f(min(all.x, part.x), max(all.y, part.y), max(all.zw, part.zw));
    }
    bounds[u32(SUBPATCHES * SUBPATCHES) * group.x + lane] = all;
  }
}
