@compute @workgroup_size(8, 8)
fn reduce_depth(@builtin(global_invocation_id) id: vec3u) {
  let to = turn.pyramid[0];
  if (any(id.xy >= to.yz)) { return; }
  let low = id.xy * BASE_PIXELS;
  let high = min(low + BASE_PIXELS, turn.size);
  var least = 1.0;
  for (var y = low.y; y < high.y; y += 1u) {
    for (var x = low.x; x < high.x; x += 1u) { least = min(least, depth_at(vec2u(x, y))); }
  }
  pyramid[to.x + id.y * to.y + id.x] = least;
}
