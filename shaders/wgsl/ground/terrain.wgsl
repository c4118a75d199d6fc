// The ground: one instanced draw of all patches.
struct TerrainVertex {
  @builtin(position) position: vec4f,
  @location(0) relative: vec3f,
  @location(1) at: vec2f,
  @location(2) morph: f32,
  @location(3) @interpolate(flat) origins: vec4f,  // where its texels lie (PatchTexels)
  @location(8) @interpolate(flat) layers: vec3i,   // and in which layers; its level
  @location(4) through: vec3f,
  @location(5) glow: vec3f,
  @location(6) detail: vec4f,
  @location(7) above_lake: f32,
};

@vertex
fn terrain_vertex(@builtin(vertex_index) index: u32, patch_in: PatchIn) -> TerrainVertex {
  let v = patch_vertex(patch_in.record, vec2i(i32(index % PITCH), i32(index / PITCH)));
  var out: TerrainVertex;
  let relative = v.relative - vec3f(0.0, 0.0, river_bed(v.world.xy, length(v.relative)));
  out.position = guarded(clip_of(relative));
  out.relative = relative;
  out.at = v.at;
  out.morph = v.morph;
  let texels = patch_texels(patch_in.record);
  out.origins = texels.origins;
  out.layers = vec3i(texels.layers, i32(patch_level(patch_in.record)));
  let air = air_to(v.world);
  out.through = air.through;
  out.glow = air.glow;
  out.detail = detail_at(v.world.xy);
  out.above_lake = above_lake(v.world);
  return out;
}

// Noise amplitude (1 = view.amplitude metres), roughness, how far the selected stroke is felt and contours show at a place.
// They are smooth: taken at the vertices.
fn detail_at(p: vec2f) -> vec4f {
  let side = vec2f(textureDimensions(channels));
  return textureSampleLevel(channels, smooth_clamp, (p / view.size * (side - 1.0) + 0.5) / side, 0.0);
}

// What lies and grows on the ground here (the words of synthesis/synthesise.wgsl).
fn cover_of(surface: Surface) -> Attributes {
  let a = surface.attributes0;
  let b = surface.attributes1;
  return Attributes(a.x, a.y, a.z, a.w, b.x, b.y, b.z);
}

@fragment
fn terrain_fragment(v: TerrainVertex) -> @location(0) vec4f {
  let f = Footprint(dpdx(v.relative), dpdy(v.relative));
  let world = v.relative + view.eye.xyz;
  let rate = abs(f.dx.z) + abs(f.dy.z);
  let surface = patch_surface(PatchTexels(v.origins, v.layers.xy), v.at, v.morph);
  let site = survey(world, surface.gradient, surface.curvature, f, cover_of(surface), v.above_lake);
  let river = river_near(world.xy, f);
  var m = river_banks(ground_material(site), river, site);
  if (view.overlay == OVERLAY_SLOPE) {
    m.albedo = mix(m.albedo, slope_tint(site.steep), 0.8);
    m.gloss = 0.0;
  } else if (view.overlay == OVERLAY_DETAIL) {
    m.albedo = mix(m.albedo, detail_tint(v.detail.xy), 0.8);
    m.gloss = 0.0;
  } else if (view.overlay == OVERLAY_INFLUENCE) {
    m.albedo = influence_tint(m.albedo, v.detail.z);
    m.gloss *= 1.0 - v.detail.z;
  } else if (view.overlay == OVERLAY_PAINTED) {
    m.albedo = mix(m.albedo, painted_tint(v.detail.z), 0.8);
    m.gloss = 0.0;
  } else if (view.overlay == OVERLAY_WATERSHED) {
    m.albedo = watershed_tint(m.albedo, v.detail.z);
  } else if (view.overlay == OVERLAY_DIFFERENCE) {
    m.albedo = difference_tint(m.albedo, v.detail.z);
    m.gloss = 0.0;
  } else if (view.overlay == OVERLAY_PATCHES) {
    m.albedo = mix(m.albedo, level_tint(u32(v.layers.z)) * 0.5, 0.7);
  }
  let dir = ray_to(world);
  var colour = shade(m, surface.gradient, surface, dir);
  colour = river_water(colour, river, site, surface, dir, min(v.above_lake, select(FAR_ABOVE, world.z - view.sea, view.has_sea > 0.5)));
  if (view.grid > 0.0) {
    let line = scale_grid(world.xy, f) * view.grid * exp(-distance(world, view.eye.xyz) / (1.1 * view.size) * (1.0 - view.eye.w));
    colour = mix(colour, colour * 1.9 + vec3f(0.05), line * 0.42);
  }
  let strength = select(view.contour_strength, max(view.contour_strength, 0.8), view.overlay == OVERLAY_CONTOURS);
  if (strength > 0.0) {
    colour = inked(colour, contours(world.z, rate, v.detail.w) * strength);
  }
  if (view.overlay == OVERLAY_PATCHES) {
    let cell = abs(fract(v.at / f32(PATCH_CELLS) - 0.5) - 0.5) * f32(PATCH_CELLS);
    colour = mix(colour, vec3f(0.9), 0.6 * (1.0 - smoothstep(0.1, 0.5, min(cell.x, cell.y))));
  }
  colour = colour * v.through + v.glow;
  let shown = display(colour, v.position.xy);
  return vec4f(with_cursors(shown.rgb, world), 1.0);
}
