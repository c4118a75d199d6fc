// Per sample of a tile: surface gradient by central differences, and curvature. One invocation a sample and tile.
// The border of 2 comes from the neighbours, so shared edges get the same value in both tiles.
struct Job {
  slot: u32,
  level: u32,
  x: u32,
  y: u32,
};

struct JobList {
  size: f32,          // side of the domain, metres
  count: u32,
  pad0: u32,
  pad1: u32,
  jobs: array<Job, 1024>,
};

@group(0) @binding(0) var<storage, read> list: JobList;
@group(0) @binding(1) var heights: texture_2d_array<f32>;
@group(0) @binding(2) var slopes_out: texture_storage_2d_array<rgba16float, write>;

@compute @workgroup_size(8, 8, 1)
fn compute_normals(@builtin(global_invocation_id) id: vec3u) {
  let at = vec2i(id.xy) - 1;
  if (any(at > vec2i(TILE_SAMPLES)) || id.z >= list.count) { return; }
  let job = list.jobs[id.z];
  let origin = slot_origin(job.slot);
  let layer = slot_layer(job.slot);
  let cell = list.size / f32(u32(TILE_CELLS) << job.level);
  let here = textureLoad(heights, origin + at, layer, 0).x;
  let west = textureLoad(heights, origin + at - vec2i(1, 0), layer, 0).x;
  let east = textureLoad(heights, origin + at + vec2i(1, 0), layer, 0).x;
  let south = textureLoad(heights, origin + at - vec2i(0, 1), layer, 0).x;
  let north = textureLoad(heights, origin + at + vec2i(0, 1), layer, 0).x;
  let gradient = vec2f(east - west, north - south) / (2.0 * cell);
  let curvature = (west + east + south + north - 4.0 * here) / cell;
  textureStore(slopes_out, origin + at, layer, vec4f(clamp(gradient, vec2f(-64.0), vec2f(64.0)), clamp(curvature, -64.0, 64.0), 0.0));
}
