// Patches that the ground in front of them hides, in two rounds (gpu/passes/hidden.ts): first those that showed in the last picture
// are drawn, then the depth that they leave is reduced to a pyramid, and of the others those are drawn whose box may stand
// before it. Depth is reversed, 1 near and 0 far: a texel of the pyramid is the least, farthest depth under it.

const BASE_PIXELS: u32 = 4u;   // pixels along a side of a texel of the finest level
const MAX_LEVELS: u32 = 12u;
const WIDEST: u32 = 4u;        // texels that a box may cover along one side before a coarser level is read
const FACT_WORDS: u32 = 3u;    // of a patch: lowest and highest ground that it can have, metres; node of the patch tree
const UNKNOWN: u32 = 0u;
const HIDDEN: u32 = 1u;
const SEEN: u32 = 2u;

struct Turn {
  count: u32,       // patches of the cut
  first: u32,       // of patches never tested before, so many are in the first round: the nearest
  words: u32,       // words of a list of bits
  levels: u32,      // of the pyramid
  size: vec2u,      // pixels that are drawn
  room: u32,        // records for which `drawn` has room in each round
  pad: u32,
  pyramid: array<vec4u, MAX_LEVELS>,  // offset, width, height
};

// x: which round's list is packed, or which level of the pyramid is made.
struct Part { x: u32 };

@group(1) @binding(0) var<uniform> turn: Turn;
@group(1) @binding(1) var<storage, read> records: array<vec4u>;
@group(1) @binding(2) var<storage, read> facts: array<u32>;
@group(1) @binding(3) var<storage, read_write> known: array<u32>;  // of every node: UNKNOWN, HIDDEN or SEEN
@group(1) @binding(4) var<storage, read_write> bits: array<atomic<u32>>;  // patches of the first round, then of the second
@group(1) @binding(5) var<storage, read_write> pyramid: array<f32>;
@group(1) @binding(6) var<storage, read_write> drawn: array<vec4u>;
@group(1) @binding(7) var<storage, read_write> draws: array<u32>;  // of two indexed indirect draws
@group(1) @binding(8) var<uniform> part: Part;

fn mark(list: u32, index: u32) {
  atomicOr(&bits[list * turn.words + index / 32u], 1u << (index % 32u));
}

fn marked(list: u32, index: u32) -> bool {
  return (atomicLoad(&bits[list * turn.words + index / 32u]) & (1u << (index % 32u))) != 0u;
}

@compute @workgroup_size(64)
fn choose_first(@builtin(global_invocation_id) id: vec3u) {
  if (id.x >= turn.count) { return; }
  let state = known[facts[id.x * FACT_WORDS + 2u]];
  if (state == SEEN || (state == UNKNOWN && id.x < turn.first)) { mark(0u, id.x); }
}

// Records of a list in the order of the cut, which goes from front to back: a patch's place is the number of those before it.
@compute @workgroup_size(64)
fn pack(@builtin(global_invocation_id) id: vec3u) {
  let i = id.x;
  if (i >= turn.count) { return; }
  let list = part.x * turn.words;
  let mine = i / 32u;
  var place = 0u;
  for (var word = 0u; word < mine; word += 1u) { place += countOneBits(atomicLoad(&bits[list + word])); }
  let word = atomicLoad(&bits[list + mine]);
  let bit = 1u << (i % 32u);
  place += countOneBits(word & (bit - 1u));
  let there = (word & bit) != 0u;
  if (there) { drawn[part.x * turn.room + place] = records[i]; }
  if (i + 1u == turn.count) { draws[part.x * 5u + 1u] = place + select(0u, 1u, there); }
}

// A level of the pyramid from the finer one.
@compute @workgroup_size(8, 8)
fn reduce(@builtin(global_invocation_id) id: vec3u) {
  let to = turn.pyramid[part.x];
  if (any(id.xy >= to.yz)) { return; }
  let src = turn.pyramid[part.x - 1u];
  let low = id.xy * 2u;
  let high = min(low + 1u, src.yz - 1u);
  let a = min(pyramid[src.x + low.y * src.y + low.x], pyramid[src.x + low.y * src.y + high.x]);
  let b = min(pyramid[src.x + high.y * src.y + low.x], pyramid[src.x + high.y * src.y + high.x]);
  pyramid[to.x + id.y * to.y + id.x] = min(a, b);
}

// True when no sample of a box can stand before what the pyramid holds.
fn box_hidden(record: vec4u, low: f32, high: f32) -> bool {
  let corner = patch_corner(record);
  let shift = vec2u(u32(MAX_SYNTHESIS_LEVEL) - patch_level(record));
  let south_west = (vec2f(corner << shift) - view.eye_cell) * view.finest_cell - view.eye_part;
  let north_east = (vec2f((corner + PATCH_CELLS) << shift) - view.eye_cell) * view.finest_cell - view.eye_part;
  // Bounds are rounded to float32, as heights are.
  let grain = 1e-4 + 1e-6 * max(abs(low), abs(high));
  let bottom = (low - grain - view.eye.z) - view.eye_low.z;
  let top = (high + grain - view.eye.z) - view.eye_low.z;
  var least = vec2f(1e9);
  var most = vec2f(-1e9);
  var nearest = 0.0;
  for (var k = 0u; k < 8u; k += 1u) {
    let x = select(south_west.x, north_east.x, (k & 1u) != 0u);
    let y = select(south_west.y, north_east.y, (k & 2u) != 0u);
    let at = clip_of(vec3f(x, y, select(bottom, top, (k & 4u) != 0u)));
    // A box that reaches the eye or the near plane says nothing.
    if (at.w <= 0.0 || at.z >= at.w) { return false; }
    let place = vec2f(0.5 + 0.5 * at.x / at.w, 0.5 - 0.5 * at.y / at.w) * vec2f(turn.size);
    least = min(least, place);
    most = max(most, place);
    nearest = max(nearest, at.z / at.w);
  }
  // A pixel and a grain of depth more: rounding here is not that of the rasteriser.
  nearest *= 1.00001;
  let start = vec2i(clamp(floor(least) - 1.0, vec2f(-1.0), vec2f(1e6)));
  let end = vec2i(clamp(floor(most) + 1.0, vec2f(-1.0), vec2f(1e6)));
  let last = vec2i(turn.size) - 1;
  if (any(end < vec2i(0)) || any(start > last)) { return true; }
  var a = vec2u(max(start, vec2i(0))) / BASE_PIXELS;
  var b = vec2u(min(end, last)) / BASE_PIXELS;
  var level = 0u;
  while (level + 1u < turn.levels && any(b - a >= vec2u(WIDEST))) {
    a /= 2u;
    b /= 2u;
    level += 1u;
  }
  let src = turn.pyramid[level];
  for (var y = a.y; y <= b.y; y += 1u) {
    for (var x = a.x; x <= b.x; x += 1u) {
      if (pyramid[src.x + y * src.y + x] < nearest) { return false; }
    }
  }
  return true;
}

@compute @workgroup_size(64)
fn test_boxes(@builtin(global_invocation_id) id: vec3u) {
  let i = id.x;
  if (i >= turn.count) { return; }
  let fact = i * FACT_WORDS;
  let is_hidden = box_hidden(records[i], bitcast<f32>(facts[fact]), bitcast<f32>(facts[fact + 1u]));
  if (!is_hidden && !marked(0u, i)) { mark(1u, i); }
  known[facts[fact + 2u]] = select(SEEN, HIDDEN, is_hidden);
}
