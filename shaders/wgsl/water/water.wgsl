// The sea and lakes: absorption by depth, the bed through it where the bent sight meets it, waves, Fresnel reflection of sky
// and land, the sun's glitter, foam at the shore. Inside the domain water is drawn on the patches themselves, one level sheet
// each, so that its shore is exactly the ground's contour; outside the sea is part of the background. Both are opaque and
// use the same function, so that they meet without a step; only the last hand's breadth of water blends with the ground.

// Absorption per metre of clear water, and what it scatters back.
const WATER_ABSORB: vec3f = vec3f(0.210, 0.058, 0.046);
const WATER_SCATTER: vec3f = vec3f(0.008, 0.064, 0.080);
const WATER_INDEX: f32 = 1.33;

// The root tile is the first to enter the atlas and never leaves.
const ROOT_SLOT: u32 = 0u;

// `grazing`: sine of the angle between sight and surface; the footprint of a pixel grows as it shrinks.
fn wave_slope(p: vec2f, distance: f32, grazing: f32) -> vec2f {
  let lod = log2(max(distance * view.forward.w, 1.0e-3) * 256.0) - 0.8 * log2(max(grazing, 0.01));
  let drift = view.time * vec2f(0.6, 0.35);
  let a = textureSampleLevel(noise, smooth_repeat, (p + drift * 6.0) / 160.0, max(lod - log2(160.0), 0.0));
  let b = textureSampleLevel(noise, smooth_repeat, (p.yx * vec2f(1.0, -1.0) - drift * 3.0) / 47.0, max(lod - log2(47.0), 0.0));
  return noise_slope(a) * 0.022 + noise_slope(b).yx * 0.026 + small_waves(p, drift, lod);
}

// Distance outside the square of the domain.
fn outside_domain(p: vec2f) -> f32 {
  return length(max(max(-p, p - vec2f(view.size)), vec2f(0.0)));
}

// Ground of level 0 at a place of the domain (at its border, outside).
fn root_ground(p: vec2f) -> f32 {
  let at = clamp(p / view.size, vec2f(0.0), vec2f(1.0)) * f32(TILE_CELLS);
  let i = min(vec2i(at), vec2i(TILE_CELLS - 1));
  let f = at - vec2f(i);
  let o = slot_origin(ROOT_SLOT) + i;
  let layer = slot_layer(ROOT_SLOT);
  let south = mix(textureLoad(heights, o, layer, 0).x, textureLoad(heights, o + vec2i(1, 0), layer, 0).x, f.x);
  let north = mix(textureLoad(heights, o + vec2i(0, 1), layer, 0).x, textureLoad(heights, o + vec2i(1, 1), layer, 0).x, f.x);
  return mix(south, north, f.y);
}

// Depth of the sea outside the domain: the bed falls away from the border's height.
fn sea_depth(p: vec2f) -> f32 {
  return max(view.sea - root_ground(p), 0.0) + outside_domain(p) * 0.22;
}

// What ground looks like from afar, by height above the sea and slope.
fn far_albedo(height: f32, steep: f32) -> vec3f {
  let e = height / view.relief;
  let rocky = smoothstep(0.55, 0.95, steep);
  switch (view.look) {
    case LOOK_ALPINE: { return mix(vec3f(0.72, 0.75, 0.80), vec3f(0.14, 0.135, 0.135), smoothstep(0.75, 1.2, steep)); }
    case LOOK_DESERT: { return mix(vec3f(0.45, 0.30, 0.17), vec3f(0.35, 0.18, 0.10), rocky); }
    case LOOK_PAPER: { return vec3f(0.78, 0.70, 0.56); }
    default: {
      let green = mix(vec3f(0.34, 0.29, 0.20), mix(vec3f(0.060, 0.080, 0.028), vec3f(0.17, 0.155, 0.09), smoothstep(0.03, 0.12, e)), smoothstep(0.0, 0.004, e));
      return mix(mix(green, vec3f(0.165, 0.158, 0.148), rocky), vec3f(0.78, 0.81, 0.85), smoothstep(0.145, 0.175, e) * (1.0 - rocky));
    }
  }
}

