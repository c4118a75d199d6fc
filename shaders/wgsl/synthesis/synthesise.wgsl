// Makes the slots of tiles from those of their parents (DESIGN 10; paper 1, section 3): ground, detail and attributes, with
// a border that reproduces itself. One invocation makes the four children of one cell of the parent; a dispatch makes
// many tiles of one level. `compose` makes only ground and heights, where detail has not changed.

// A row of the parents p - 1 .. p + 2 of a cell.
struct GroundRow {
  guide: vec4f,
  base: vec4f,
};

struct StateRow {
  d: vec4f,
  hs: vec4f,    // h, snow at the even and odd child: see bspline_words_x
  wg: vec4f,    // wet, grass
  ff: vec4f,    // forest, foam
};

struct Cell {
  job: SynthJob,
  child: vec2i,   // its south-west child in the tile
  first: u32,     // texel of parent (p - 1, q - 1)
  far: vec2u,     // columns and rows from there to p + 2: fewer where no child needs it
};

fn cell_of(group: vec3u, lane: u32) -> Cell {
  let job = jobs[group.y];
  let k = group.x * 64u + lane;
  let p = vec2i(i32(k % CELLS_ACROSS), i32(k / CELLS_ACROSS)) - 1;
  let corner = p - 1 + vec2i(vec2u(job.x & 1u, job.y & 1u)) * (TILE_CELLS / 2);
  return Cell(job, 2 * p, slot_texel(job.parent, corner), vec2u(min(vec2i(3), LAST_SAMPLE - corner)));
}

fn ground_row(cell: Cell, row: u32) -> GroundRow {
  let at = cell.first + row * u32(SLOT_TEXELS);
  let a = grounds[at];
  let b = grounds[at + 1u];
  let c = grounds[at + 2u];
  let d = grounds[at + cell.far.x];
  return GroundRow(vec4f(a.x, b.x, c.x, d.x), vec4f(a.y, b.y, c.y, d.y));
}

fn state_row(cell: Cell, row: u32) -> StateRow {
  let at = cell.first + row * u32(SLOT_TEXELS);
  let a = states[at];
  let b = states[at + 1u];
  let c = states[at + 2u];
  return StateRow(
    bitcast<vec4f>(vec4u(a.x, b.x, c.x, states[at + cell.far.x].x)),
    bspline_words_x(a.y, b.y, c.y), bspline_words_x(a.z, b.z, c.z), bspline_words_x(a.w, b.w, c.w));
}

// The child's guide and base where nobody holds it.
struct Grounds {
  guide: vec4f,
  base: vec4f,
};

fn interpolated(a: GroundRow, b: GroundRow, c: GroundRow, d: GroundRow) -> Grounds {
  let guide = four_point_y(four_point_x(a.guide), four_point_x(b.guide), four_point_x(c.guide), four_point_x(d.guide));
  if (BSPLINE_BASE) {
    return Grounds(guide, bspline_y(bspline_x(a.base), bspline_x(b.base), bspline_x(c.base)));
  }
  let base = four_point_y(four_point_x(a.base), four_point_x(b.base), four_point_x(c.base), four_point_x(d.base));
  return Grounds(guide, base);
}

fn concavity(second: vec4f) -> vec4f {
  return clamp(SYNTH_CONCAVITY_SCALE * second, vec4f(-1.0), vec4f(1.0));
}

// The ground with its detail at the children.
fn ground_of(a: GroundRow, b: GroundRow, c: GroundRow, za: vec4f, zb: vec4f, zc: vec4f, zd: vec4f, per_m: f32) -> Ground {
  let ba = bspline_x(za);
  let bb = bspline_x(zb);
  let bc = bspline_x(zc);
  let bd = bspline_x(zd);
  let second = bspline_y(second_x(za), second_x(zb), second_x(zc)) + second_y(ba, bb, bc, bd);
  let guide_x = bspline_y(derivative_x(a.guide), derivative_x(b.guide), derivative_x(c.guide)) * per_m;
  let guide_y = derivative_y(bspline_x(a.guide), bspline_x(b.guide), bspline_x(c.guide)) * per_m;
  return Ground(
    bspline_y(ba, bb, bc),
    bspline_y(derivative_x(za), derivative_x(zb), derivative_x(zc)) * per_m,
    derivative_y(ba, bb, bc) * per_m,
    concavity(second * per_m),
    sqrt(guide_x * guide_x + guide_y * guide_y));
}

