// The sides of the block, from the border of the drawn ground down to the plane on which it stands (or to the sea).
// One instance per border side of a border patch; the top row is the patch's own edge, vertex for vertex.
struct WallVertex {
  @builtin(position) position: vec4f,
  @location(0) world: vec3f,
  @location(1) top: f32,
  @location(2) @interpolate(flat) normal: vec2f,
  @location(3) through: vec3f,
  @location(4) glow: vec3f,
};

@vertex
fn wall_vertex(@builtin(vertex_index) index: u32, @location(0) record: vec4u, @location(1) side: u32) -> WallVertex {
  // Two triangles per cell: (top k, bottom k, top k+1), (top k+1, bottom k, bottom k+1).
  let corner = array<vec2u, 6>(vec2u(0u, 0u), vec2u(0u, 1u), vec2u(1u, 0u), vec2u(1u, 0u), vec2u(0u, 1u), vec2u(1u, 1u))[index % 6u];
  let k = i32(index / 6u + corner.x);
  var g = vec2i(k, 0);
  var normal = vec2f(0.0, -1.0);
  switch (side) {
    case 1u: { g = vec2i(0, k); normal = vec2f(-1.0, 0.0); }
    case 2u: { g = vec2i(PATCH_CELLS, k); normal = vec2f(1.0, 0.0); }
    case 8u: { g = vec2i(k, PATCH_CELLS); normal = vec2f(0.0, 1.0); }
    default: {}
  }
  let v = patch_vertex(record, g);
  var world = v.world;
  var relative = v.relative;
  if (corner.y == 1u) {
    world.z = min(world.z, select(view.base, view.sea, view.has_sea > 0.5));
    relative.z = (world.z - view.eye.z) - view.eye_low.z;
  }
  let air = air_to(world);
  return WallVertex(guarded(clip_of(relative)), world, v.world.z, normal, air.through, air.glow);
}

@fragment
fn wall_fragment(v: WallVertex) -> @location(0) vec4f {
  let along = select(v.world.x, v.world.y, abs(v.normal.x) > 0.5);
  let f = Footprint(dpdx(v.world), dpdy(v.world));
  let rate_along = vec2f(select(f.dx.x, f.dx.y, abs(v.normal.x) > 0.5), f.dx.z);
  let rate_up = vec2f(select(f.dy.x, f.dy.y, abs(v.normal.x) > 0.5), f.dy.z);
  let depth = max(v.top - v.world.z, 0.0);
  let at = vec2f(along, v.world.z);
  let broad = noise_sample(at, rate_along, rate_up, view.size * 0.31);
  let fine = noise_sample(at * vec2f(1.0, 3.0), rate_along * vec2f(1.0, 3.0), rate_up * vec2f(1.0, 3.0), view.size * 0.035);
  // Beds follow the surface near it and lie flat further down.
  let unit = view.size / 4096.0;
  let flat = mix(depth, (view.high - v.world.z) * 0.5 + depth * 0.5, smoothstep(20.0, 160.0, depth / unit));
  let z = flat / unit + (broad.r - 0.5) * 70.0 + (fine.r - 0.5) * 6.0;
  let bed = fract(z / 46.0);
  let id = floor(z / 46.0);
  let shade = fract(sin(id * 12.9898) * 43758.547);
  var colour = mix(vec3f(0.150, 0.128, 0.106), vec3f(0.232, 0.208, 0.178), shade);
  colour *= 0.80 + 0.30 * fine.g + 0.18 * smoothstep(0.0, 0.12, bed) * smoothstep(1.0, 0.8, bed);
  if (view.look == LOOK_DESERT) { colour = mix(vec3f(0.36, 0.165, 0.090), vec3f(0.56, 0.36, 0.21), shade) * (0.8 + 0.4 * fine.g); }
  if (view.look == LOOK_ALPINE) { colour = mix(vec3f(0.16, 0.16, 0.17), vec3f(0.27, 0.265, 0.265), shade) * (0.8 + 0.4 * fine.g); }
  // Sheets of card, cut level.
  if (view.look == LOOK_PAPER) { colour = mix(vec3f(0.62, 0.55, 0.44), vec3f(0.76, 0.69, 0.56), smoothstep(0.0, 0.25, fract(v.world.z / view.contour)) * smoothstep(1.0, 0.8, fract(v.world.z / view.contour))); }
  // Topsoil.
  let soil = 1.0 - smoothstep(5.0, 8.0, depth / unit + (fine.r - 0.5) * 5.0);
  if (view.look != LOOK_PAPER) { colour = mix(colour, vec3f(0.070, 0.048, 0.030), soil * 0.8); }
  let n = normalize(vec3f(v.normal, 0.12 * (fine.r - 0.5)));
  let foot = 1.0 - 0.45 * exp(-(v.world.z - view.base) / (0.02 * view.size));
  let lit = colour * (sun_light() * max(dot(n, view.sun.xyz), 0.0) / 3.14159265 + ambient_light(n) * 0.85) * foot;
  return display(lit * v.through + v.glow, v.position.xy);
}
