// Light of a synthetic tile taken over from its parent, where marching it anew would cost too much (tiles/sun.wgsl).
// Written beside the atlas, which cannot be read and written at once; the host copies it there.
struct TakeJob {
  place: u32,   // slot of the scratch layer
  parent: u32,  // slot of the parent
  x: u32,
  y: u32,
};

@group(0) @binding(0) var<storage, read> jobs: array<TakeJob>;
@group(0) @binding(1) var light: texture_2d_array<f32>;
@group(0) @binding(2) var light_out: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(8, 8, 1)
fn take_light(@builtin(global_invocation_id) id: vec3u) {
  let at = vec2i(id.xy) - 1;
  if (any(at > vec2i(TILE_SAMPLES))) { return; }
  let job = jobs[id.z];
  let wide = at + vec2i(vec2u(job.x & 1u, job.y & 1u)) * TILE_CELLS;
  let odd = wide & vec2i(1);
  let low = slot_origin(job.parent) + (wide >> vec2u(1u));
  let layer = slot_layer(job.parent);
  let sum = textureLoad(light, low, layer, 0) + textureLoad(light, low + vec2i(odd.x, 0), layer, 0)
    + textureLoad(light, low + vec2i(0, odd.y), layer, 0) + textureLoad(light, low + odd, layer, 0);
  textureStore(light_out, slot_origin(job.place) + at, 0.25 * sum);
}