// Global sample indices of the children's columns, or rows, as hash and channels take them.
fn global_pair(tile: u32, child: i32, level: u32) -> vec2i {
  let i = i32(tile) * TILE_CELLS + child + vec2i(0, 1);
  return select(i, i & vec2i((TILE_CELLS << level) - 1), site.cyclic == 1u);
}

fn noise_of(level: u32, i: vec2i, j: vec2i) -> SynthNoise {
  let keys = site.levels[level].keys;
  let u = bitcast<vec2u>(i);
  let v = bitcast<vec2u>(j);
  return SynthNoise(
    synth_words(keys.x, u, v), synth_words(keys.y, u, v), synth_words(keys.z, u, v), synth_words(keys.w, u, v), i, j);
}

// Along one axis: the two nodes of the channels' grid from which two neighbouring samples take their values, and where
// each lies between them. Exact, as both grids have powers of two cells: on levels coarser than the grid each sample is a
// node, on finer ones both lie in one cell.
struct ChannelPlace {
  low: u32,
  high: u32,
  part: vec2f,
};

fn channel_place(level: u32, index: vec2i) -> ChannelPlace {
  let bits = u32(firstLeadingBit(TILE_CELLS)) + level;
  let i = vec2u(clamp(index, vec2i(0), vec2i(1 << bits)));
  if (bits <= site.channel_bits) {
    let node = i << vec2u(site.channel_bits - bits);
    return ChannelPlace(node.x, node.y, vec2f(0.0, 1.0));
  }
  let shift = bits - site.channel_bits;
  let low = min(i.x >> shift, (1u << site.channel_bits) - 1u);
  return ChannelPlace(low, low + 1u, vec2f(i - (low << shift)) / f32(1u << shift));
}

// Channels of a node: (amplitude, roughness), (snow, grass), (forest, wetness), and with data or gullies (survey, far),
// (erosion, nothing).
fn channel_value(row: u32, col: u32, which: u32) -> vec2f {
  return channels[site.stride * (row * ((1u << site.channel_bits) + 1u) + col) + which];
}

fn along(a: f32, b: f32, part: vec2f) -> vec2f {
  return a * (1.0 - part) + b * part;
}

fn bilinear(south: vec2f, north: vec2f, part: vec2f) -> vec4f {
  return vec4f(south * (1.0 - part.x) + north * part.x, south * (1.0 - part.y) + north * part.y);
}

fn channel_pair(x: ChannelPlace, y: ChannelPlace, which: u32) -> ChannelPair {
  let a = channel_value(y.low, x.low, which);
  let b = channel_value(y.low, x.high, which);
  let c = channel_value(y.high, x.low, which);
  let d = channel_value(y.high, x.high, which);
  return ChannelPair(
    bilinear(along(a.x, b.x, x.part), along(c.x, d.x, x.part), y.part),
    bilinear(along(a.y, b.y, x.part), along(c.y, d.y, x.part), y.part));
}

fn asked_of(level: u32, i: vec2i, j: vec2i) -> Asked {
  var out: Asked;
  out.far = vec4f(BASE_FAR);   // where nodes of the channels are narrow, no stroke fixes anything
  if (site.varied == 0u) {
    out.amplitude = vec4f(channels[0].x);
    out.roughness = vec4f(channels[0].y);
    if (site.surveyed == 1u) { out.survey = vec4f(channels[3].x); }
    if (site.stride > 3u) {
      out.far = vec4f(channels[3].y);
      out.erosion = vec4f(channels[4].x);
    }
    return out;
  }
  let x = channel_place(level, i);
  let y = channel_place(level, j);
  let size = channel_pair(x, y, 0u);
  out.amplitude = size.low;
  out.roughness = size.high;
  if (site.biased == 1u) {
    let low = channel_pair(x, y, 1u);
    let plants = channel_pair(x, y, 2u);
    out.snow = low.low;
    out.grass = low.high;
    out.forest = plants.low;
    out.wetness = plants.high;
  }
  if (site.stride > 3u) {
    let places = channel_pair(x, y, 3u);
    out.survey = places.low;
    out.far = places.high;
    if (site.eroded == 1u) { out.erosion = channel_pair(x, y, 4u).low; }
  }
  return out;
}

