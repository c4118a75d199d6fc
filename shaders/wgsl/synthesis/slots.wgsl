// The samples of atlas slots in buffers, and which of them are held (docs/renderer.md, "Synthesis").
struct SynthJob {
  slot: u32,
  level: u32,
  x: u32,
  y: u32,
  parent: u32,    // slot; not read on level 0
  held: u32,      // bit (dy + 1) * 3 + dx + 1: samples of the tile at (x + dx, y + dy) are in `grounds`
  pad0: u32,
  pad1: u32,
};

@group(0) @binding(0) var<uniform> site: SynthSite;
@group(0) @binding(1) var<storage, read> jobs: array<SynthJob>;
@group(0) @binding(2) var<storage, read_write> grounds: array<vec2f>;  // (guide, base), metres
@group(0) @binding(3) var<storage, read_write> states: array<vec4u>;   // docs/synthesis.md, "State"
@group(0) @binding(4) var<storage, read> channels: array<vec2f>;       // see channel_value in synthesis/synthesise.wgsl
@group(0) @binding(5) var heights_out: texture_storage_2d_array<r32float, write>;
@group(0) @binding(6) var attributes0_out: texture_storage_2d_array<rgba8unorm, write>;
@group(0) @binding(7) var attributes1_out: texture_storage_2d_array<rgba8unorm, write>;

const SLOT_AREA: u32 = u32(SLOT_TEXELS * SLOT_TEXELS);
const LAST_SAMPLE: i32 = TILE_CELLS + SLOT_BORDER;   // a slot holds samples -SLOT_BORDER .. LAST_SAMPLE of its tile
const CELLS_ACROSS: u32 = u32(TILE_CELLS / 2 + 3);   // parents' cells, -1 .. TILE_CELLS / 2 + 1, that make a slot

fn slot_texel(slot: u32, at: vec2i) -> u32 {
  return slot * SLOT_AREA + u32((at.y + SLOT_BORDER) * SLOT_TEXELS + at.x + SLOT_BORDER);
}

// Which of the tiles west, here and east (bits 0, 1, 2) have sample i of the tile's row.
fn owners(i: i32) -> u32 {
  if (i <= 0) { return select(3u, 1u, i < 0); }
  if (i >= TILE_CELLS) { return select(6u, 4u, i > TILE_CELLS); }
  return 2u;
}

// The nearest sample inside of the domain.
fn inside(job: SynthJob, at: vec2i) -> vec2i {
  if (site.cyclic == 1u) { return at; }
  let last = (1u << job.level) - 1u;
  let low = select(vec2i(-SLOT_BORDER), vec2i(0), vec2u(job.x, job.y) == vec2u(0u));
  let high = select(vec2i(LAST_SAMPLE), vec2i(TILE_CELLS), vec2u(job.x, job.y) == vec2u(last));
  return clamp(at, low, high);
}

fn is_held(job: SynthJob, at: vec2i) -> bool {
  let across = owners(at.x);
  let upward = owners(at.y);
  var bits = 0u;
  if ((upward & 1u) != 0u) { bits |= across; }
  if ((upward & 2u) != 0u) { bits |= across << 3u; }
  if ((upward & 4u) != 0u) { bits |= across << 6u; }
  return (job.held & bits) != 0u;
}

// Held samples; beyond the domain the ground goes on point-symmetrically, along x, then along y.
fn held_row(job: SynthJob, x: i32, edge: i32, y: i32) -> vec2f {
  let there = grounds[slot_texel(job.slot, vec2i(edge, y))];
  if (x == edge) { return there; }
  return 2.0 * there - grounds[slot_texel(job.slot, vec2i(2 * edge - x, y))];
}

fn held_ground(job: SynthJob, at: vec2i) -> vec2f {
  let edge = inside(job, at);
  let there = held_row(job, at.x, edge.x, edge.y);
  if (at.y == edge.y) { return there; }
  return 2.0 * there - held_row(job, at.x, edge.x, 2 * edge.y - at.y);
}

// What a sample's ground is: as held, else as interpolated. Writes it for the children.
fn settle_ground(job: SynthJob, at: vec2i, interpolated: vec2f) -> vec2f {
  var ground = interpolated;
  if (job.held != 0u) {
    let edge = inside(job, at);
    if (is_held(job, edge)) {
      let held = held_ground(job, at);
      let sent = job.level <= site.solved;
      ground = vec2f(select(interpolated.x, held.x, sent), held.y);
      // What the atlas wrote stays untouched: others read it.
      if (sent && all(edge == at)) { return ground; }
    }
  }
  grounds[slot_texel(job.slot, at)] = ground;
  return ground;
}
