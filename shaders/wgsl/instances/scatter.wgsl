// Finds the trees, rocks and tufts of a picture: one workgroup for each patch of the cut and kind. A candidate belongs to the
// patch that it stands on, whose drawn surface says how high; what grows there is read on one level, which is in the atlas
// wherever finer ones are, so that none comes or goes as tiles refine.
struct Turn {
  count: u32,        // patches
  soil_level: u32,   // the level on which the channels are read
  near: f32,         // metres at which trees turn from meshes into impostors
  pad: u32,
};

// Room for each sort: trees close by, trees far away, rocks, tufts; they lie behind each other.
fn room_of(sort: u32) -> u32 {
  return array<u32, 4>(u32(MOST_NEAR_TREES), u32(MOST_FAR_TREES), u32(MOST_ROCKS), u32(MOST_TUFTS))[sort];
}

fn first_of(sort: u32) -> u32 {
  var first = 0u;
  for (var k = 0u; k < sort; k += 1u) { first += room_of(k); }
  return first;
}

const WORDS_A_DRAW: u32 = 4u;

@group(1) @binding(0) var<uniform> turn: Turn;
@group(1) @binding(1) var<storage, read> records: array<vec4u>;
@group(1) @binding(2) var<storage, read> pages: array<vec2u, PLACES>;
@group(1) @binding(3) var<storage, read_write> found: array<vec4f>;   // three for each
@group(1) @binding(4) var<storage, read_write> draws: array<atomic<u32>>;

// The drawn surface at a place of a patch, in cells from its corner; relative to the eye. Heights are those of the triangles;
// the place is as it was asked for, also where vertices beside a coarser neighbour have moved.
fn drawn_at(record: vec4u, at: vec2f, spacing: f32) -> vec3f {
  let whole = min(vec2i(at), vec2i(PATCH_CELLS - 1));
  let part = at - vec2f(whole);
  let place = patch_vertex(record, vec2i(0)).relative.xy + at * spacing;
  let east = patch_vertex(record, whole + vec2i(1, 0)).relative.z;
  let north = patch_vertex(record, whole + vec2i(0, 1)).relative.z;
  // Cells are cut from their south-east to their north-west corner.
  if (part.x + part.y <= 1.0) {
    let corner = patch_vertex(record, whole).relative.z;
    return vec3f(place, corner + (east - corner) * part.x + (north - corner) * part.y);
  }
  let corner = patch_vertex(record, whole + vec2i(1, 1)).relative.z;
  return vec3f(place, corner + (north - corner) * (1.0 - part.x) + (east - corner) * (1.0 - part.y));
}

// Broad noise as the materials have it (material/site.wgsl), without its finest octaves.
fn broad_woods(p: vec2f) -> f32 {
  let a = textureSampleLevel(noise, smooth_repeat, turned(p, vec2f(0.917, -0.399)) / (view.size * 1.37), 0.0);
  let b = textureSampleLevel(noise, smooth_repeat, turned(p, vec2f(0.602, 0.799)) / (view.size * 0.27), 0.0);
  return a.g * 0.48 + b.r * 0.42 + 0.09;
}

struct Plot {
  record: vec4u,
  corner: vec2f,     // of the patch, metres
  spacing: f32,      // of its samples
  soil: u32,         // slot of the tile whose channels count
  soil_corner: vec2f,
  soil_spacing: f32,
};

fn plot_of(record: vec4u) -> Plot {
  let level = patch_level(record);
  let corner = patch_corner(record);
  let spacing = view.size / f32(u32(TILE_CELLS) << level);
  var up = level;
  var slot = patch_slot(record);
  if (level > turn.soil_level) {
    up = turn.soil_level;
    slot = page(up, vec2u(corner >> vec2u(level - up)) / u32(TILE_CELLS));
    if (slot == NO_SLOT) {
      up = level;
      slot = patch_slot(record);
    }
  }
  let wide = view.size / f32(u32(TILE_CELLS) << up);
  let tile = (corner >> vec2u(level - up)) / TILE_CELLS;
  return Plot(record, vec2f(corner) * spacing, spacing, slot, vec2f(tile * TILE_CELLS) * wide, wide);
}

struct Ground {
  soil: Soil,
  gradient: vec2f,
};

fn ground_at(plot: Plot, p: vec2f, z: f32) -> Ground {
  let uv = slot_uv(plot.soil, (p - plot.soil_corner) / plot.soil_spacing);
  let layer = slot_layer(plot.soil);
  let a = textureSampleLevel(attributes0, smooth_clamp, uv, layer, 0.0);
  let b = textureSampleLevel(attributes1, smooth_clamp, uv, layer, 0.0);
  let g = textureSampleLevel(slopes, smooth_clamp, uv, layer, 0.0).xy;
  let soil = Soil(b.x, b.y, a.x, a.y, a.w, length(g), (z - view.sea) / view.relief, broad_woods(p));
  return Ground(soil, g);
}

