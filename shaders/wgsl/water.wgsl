// The sea: absorption by depth, waves, Fresnel reflection of the sky, the sun's glitter, foam at the shore. Inside the
// domain it is drawn on the patches themselves, so that its shore is exactly the ground's contour; outside it is part of
// the background.

// Absorption per metre of clear water, and what it scatters back.
const WATER_ABSORB: vec3f = vec3f(0.30, 0.105, 0.080);
const WATER_SCATTER: vec3f = vec3f(0.008, 0.042, 0.052);

// `grazing`: sine of the angle between sight and surface; the footprint of a pixel grows as it shrinks.
fn wave_slope(p: vec2f, distance: f32, grazing: f32) -> vec2f {
  let lod = log2(max(distance * view.forward.w, 1.0e-3) * 256.0) - 0.8 * log2(max(grazing, 0.01));
  var slope = vec2f(0.0);
  let drift = view.time * vec2f(0.6, 0.35);
  let a = textureSampleLevel(noise, smooth_repeat, (p + drift * 6.0) / 160.0, max(lod - log2(160.0), 0.0));
  let b = textureSampleLevel(noise, smooth_repeat, (p.yx * vec2f(1.0, -1.0) - drift * 3.0) / 47.0, max(lod - log2(47.0), 0.0));
  slope += noise_slope(a) * 0.030 + noise_slope(b).yx * 0.035;
  return slope + small_waves(p, drift, lod);
}

// Colour of the water (not yet through the air) and how much of it hides what is below.
// `bed` is the lit ground under it, used where there is no ground to blend with (then the result is opaque).
fn water_surface(p: vec3f, dir: vec3f, depth: f32, foam_noise: vec3f, bed: vec3f) -> vec4f {
  let distance = distance(p, view.eye.xyz) * (1.0 - view.eye.w) + view.eye.w * 1.0;
  let n = normalize(vec3f(-wave_slope(p.xy, distance, abs(dir.z)), 1.0));
  let facing = max(dot(n, -dir), 0.0);
  let fresnel = 0.02 + 0.98 * pow(1.0 - facing, 5.0);
  var mirror = reflect(dir, n);
  mirror.z = abs(mirror.z);
  let light = sun_light() * max(view.sun.z, 0.0) / 3.14159265 + ambient_light(vec3f(0.0, 0.0, 1.0));
  let path = max(depth, 0.0) * (1.0 + 1.0 / max(facing, 0.25)) * 0.5 * clamp(4096.0 / view.size, 0.25, 4.0);
  let through = exp(-WATER_ABSORB * path);
  let body = WATER_SCATTER * light * (vec3f(1.0) - through) + bed * through;
  let half_way = normalize(view.sun.xyz - dir);
  let glitter = pow(max(dot(n, half_way), 0.0), 420.0) * 9.0 + pow(max(dot(n, half_way), 0.0), 60.0) * 0.25;
  var colour = body * (1.0 - fresnel) + (sky_colour(normalize(mirror)) + sun_light() * glitter) * fresnel;
  var hides = clamp(1.0 - (1.0 - fresnel) * dot(through, vec3f(0.2, 0.4, 0.4)), 0.0, 1.0);
  if (foam_noise.z > 0.0) {
    let band = depth / (0.0011 * view.size);
    let wash = 0.5 + 0.5 * sin(band * 9.0 - view.time * 1.1 + foam_noise.x * 9.0);
    let foam = (1.0 - smoothstep(0.0, 1.0, band)) * smoothstep(0.40, 0.72, foam_noise.y * 0.8 + wash * 0.25 + (1.0 - band) * 0.25);
    colour = mix(colour, vec3f(0.75) * light, foam * 0.75);
    hides = max(hides, foam * 0.75);
    hides *= smoothstep(0.0, 0.0002 * view.size, depth);
  }
  return vec4f(colour, hides);
}

// The root tile is the first to enter the atlas and never leaves.
const ROOT_SLOT: u32 = 0u;

// Distance outside the square of the domain.
fn outside_domain(p: vec2f) -> f32 {
  return length(max(max(-p, p - vec2f(view.size)), vec2f(0.0)));
}