// Lit ground of level 0 at a place.
fn far_ground(p: vec3f) -> vec3f {
  let uv = slot_uv(ROOT_SLOT, clamp(p.xy / view.size, vec2f(0.0), vec2f(1.0)) * f32(TILE_CELLS));
  let g = textureSampleLevel(slopes, smooth_clamp, uv, slot_layer(ROOT_SLOT), 0.0).xy;
  let l = textureSampleLevel(light, smooth_clamp, uv, slot_layer(ROOT_SLOT), 0.0);
  let n = normalize(vec3f(-g, 1.0));
  let lit = sun_light() * (max(dot(n, view.sun.xyz), 0.0) * l.x / 3.14159265) + ambient_light(n) * l.y;
  return far_albedo(p.z - view.sea, length(g)) * lit;
}

// Ground that water mirrors: lakes are too small for level 0.
fn mirror_ground(p: vec2f, inland: bool) -> f32 {
  if (inland) { return lake_ground(p); }
  return root_ground(p);
}

// What a mirror ray from the water sees: land, found by a march over coarse ground, else the sky. `steps` 0: the sky alone.
fn mirrored(p: vec3f, dir: vec3f, steps: i32, inland: bool) -> vec3f {
  let sky = sky_colour(dir);
  // The part of the ray over the domain and below its highest ground.
  let inverse = 1.0 / select(dir.xy, vec2f(1.0e-5), abs(dir.xy) < vec2f(1.0e-5));
  let a = -p.xy * inverse;
  let b = (vec2f(view.size) - p.xy) * inverse;
  let enter = max(max(min(a.x, b.x), min(a.y, b.y)), 0.0);
  let leave = min(min(max(a.x, b.x), max(a.y, b.y)), (view.high - p.z) / max(dir.z, 0.01));
  var cover = 0.0;
  var at = p;
  var before = 0.0;
  let count = select(0, steps, leave > enter);
  for (var i = 0; i < count; i += 1) {
    let part = f32(i + 1) / f32(steps);
    let t = enter + (leave - enter) * part * part;
    let q = p + dir * t;
    let above = mirror_ground(q.xy, inland) - q.z;
    if (above > 0.0) {
      // Between the last place above ground and this one.
      let back = (t - before) * above / (above + 0.25 * (t - before) + 1.0e-3);
      at = p + dir * (t - back);
      cover = smoothstep(0.0, 0.02 * t + 0.003 * view.size, above);
      if (cover > 0.99) { break; }
    }
    before = t;
  }
  if (cover <= 0.0) { return sky; }
  let air = exp(-view.haze * distance(at, p));
  return mix(sky, mix(haze_glow(dir), far_ground(vec3f(at.xy, max(at.z, p.z))), air), cover);
}

fn bed_albedo(steep: f32, grain: f32) -> vec3f {
  var sand = vec3f(0.40, 0.335, 0.225);
  if (view.look == LOOK_ALPINE) { sand = vec3f(0.34, 0.32, 0.29); }
  if (view.look == LOOK_DESERT) { sand = vec3f(0.48, 0.37, 0.23); }
  if (view.look == LOOK_PAPER) { sand = vec3f(0.60, 0.53, 0.42); }
  return mix(sand * vec3f(0.56, 0.53, 0.50), vec3f(0.095, 0.090, 0.082), smoothstep(0.40, 0.80, steep)) * (0.7 + 0.6 * grain);
}

struct Water {
  depth: f32,    // metres below the surface, of the bed that is seen
  shallow: f32,  // of the bed right below
  steep: f32,    // of the bed
  foam: f32,     // what the ground's channel says, 0..1
  noise: vec4f,  // two layers of ground noise, on the bed
  waves: f32,    // their height in that of the sea's
  inland: bool,  // a lake
};

// The surface's normal, waves and all.
fn water_normal(p: vec3f, dir: vec3f, waves: f32) -> vec3f {
  let away = distance(p, view.eye.xyz) * (1.0 - view.eye.w) + view.eye.w;
  return normalize(vec3f(-wave_slope(p.xy, away, abs(dir.z)) * waves, 1.0));
}

