// The plane that is being drawn on: translucent, with a fine grid.
struct GhostVertex {
  @builtin(position) position: vec4f,
  @location(0) at: vec2f,        // metres along its two sides
  @location(1) uv: vec2f,
  @location(2) @interpolate(flat) colour: vec4f,
  @location(3) @interpolate(flat) every: f32,
};

@vertex
fn ghost_vertex(
  @builtin(vertex_index) index: u32,
  @location(0) p0: vec3f, @location(1) p1: vec3f, @location(2) p2: vec3f, @location(3) p3: vec3f, @location(4) colour: vec4f,
) -> GhostVertex {
  let corner = array<u32, 6>(0u, 1u, 2u, 0u, 2u, 3u)[index];
  let p = array<vec3f, 4>(p0, p1, p2, p3)[corner];
  let uv = array<vec2f, 4>(vec2f(0.0, 0.0), vec2f(1.0, 0.0), vec2f(1.0, 1.0), vec2f(0.0, 1.0))[corner];
  let sides = vec2f(distance(p0, p1), distance(p0, p3));
  return GhostVertex(to_clip(p), uv * sides, uv, colour, view.size / 64.0);
}

@fragment
fn ghost_fragment(v: GhostVertex) -> @location(0) vec4f {
  let rate = fwidth(v.at);
  let fine = max(lines(v.at.x, v.every, rate.x, 0.3), lines(v.at.y, v.every, rate.y, 0.3));
  let coarse = max(lines(v.at.x, v.every * 4.0, rate.x, 0.5), lines(v.at.y, v.every * 4.0, rate.y, 0.5));
  // Fades towards its rim, so that it reads as a pane of light rather than a wall.
  let edge = min(v.uv, 1.0 - v.uv);
  let fade = smoothstep(0.0, 0.12, edge.x) * smoothstep(0.0, 0.12, edge.y);
  let alpha = (0.10 + 0.16 * fine + 0.26 * coarse) * mix(0.25, 1.0, fade) * v.colour.a;
  return vec4f(v.colour.rgb, alpha);
}