// Depth of the sea outside the domain: the bed falls away from the border's height.
fn sea_depth(p: vec2f) -> f32 {
  let at = clamp(p / view.size, vec2f(0.0), vec2f(1.0)) * f32(TILE_CELLS);
  let i = min(vec2i(at), vec2i(TILE_CELLS - 1));
  let f = at - vec2f(i);
  let o = slot_origin(ROOT_SLOT) + i;
  let layer = slot_layer(ROOT_SLOT);
  let south = mix(textureLoad(heights, o, layer, 0).x, textureLoad(heights, o + vec2i(1, 0), layer, 0).x, f.x);
  let north = mix(textureLoad(heights, o + vec2i(0, 1), layer, 0).x, textureLoad(heights, o + vec2i(1, 1), layer, 0).x, f.x);
  return max(view.sea - mix(south, north, f.y), 0.0) + outside_domain(p) * 0.22;
}

fn sea_bed(p: vec2f) -> vec3f {
  let light = sun_light() * max(view.sun.z, 0.0) / 3.14159265 + ambient_light(vec3f(0.0, 0.0, 1.0));
  return vec3f(0.22, 0.17, 0.11) * light;
}

struct WaterVertex {
  @builtin(position) position: vec4f,
  @location(0) relative: vec3f,
  @location(1) depth: f32,
  @location(2) through: vec3f,
  @location(3) glow: vec3f,
};

@vertex
fn water_vertex(@builtin(vertex_index) index: u32, patch_in: PatchIn) -> WaterVertex {
  let v = patch_vertex(patch_in.record, vec2i(i32(index % PITCH), i32(index / PITCH)));
  let world = vec3f(v.world.xy, view.sea);
  let air = air_to(world);
  let relative = vec3f(v.relative.xy, (view.sea - view.eye.z) - view.eye_low.z);
  return WaterVertex(clip_of(relative), relative, view.sea - v.world.z, air.through, air.glow);
}

@fragment
fn water_fragment(v: WaterVertex) -> @location(0) vec4f {
  let f = Footprint(dpdx(v.relative), dpdy(v.relative));
  let world = v.relative + view.eye.xyz;
  if (v.depth < 0.0) { discard; }
  let a = ground_noise(world, f, 61.0, vec2f(0.9, 0.436));
  let b = ground_noise(world + vec3f(view.time * 0.8, 0.0, 0.0), f, 17.0, vec2f(0.6, -0.8));
  let dir = ray_to(world);
  let water = water_surface(world, dir, v.depth, vec3f(a.r, mix(a.g, b.g, 0.5), 1.0), vec3f(0.0));
  // Over the ground, the bed shows through by blending; its share was left out of the colour.
  let colour = water.rgb / max(water.a, 0.02) * v.through + v.glow;
  let shown = display(colour, v.position.xy);
  return vec4f(with_cursors(shown.rgb, world), water.a);
}

// The open sea near the domain, as geometry: it must hide the bed inside the domain where the sight enters outside it.
// Four quads around the square; further out the background shows the same.
struct OpenSeaVertex {
  @builtin(position) position: vec4f,
  @location(0) world: vec3f,
};

@vertex
fn open_sea_vertex(@builtin(vertex_index) index: u32) -> OpenSeaVertex {
  let corner = array<vec2f, 6>(vec2f(0.0, 0.0), vec2f(1.0, 0.0), vec2f(0.0, 1.0), vec2f(0.0, 1.0), vec2f(1.0, 0.0), vec2f(1.0, 1.0))[index % 6u];
  let far = 3.0;
  // Low and high corner of each quad, in sides of the domain: west, east, south, north.
  let low = array<vec2f, 4>(vec2f(-far, -far), vec2f(1.0, -far), vec2f(0.0, -far), vec2f(0.0, 1.0))[index / 6u];
  let high = array<vec2f, 4>(vec2f(0.0, 1.0 + far), vec2f(1.0 + far, 1.0 + far), vec2f(1.0, 0.0), vec2f(1.0, 1.0 + far))[index / 6u];
  let world = vec3f(mix(low, high, corner) * view.size, view.sea);
  return OpenSeaVertex(to_clip(world), world);
}

@fragment
fn open_sea_fragment(v: OpenSeaVertex) -> @location(0) vec4f {
  let dir = ray_to(v.world);
  let water = water_surface(v.world, dir, sea_depth(v.world.xy), vec3f(0.0), sea_bed(v.world.xy));
  let air = air_to(v.world);
  return display(water.rgb * air.through + air.glow, v.position.xy);
}