// Sight below the surface (Snell).
fn bent(dir: vec3f, n: vec3f) -> vec3f {
  let k = 1.0 / WATER_INDEX;
  let facing = clamp(dot(n, -dir), 0.0, 1.0);
  return k * dir + (k * facing - sqrt(1.0 - k * k * (1.0 - facing * facing))) * n;
}

// Colour of the water, not yet through the air.
fn water_surface(p: vec3f, dir: vec3f, n: vec3f, w: Water) -> vec3f {
  let facing = clamp(dot(n, -dir), 0.0, 1.0);
  let fresnel = 0.02 + 0.98 * pow(1.0 - facing, 5.0);
  let up = ambient_light(vec3f(0.0, 0.0, 1.0));
  let sun = sun_light() * max(view.sun.z, 0.0) / 3.14159265;

  // Down to the bed and back up: both ways are steeper in water.
  let scale = clamp(4096.0 / view.shore, 0.25, 4.0);
  let down = sqrt(1.0 - (1.0 - facing * facing) / (WATER_INDEX * WATER_INDEX));
  let sun_down = sqrt(1.0 - (1.0 - view.sun.z * view.sun.z) / (WATER_INDEX * WATER_INDEX));
  let depth = max(w.depth, 0.0) * scale;
  let seen = exp(-WATER_ABSORB * depth / down);
  let reached = exp(-WATER_ABSORB * depth / sun_down);
  // Waves gather the sun in a net of light on a shallow bed.
  let net = 1.0 + (pow(clamp(w.noise.g * 1.35, 0.0, 1.2), 4.0) - 0.45) * exp(-0.25 * depth) * smoothstep(0.0, 0.6, depth) * 0.9;
  let bed = bed_albedo(w.steep, w.noise.r) * (sun * reached * net + up * exp(-WATER_ABSORB * depth));
  let body = WATER_SCATTER * (sun + up) * (vec3f(1.0) - seen * reached);
  var mirror = reflect(dir, n);
  mirror.z = abs(mirror.z) + 0.002;
  let shown = mirrored(p, normalize(mirror), select(0, MIRROR_STEPS, fresnel > 0.03 && view.eye.w < 0.5), w.inland);
  let half_way = normalize(view.sun.xyz - dir);
  let glint = max(dot(n, half_way), 0.0);
  let glitter = pow(glint, 420.0) * 7.0 + pow(glint, 70.0) * 0.18;
  var colour = (bed * seen + body) * (1.0 - fresnel) + (shown + sun_light() * glitter) * fresnel;

  // Foam: lace where waves run out on the shore, more of it where the channel says so.
  let band = w.shallow / (0.0013 * view.shore * w.waves);
  let wash = 0.5 + 0.5 * sin(band * 10.0 - view.time * 1.1 + w.noise.z * 9.0);
  let reach = 1.0 - smoothstep(0.0, 0.7 + 0.9 * w.foam, band);
  let lace = smoothstep(0.46, 0.74, w.noise.w * 0.80 + wash * 0.22 + (1.0 - min(band, 1.0)) * 0.20 + (w.foam - 0.5) * 0.25);
  // Where the wind has little room, no lace but a rim of ripples.
  let white = clamp(reach * lace, 0.0, 1.0) * select(0.85, 0.5 * w.waves, w.inland);
  return mix(colour, vec3f(0.80) * (sun + up), white);
}

// The open sea: no waves break there.
fn open_water(p: vec3f, dir: vec3f) -> vec3f {
  let depth = sea_depth(p.xy);
  return water_surface(p, dir, water_normal(p, dir, 1.0), Water(depth, depth, 0.0, 0.0, vec4f(0.5, 0.5, 0.5, 0.0), 1.0, false));
}

struct WaterVertex {
  @builtin(position) position: vec4f,
  @location(0) relative: vec3f,
  @location(1) depth: f32,
  @location(2) through: vec3f,
  @location(3) glow: vec3f,
  @location(4) at: vec2f,
  @location(5) @interpolate(flat) record: vec4u,
  @location(6) @interpolate(flat) sheet: vec4f,
};

