// The vertices of a drawn patch: 17 x 17 samples of a tile, morphed towards the parent's surface (DESIGN 9).
// Terrain, water and walls use the same function, so that they meet exactly.
struct PatchIn {
  @location(0) record: vec4u,  // see Cut.records in frontend/src/tiles/patches/selection.ts
};

struct PatchVertex {
  world: vec3f,
  relative: vec3f,  // to the eye, exact where `world` has lost digits
  at: vec2f,      // sample position in the own tile, 0..64
  morph: f32,
};

override PITCH: u32 = 17u;     // vertex numbering: row stride of the index buffer
// Cells from an edge on which the weights of the corners count; further inside it is the patch's own alone.
const EDGE_BAND: f32 = 2.0;

fn patch_slot(record: vec4u) -> u32 { return record.z & 0xfffu; }
fn patch_parent(record: vec4u) -> u32 { return (record.z >> 12u) & 0xfffu; }
fn patch_own_morph(record: vec4u) -> f32 { return f32(record.z >> 24u) / 255.0; }
fn patch_level(record: vec4u) -> u32 { return (record.y >> 24u) & 31u; }
fn patch_edges(record: vec4u) -> u32 { return (record.x >> 24u) & 15u; }
fn patch_corner(record: vec4u) -> vec2i { return vec2i(record.xy & vec2u(0xffffffu)); }

// Sample position in the parent's tile of a sample position of the tile.
fn parent_at(record: vec4u, at: vec2f) -> vec2f {
  let corner = patch_corner(record);
  let quadrant = vec2f(vec2i((corner.x / TILE_CELLS) & 1, (corner.y / TILE_CELLS) & 1));
  return (at + quadrant * f32(TILE_CELLS)) * 0.5;
}

fn sample_height(slot: u32, at: vec2i) -> f32 {
  return textureLoad(heights, slot_origin(slot) + at, slot_layer(slot), 0).x;
}

// The parent's surface at a sample of the tile: its own sample, or the middle of the edge or diagonal it lies on.
fn parent_height(record: vec4u, at: vec2i) -> f32 {
  let corner = patch_corner(record);
  let quadrant = vec2i((corner.x / TILE_CELLS) & 1, (corner.y / TILE_CELLS) & 1);
  let low = quadrant * (TILE_CELLS / 2) + (at >> vec2u(1u));
  let odd = at & vec2i(1);
  let slot = patch_parent(record);
  return 0.5 * (sample_height(slot, low + vec2i(odd.x, 0)) + sample_height(slot, low + vec2i(0, odd.y)));
}

// Exact at both ends, whatever the compiler makes of it: neighbours must compute the same bits.
fn exact_mix(a: f32, b: f32, t: f32) -> f32 {
  if (t <= 0.0) { return a; }
  if (t >= 1.0) { return b; }
  return a * (1.0 - t) + b * t;
}

// Morph weight of vertex g (0..16): on an edge from the weights of its two corners, inside soon the patch's own. So a
// coarser neighbour flattens a band along the edge, not the patch.
fn patch_morph(record: vec4u, g: vec2i) -> f32 {
  let c = unpack4x8unorm(record.w);
  let t = vec2f(g) / f32(PATCH_CELLS);
  if (g.x == 0) { return exact_mix(c.x, c.z, t.y); }
  if (g.x == PATCH_CELLS) { return exact_mix(c.y, c.w, t.y); }
  if (g.y == 0) { return exact_mix(c.x, c.y, t.x); }
  if (g.y == PATCH_CELLS) { return exact_mix(c.z, c.w, t.x); }
  let corners = mix(mix(c.x, c.y, t.x), mix(c.z, c.w, t.x), t.y);
  let inside = min(g, PATCH_CELLS - g);
  return mix(patch_own_morph(record), corners, max(0.0, 1.0 - f32(min(inside.x, inside.y)) / EDGE_BAND));
}

