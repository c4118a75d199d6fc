// The coarse picture of an elevation grid that is being placed: a translucent relief over the ground. Drawn twice: where it is
// seen, and faintly where the ground hides it, so that one can tell how deep it would lie.
struct PlacingVertex {
  @builtin(position) position: vec4f,
  @location(0) uv: vec2f,       // cells of the picture
  @location(1) shade: f32,
  @location(2) colour: vec4f,
};

override BEHIND: u32 = 0u;

@vertex
fn placing_vertex(@location(0) place: vec3f, @location(1) lattice: vec3f, @location(2) colour: vec4f) -> PlacingVertex {
  return PlacingVertex(to_clip(place), lattice.xy, lattice.z, colour);
}

@fragment
fn placing_fragment(v: PlacingVertex) -> @location(0) vec4f {
  let rate = fwidth(v.uv);
  let mesh = max(lines(v.uv.x, 1.0, rate.x, 0.4), lines(v.uv.y, 1.0, rate.y, 0.4));
  let lit = mix(v.colour.rgb * 0.25, mix(v.colour.rgb, vec3f(1.0), 0.55), v.shade);
  let strength = select(0.78, 0.13, BEHIND == 1u);
  return vec4f(mix(lit, lit * 0.7, mesh * 0.5), strength * v.colour.a);
}