fn unorm16(x: vec4f) -> vec4u {
  return vec4u(floor(0.5 + 65535.0 * unit(x)));
}

fn packed(low: vec4f, high: vec4f) -> vec4u {
  return unorm16(low) | (unorm16(high) << vec4u(16u));
}

// Size of what finer levels add, for attributes: doublings of 2^-12 cells, sixteen of them (tiles/bounds.wgsl undoes it).
fn finer_code(finer: vec4f, cell: f32) -> vec4f {
  return unit((log2(max(finer / cell, vec4f(1.0e-9))) + 12.0) / 16.0);
}

fn put_child(job: SynthJob, at: vec2i, ground: vec2f, words: vec4u, attributes0: vec4f, attributes1: vec4f) {
  if (any(at > vec2i(LAST_SAMPLE))) { return; }
  let settled = settle_ground(job, at, ground);
  states[slot_texel(job.slot, at)] = words;
  let texel = slot_origin(job.slot) + at;
  let layer = slot_layer(job.slot);
  textureStore(heights_out, texel, layer, vec4f(settled.y + bitcast<f32>(words.x), 0.0, 0.0, 0.0));
  textureStore(attributes0_out, texel, layer, attributes0);
  textureStore(attributes1_out, texel, layer, attributes1);
}

fn put_children(job: SynthJob, at: vec2i, ground: Grounds, s: SynthState, noise: SynthNoise) {
  let d = bitcast<vec4u>(s.d);
  let hs = packed(0.5 * s.h, s.snow);
  let wg = packed(s.wet, s.grass);
  let ff = packed(s.forest, s.foam);
  let grain = 0.5 + 0.5 * noise_full(noise.a);
  let finer = finer_code(s.finer, site.size / f32(u32(TILE_CELLS) << job.level));
  let guide = ground.guide;
  let base = ground.base;
  // A loop, not four calls: compilers put each call's code in place, and on the CPU that took seconds.
  for (var k = 0u; k < 4u; k += 1u) {
    put_child(job, at + vec2i(vec2u(k & 1u, k >> 1u)), vec2f(guide[k], base[k]), vec4u(d[k], hs[k], wg[k], ff[k]),
      vec4f(s.snow[k], s.wet[k], s.foam[k], 0.5 * s.h[k]), vec4f(s.grass[k], s.forest[k], grain[k], finer[k]));
  }
}

// Guide of level 0 beside a sample: in a bounded domain indices end at the border.
fn root_guide(job: SynthJob, at: vec2i) -> f32 {
  if (site.cyclic == 1u) { return grounds[slot_texel(job.slot, at & vec2i(TILE_CELLS - 1))].x; }
  return held_ground(job, clamp(at, vec2i(-SLOT_BORDER), vec2i(LAST_SAMPLE))).x;
}

// What a rule starts from at the children of a cell. Level 0 has no parent: nothing is `before` it.
struct Start {
  ground: Ground,
  before: SynthState,
  grounds: Grounds,
};

// Level 0: the rule on the guide itself.
fn root_start(job: SynthJob, at: vec2i) -> Start {
  var rows: array<vec4f, 4>;
  for (var row = 0; row < 4; row += 1) {
    for (var col = 0; col < 4; col += 1) { rows[row][col] = root_guide(job, at + vec2i(col, row) - 1); }
  }
  let a = rows[0];
  let b = rows[1];
  let c = rows[2];
  let d = rows[3];
  let per_m = site.levels[0].inverse_spacing;
  let z = vec4f(b.yz, c.yz);
  let west = vec4f(b.xy, c.xy);
  let east = vec4f(b.zw, c.zw);
  let south = vec4f(a.yz, b.yz);
  let north = vec4f(c.yz, d.yz);
  let slope_x = (east - west) * (0.5 * per_m);
  let slope_y = (north - south) * (0.5 * per_m);
  let second = ((west - z) + (east - z)) + ((south - z) + (north - z));
  let ground = Ground(z, slope_x, slope_y, concavity(second * per_m), sqrt(slope_x * slope_x + slope_y * slope_y));
  var out: Start;
  out.ground = ground;
  out.grounds = Grounds(z, z);
  return out;
}