fn patch_vertex(record: vec4u, grid: vec2i) -> PatchVertex {
  var g = grid;
  let edges = patch_edges(record);
  let odd = g & vec2i(1);
  // Beside a coarser neighbour only every second vertex exists: the odd ones collapse onto the even ones.
  if ((g.x == 0 && (edges & 1u) != 0u) || (g.x == PATCH_CELLS && (edges & 2u) != 0u)) { g.y -= odd.y; }
  if ((g.y == 0 && (edges & 4u) != 0u) || (g.y == PATCH_CELLS && (edges & 8u) != 0u)) { g.x -= odd.x; }
  let corner = patch_corner(record);
  let at = (corner & vec2i(TILE_CELLS - 1)) + g;
  let morph = patch_morph(record, g);
  var z: f32;
  if (morph >= 1.0) {
    z = parent_height(record, at);
  } else {
    z = sample_height(patch_slot(record), at);
    if (morph > 0.0) { z = exact_mix(z, parent_height(record, at), morph); }
  }
  // On the lattice of the finest level both sides of a seam are the same integers, and so get the same bits.
  let lattice = vec2f((corner + g) << vec2u(u32(MAX_SYNTHESIS_LEVEL) - patch_level(record)));
  var out: PatchVertex;
  out.world = vec3f(lattice * view.finest_cell, z);
  out.relative = vec3f((lattice - view.eye_cell) * view.finest_cell - view.eye_part, (z - view.eye.z) - view.eye_low.z);
  out.at = vec2f(at);
  out.morph = morph;
  return out;
}

// Where a patch's samples lie in the atlas's textures: found per vertex, so that pixels only scale and add.
struct PatchTexels {
  origins: vec4f,  // texture coordinates of the sample position 0: of the own tile, of the parent's for it
  layers: vec2i,
};

fn patch_texels(record: vec4u) -> PatchTexels {
  let own = patch_slot(record);
  let parent = patch_parent(record);
  let origins = vec4f(slot_uv(own, vec2f(0.0)), slot_uv(parent, parent_at(record, vec2f(0.0))));
  return PatchTexels(origins, vec2i(slot_layer(own), slot_layer(parent)));
}

fn own_uv(texels: PatchTexels, at: vec2f) -> vec2f { return texels.origins.xy + at * SLOT_UV; }

fn parent_uv(texels: PatchTexels, at: vec2f) -> vec2f { return texels.origins.zw + at * (0.5 * SLOT_UV); }

// Surface gradient (dz/dx, dz/dy), sun and sky visibility and synthesised channels at a point of a patch, morphed like the
// heights.
struct Surface {
  gradient: vec2f,
  curvature: f32,
  sun: f32,
  sky: f32,
  attributes0: vec4f,  // snow, wet, foam, smoothness / 2
  attributes1: vec4f,  // grass, forest, grain, size of the next level's detail
};

fn patch_surface(texels: PatchTexels, at: vec2f, morph: f32) -> Surface {
  let uv = own_uv(texels, at);
  let own = texels.layers.x;
  var s = textureSampleLevel(slopes, smooth_clamp, uv, own, 0.0);
  var l = textureSampleLevel(light, smooth_clamp, uv, own, 0.0);
  var a0 = textureSampleLevel(attributes0, smooth_clamp, uv, own, 0.0);
  var a1 = textureSampleLevel(attributes1, smooth_clamp, uv, own, 0.0);
  if (morph > 0.0) {
    let up = parent_uv(texels, at);
    let parent = texels.layers.y;
    s = mix(s, textureSampleLevel(slopes, smooth_clamp, up, parent, 0.0), morph);
    l = mix(l, textureSampleLevel(light, smooth_clamp, up, parent, 0.0), morph);
    a0 = mix(a0, textureSampleLevel(attributes0, smooth_clamp, up, parent, 0.0), morph);
    a1 = mix(a1, textureSampleLevel(attributes1, smooth_clamp, up, parent, 0.0), morph);
  }
  return Surface(s.xy, s.z, l.x, l.y, a0, a1);
}