fn dry_at(p: vec3f) -> bool {
  let above = select(FAR_ABOVE, p.z - view.sea, view.has_sea > 0.5);
  return min(above, above_lake(p)) > 0.3;
}

fn put(sort: u32, a: vec4f, b: vec4f, c: vec4f) {
  let at = atomicAdd(&draws[sort * WORDS_A_DRAW + 1u], 1u);
  if (at >= room_of(sort)) { return; }
  let to = 3u * (first_of(sort) + at);
  found[to] = a;
  found[to + 1u] = b;
  found[to + 2u] = c;
}

fn size_of(kind: u32, s: Stand, soil: Soil) -> f32 {
  if (kind == KIND_TREE) { return mix(4.5, 13.0, s.size) * mix(0.55, 1.0, ramp(0.2, 0.8, soil.forest)) * select(1.0, 0.35, view.look == LOOK_DESERT); }
  if (kind == KIND_ROCK) { return 0.16 + 0.5 * s.size * s.size + 1.7 * pow(s.size, 14.0); }
  return mix(0.14, 0.34, s.size) * select(1.0, 1.6, view.look == LOOK_DESERT);
}

fn plant(plot: Plot, cell: vec2i, kind: u32) {
  let s = stand_of(cell, kind);
  let p = (vec2f(cell) + s.at) * cell_of_kind(kind);
  let at = (p - plot.corner) / plot.spacing;
  // Each stands on one patch.
  if (any(at < vec2f(0.0)) || any(at >= vec2f(f32(PATCH_CELLS))) || any(p >= vec2f(view.size))) { return; }
  let relative = drawn_at(plot.record, at, plot.spacing);
  let away = length(vec3f(relative.xy, relative.z * view.exaggeration));
  // They end at their own distance, so that no edge of them is seen.
  let reach = reach_of_kind(kind) * mix(0.55, 1.0, fract(s.hue * 7.0 + s.turn * 3.0));
  let left = 1.0 - smoothstep(0.72, 1.0, away / reach);
  if (left <= 0.0) { return; }
  let clip = clip_of(relative + vec3f(0.0, 0.0, 4.0));
  if (clip.w < -6.0 || any(abs(clip.xy) > vec2f(abs(clip.w) * 1.12 + 20.0))) { return; }
  let world = relative + view.eye.xyz;
  let ground = ground_at(plot, p, world.z);
  if (s.least >= density(kind, view.look, ground.soil) || !dry_at(vec3f(p, world.z))) { return; }
  let size = size_of(kind, s, ground.soil);
  // Smaller than two pixels: nothing.
  let seen = size / pixel_size(world);
  let shown = left * smoothstep(1.6, 3.2, seen);
  if (shown <= 0.0) { return; }
  let slot = patch_slot(plot.record);
  let lit = textureSampleLevel(light, smooth_clamp, slot_uv(slot, vec2f(patch_corner(plot.record) & vec2i(TILE_CELLS - 1)) + at), slot_layer(slot), 0.0);
  let a = vec4f(relative, size * shown);
  let b = vec4f(s.turn, s.hue, lit.x, lit.y);
  if (kind == KIND_TREE) {
    // Meshes close by, impostors further off; between them one fades into the other.
    let far = smoothstep(0.8 * turn.near, turn.near, away);
    // A crown around the eye would hide all else.
    let clear = smoothstep(0.30, 0.55, away / size);
    if (far < 1.0 && clear > 0.0) { put(0u, a, b, vec4f(ground.gradient, ground.soil.snow, (1.0 - far) * clear)); }
    if (far > 0.0) { put(1u, a, b, vec4f(ground.gradient, ground.soil.snow, far)); }
  } else {
    put(kind + 1u, a, b, vec4f(ground.gradient, ground.soil.snow, ground.soil.grass));
  }
}

@compute @workgroup_size(64)
fn scatter(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
  if (group.x >= turn.count) { return; }
  let kind = group.y;
  let plot = plot_of(records[group.x]);
  let side = plot.spacing * f32(PATCH_CELLS);
  let nearest = clamp(view.eye.xy, plot.corner, plot.corner + side);
  if (distance(nearest, view.eye.xy) > reach_of_kind(kind)) { return; }
  let cell = cell_of_kind(kind);
  let low = vec2i(floor(plot.corner / cell));
  let across = vec2i(floor((plot.corner + side) / cell)) - low + 1;
  let total = u32(across.x * across.y);
  for (var k = lane; k < total; k += 64u) {
    plant(plot, low + vec2i(i32(k) % across.x, i32(k) / across.x), kind);
  }
}

// What found no room is not drawn.
@compute @workgroup_size(4)
fn close(@builtin(local_invocation_index) sort: u32) {
  atomicMin(&draws[sort * WORDS_A_DRAW + 1u], room_of(sort));
}