// Returns the start at the children of a cell from the parent's samples.
fn child_start(cell: Cell) -> Start {
  let a = ground_row(cell, 0u);
  let b = ground_row(cell, 1u);
  let c = ground_row(cell, 2u);
  let d = ground_row(cell, cell.far.y);
  let sa = state_row(cell, 0u);
  let sb = state_row(cell, 1u);
  let sc = state_row(cell, 2u);
  let sd = state_row(cell, cell.far.y);
  let per_m = site.levels[cell.job.level].inverse_spacing;
  let ground = ground_of(a, b, c, a.guide + sa.d, b.guide + sb.d, c.guide + sc.d, d.guide + sd.d, per_m);
  let hs = bspline_words_y(sa.hs, sb.hs, sc.hs);
  let wg = bspline_words_y(sa.wg, sb.wg, sc.wg);
  let ff = bspline_words_y(sa.ff, sb.ff, sc.ff);
  let before = SynthState(bspline_y(bspline_x(sa.d), bspline_x(sb.d), bspline_x(sc.d)),
    2.0 * hs.low, hs.high, wg.low, wg.high, ff.low, ff.high, vec4f(0.0));
  return Start(ground, before, interpolated(a, b, c, d));
}

// Constants and targets stand for the parent that level 0 does not have.
fn orphan(goal: Targets) -> SynthState {
  return SynthState(vec4f(0.0), vec4f(SYNTH_SMOOTHNESS), goal.snow, goal.wet, goal.grass, goal.forest, goal.foam, vec4f(0.0));
}

// One entry for all levels: a second one for the root would compile the rule, most of the code, a second time.
@compute @workgroup_size(64)
fn synthesise(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
  let cell = cell_of(group, lane);
  if (cell.child.y > LAST_SAMPLE) { return; }
  let job = cell.job;
  var start: Start;
  if (job.level == 0u) { start = root_start(job, cell.child); } else { start = child_start(cell); }
  let i = global_pair(job.x, cell.child.x, job.level);
  let j = global_pair(job.y, cell.child.y, job.level);
  let noise = noise_of(job.level, i, j);
  let goal = targets(start.ground);
  if (job.level == 0u) { start.before = orphan(goal); }
  let made = rule(job.level, start.ground, start.before, goal, asked_of(job.level, i, j), noise);
  put_children(job, cell.child, start.grounds, made, noise);
}

fn put_composed(job: SynthJob, at: vec2i, ground: vec2f) {
  if (any(at > vec2i(LAST_SAMPLE))) { return; }
  let settled = settle_ground(job, at, ground);
  let height = settled.y + bitcast<f32>(states[slot_texel(job.slot, at)].x);
  textureStore(heights_out, slot_origin(job.slot) + at, slot_layer(job.slot), vec4f(height, 0.0, 0.0, 0.0));
}

@compute @workgroup_size(64)
fn compose(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
  let cell = cell_of(group, lane);
  if (cell.child.y > LAST_SAMPLE) { return; }
  let g = interpolated(ground_row(cell, 0u), ground_row(cell, 1u), ground_row(cell, 2u), ground_row(cell, cell.far.y));
  for (var k = 0u; k < 4u; k += 1u) {
    put_composed(cell.job, cell.child + vec2i(vec2u(k & 1u, k >> 1u)), vec2f(g.guide[k], g.base[k]));
  }
}

@compute @workgroup_size(64)
fn compose_root(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
  let job = jobs[group.y];
  let k = group.x * 64u + lane;
  let at = 2 * (vec2i(i32(k % CELLS_ACROSS), i32(k / CELLS_ACROSS)) - 1);
  if (at.y > LAST_SAMPLE) { return; }
  for (var c = 0; c < 4; c += 1) { put_composed(job, at + vec2i(c & 1, c >> 1u), vec2f(0.0)); }
}