// `sheet`: level of the water now, metres; level that its lake is known by, NO_LAKE for the sea; height of its waves in that
// of the sea's.
@vertex
fn water_vertex(@builtin(vertex_index) index: u32, patch_in: PatchIn, @location(1) sheet: vec4f) -> WaterVertex {
  let v = patch_vertex(patch_in.record, vec2i(i32(index % PITCH), i32(index / PITCH)));
  let world = vec3f(v.world.xy, sheet.x);
  let air = air_to(world);
  let relative = vec3f(v.relative.xy, (sheet.x - view.eye.z) - view.eye_low.z);
  return WaterVertex(guarded(clip_of(relative)), relative, sheet.x - v.world.z, air.through, air.glow, v.at, patch_in.record, sheet);
}

// Foam of the ground's channel at a place of a patch.
fn shore_foam(record: vec4u, at: vec2f) -> f32 {
  let own = patch_slot(record);
  return textureSampleLevel(attributes0, smooth_clamp, slot_uv(own, at), slot_layer(own), 0.0).z;
}

@fragment
fn water_fragment(v: WaterVertex) -> @location(0) vec4f {
  let f = Footprint(dpdx(v.relative), dpdy(v.relative));
  let world = v.relative + view.eye.xyz;
  if (v.depth < 0.0) { discard; }
  let inland = v.sheet.y > NO_LAKE;
  let dir = ray_to(world);
  var within = view.size;
  if (inland) {
    within = inside_lake(world.xy, v.sheet.y);
    // An eye that has gone below a lake sees its bed.
    if (within <= 0.0 || dir.z > 0.0) { discard; }
  }
  let n = water_normal(world, dir, v.sheet.z);
  // The bed that is seen lies further on, where the bent sight meets its slope.
  let own = patch_slot(v.record);
  let bed = textureSampleLevel(slopes, smooth_clamp, slot_uv(own, v.at), slot_layer(own), 0.0).xy;
  let below = bent(dir, n);
  let along = below.xy / max(-below.z, 0.2);
  let seen = v.depth / clamp(1.0 + dot(bed, along), 0.5, 3.0);
  let place = world + vec3f(along, -1.0) * seen;
  let a = ground_noise(place, f, 61.0, vec2f(0.9, 0.436));
  let b = ground_noise(place + vec3f(view.time * 0.8, 0.0, 0.0), f, 17.0, vec2f(0.6, -0.8));
  // Towards the domain's border the water becomes the open sea's.
  let border = min(min(world.x, world.y), min(view.size - world.x, view.size - world.y));
  let inner = select(smoothstep(0.0, 0.04 * view.size, border), 1.0, inland);
  let open = sea_depth(world.xy);
  let noises = mix(vec4f(0.5, 0.5, 0.5, 0.0), vec4f(a.r, b.g, a.r, mix(a.g, b.g, 0.5)), inner);
  let w = Water(mix(open, seen, inner), mix(open, v.depth, inner), length(bed) * inner, shore_foam(v.record, v.at), noises, v.sheet.z, inland);
  let water = water_surface(world, dir, n, w);
  let shown = display(water * v.through + v.glow, v.position.xy);
  let edge = smoothstep(0.0, 0.00012 * view.shore, min(v.depth, within));
  return vec4f(with_cursors(shown.rgb, world), edge);
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
  // A little into the domain, where water looks the same: edges of many vertices leave gaps beside an edge of two.
  let lap = 0.001;
  // Low and high corner of each quad, in sides of the domain: west, east, south, north.
  let low = array<vec2f, 4>(vec2f(-far, -far), vec2f(1.0 - lap, -far), vec2f(0.0, -far), vec2f(0.0, 1.0 - lap))[index / 6u];
  let high = array<vec2f, 4>(vec2f(lap, 1.0 + far), vec2f(1.0 + far, 1.0 + far), vec2f(1.0, lap), vec2f(1.0, 1.0 + far))[index / 6u];
  let world = vec3f(mix(low, high, corner) * view.size, view.sea);
  return OpenSeaVertex(to_clip(world), world);
}

@fragment
fn open_sea_fragment(v: OpenSeaVertex) -> @location(0) vec4f {
  let dir = ray_to(v.world);
  let air = air_to(v.world);
  return display(open_water(v.world, dir) * air.through + air.glow, v.position.xy);
}
