// Trees, rocks and tufts: their meshes are made from the vertex's number, so there is none to load.
struct InstanceIn {
  @location(0) place: vec4f,   // its foot relative to the eye; height, metres
  @location(1) own: vec4f,     // turn and hue, 0..1; sun and sky that reach it
  @location(2) ground: vec4f,  // gradient of the ground, snow; share of it that is drawn (trees), grass around it
};

struct InstanceVertex {
  @builtin(position) position: vec4f,
  @location(0) normal: vec3f,
  @location(1) albedo: vec3f,
  @location(2) grown: vec3f,     // where on it: along and across; height, 0..1
  @location(3) @interpolate(flat) own: vec4f,
  @location(4) @interpolate(flat) drawn: f32,
  @location(5) relative: vec3f,
};

fn own_hash(seed: f32, k: f32) -> f32 {
  return fract(sin(seed * 917.13 + k * 12.9898) * 43758.547);
}

fn instance_vertex(i: InstanceIn, offset: vec3f, normal: vec3f, albedo: vec3f, grown: vec3f, drawn: f32) -> InstanceVertex {
  let relative = i.place.xyz + offset;
  return InstanceVertex(guarded(clip_of(relative)), normal, albedo, grown, i.own, drawn, relative);
}

// --- trees

const TIERS: u32 = 6u;
const SIDES: u32 = 8u;
// Corner of a quad of two triangles.
const CORNERS: array<vec2f, 6> = array<vec2f, 6>(
  vec2f(0.0, 0.0), vec2f(1.0, 0.0), vec2f(0.0, 1.0), vec2f(0.0, 1.0), vec2f(1.0, 0.0), vec2f(1.0, 1.0));

// Conifers, and low down and in hollows broad crowns among them.
fn is_broad(own: vec4f) -> bool {
  return view.look == LOOK_DESERT || (view.look == LOOK_NATURAL && own.y > 0.84);
}

// Radius of a crown at a share of its height, in its height.
fn crown_radius(t: f32, broad: bool) -> f32 {
  if (broad) {
    let u = (t - 0.18) / 0.82;
    return 0.42 * sqrt(max(u * (1.0 - u) * 4.0, 0.0)) * (0.8 + 0.2 * (1.0 - u));
  }
  let u = clamp((t - 0.08) / 0.92, 0.0, 1.0);
  let tier = fract(u * 5.0);
  return 0.21 * (1.0 - u) * (1.16 - 0.50 * tier) + 0.008;
}

fn tree_colour(own: vec4f, t: f32, snow: f32) -> vec3f {
  let a = vec3f(0.016, 0.034, 0.014);
  let b = vec3f(0.040, 0.056, 0.018);
  var colour = mix(a, b, fract(own.y * 5.0)) * (0.55 + 0.75 * t);
  if (is_broad(own)) { colour = mix(vec3f(0.026, 0.046, 0.014), vec3f(0.056, 0.066, 0.020), fract(own.y * 9.0)) * (0.50 + 0.65 * t); }
  if (view.look == LOOK_DESERT) { colour = vec3f(0.075, 0.078, 0.038) * (0.6 + 0.6 * t); }
  if (view.look == LOOK_ALPINE) { colour = mix(colour * 0.8, vec3f(0.66, 0.70, 0.75), (0.15 + 0.55 * t) * max(snow, 0.4) * 0.7); }
  return colour;
}

@vertex
fn tree_vertex(@builtin(vertex_index) index: u32, i: InstanceIn) -> InstanceVertex {
  let quad = index / 6u;
  let corner = CORNERS[index % 6u];
  let broad = is_broad(i.own);
  // The last sides are the trunk.
  let tier = quad / SIDES;
  let side = f32(quad % SIDES) + corner.x;
  let angle = (side / f32(SIDES) + i.own.x) * 6.2831853 + 0.5 * f32(tier);
  let way = vec2f(cos(angle), sin(angle));
  let height = i.place.w;
  if (tier == TIERS) {
    let t = corner.y * 0.3;
    let r = 0.022 * (1.0 - t);
    return instance_vertex(i, vec3f(way * r, t - 0.03) * height, vec3f(way, 0.2), vec3f(0.060, 0.044, 0.032), vec3f(side, -1.0, 0.5 * t), i.ground.w);
  }
  let low = select(0.09 + 0.91 * f32(tier) / f32(TIERS), 0.18 + 0.82 * f32(tier) / f32(TIERS), broad);
  let high = select(0.09 + 0.91 * (f32(tier) + 1.25) / f32(TIERS), 0.18 + 0.82 * (f32(tier) + 1.0) / f32(TIERS), broad);
  let t = min(mix(low, high, corner.y), 1.0);
  var r = crown_radius(t, true);
  if (!broad) { r = select(0.22 * (1.0 - low) + 0.012, 0.05 * (1.0 - high), corner.y > 0.5); }
  let uneven = select(0.72, 0.62, broad) + select(0.56, 0.72, broad) * own_hash(i.own.x, floor(side + 0.5) % f32(SIDES) + 7.0 * select(f32(tier), f32(tier) + corner.y, broad));
  let lean = (vec2f(own_hash(i.own.x, 31.0), own_hash(i.own.x, 37.0)) - 0.5) * 0.10 * t;
  let droop = select(-0.03 * (uneven - 1.0), 0.0, broad) * (1.0 - corner.y);
  let normal = normalize(vec3f(way, select(0.55, (t - 0.55) * 2.2, broad)));
  let offset = vec3f(way * max(r, 0.0) * uneven + lean, t + droop) * height;
  // Dark inside, where tiers overlap.
  let inner = mix(1.0, select(0.55, 0.9, broad), corner.y);
  return instance_vertex(i, offset, normal, tree_colour(i.own, t, i.ground.z) * inner, vec3f(side, corner.y, t), i.ground.w);
}

// A tree far away: a board that turns to the eye, cut out along the crown's outline.
@vertex
fn impostor_vertex(@builtin(vertex_index) index: u32, i: InstanceIn) -> InstanceVertex {
  let corner = CORNERS[index % 6u];
  let away = i.place.xy;
  let side = normalize(vec2f(-away.y, away.x) + vec2f(1.0e-6));
  let u = corner.x * 2.0 - 1.0;
  let offset = vec3f(side * (u * 0.44), corner.y) * i.place.w;
  return instance_vertex(i, offset, vec3f(side, 0.0), vec3f(0.0), vec3f(u, corner.y, i.ground.z), i.ground.w);
}

// --- rocks

// Faces of an octahedron, each cut in four.
fn octahedron(index: u32) -> vec3f {
  let face = index / 12u;
  let part = (index / 3u) % 4u;
  let corner = index % 3u;
  let s = vec3f(select(1.0, -1.0, (face & 1u) != 0u), select(1.0, -1.0, (face & 2u) != 0u), select(1.0, -1.0, (face & 4u) != 0u));
  let corners = array<vec3f, 3>(vec3f(s.x, 0.0, 0.0), vec3f(0.0, s.y, 0.0), vec3f(0.0, 0.0, s.z));
  let here = corners[corner];
  if (part < 3u) { return normalize(corners[part] + here); }
  return normalize(corners[corner] + corners[(corner + 1u) % 3u]);
}

fn stone_colour(own: vec4f) -> vec3f {
  var colour = vec3f(0.215, 0.208, 0.198);
  if (view.look == LOOK_ALPINE) { colour = vec3f(0.155, 0.152, 0.150); }
  if (view.look == LOOK_DESERT) { colour = vec3f(0.40, 0.235, 0.140); }
  let hue = mix(vec3f(1.08, 0.99, 0.90), vec3f(0.94, 1.0, 1.06), own.y);
  return colour * hue * (0.7 + 0.6 * fract(own.y * 11.0));
}

@vertex
fn rock_vertex(@builtin(vertex_index) index: u32, i: InstanceIn) -> InstanceVertex {
  let d = octahedron(index);
  // Cut by a few planes: corners of stone, not a ball.
  var r = 1.0;
  for (var k = 0; k < 7; k += 1) {
    let f = f32(k);
    let n = normalize(vec3f(own_hash(i.own.x, f), own_hash(i.own.x, f + 11.0), own_hash(i.own.x, f + 23.0)) * 2.0 - 1.0);
    let off = 0.42 + 0.42 * own_hash(i.own.x, f + 41.0);
    r = min(r, off / max(dot(d, n), 0.05));
  }
  let a = i.own.x * 6.2831853;
  let shape = vec3f(0.62 + 0.5 * i.own.y, 0.75, 0.50 + 0.25 * fract(i.own.y * 5.0));
  let q = d * r * shape;
  let spun = vec3f(q.x * cos(a) - q.y * sin(a), q.x * sin(a) + q.y * cos(a), q.z);
  // Lies on the slope and in it.
  let up = normalize(vec3f(-i.ground.xy, 1.0));
  let laid = spun + vec3f(0.0, 0.0, dot(spun.xy, i.ground.xy) * 0.8) + up * 0.10;
  return instance_vertex(i, laid * i.place.w, d, stone_colour(i.own), spun * i.place.w, 1.0);
}

// --- tufts

const BLADES: u32 = 15u;

@vertex
fn tuft_vertex(@builtin(vertex_index) index: u32, i: InstanceIn) -> InstanceVertex {
  let blade = f32(index / 3u);
  let corner = index % 3u;
  let a = (blade / f32(BLADES) + i.own.x) * 6.2831853 + own_hash(i.own.x, blade) * 1.1;
  let way = vec2f(cos(a), sin(a));
  let lean = 0.25 + 0.75 * own_hash(i.own.x, blade + 17.0);
  let high = 0.55 + 0.45 * own_hash(i.own.x, blade + 29.0);
  let root = way * (0.10 + 0.25 * own_hash(i.own.x, blade + 3.0));
  var offset = vec3f(root, -0.04);
  var t = 0.0;
  if (corner == 2u) {
    offset = vec3f(root + way * lean * 0.7, high);
    t = 1.0;
  } else {
    offset += vec3f(vec2f(-way.y, way.x) * select(0.034, -0.034, corner == 1u), 0.0);
  }
  offset.z += dot(offset.xy, i.ground.xy);
  var colour = mix(vec3f(0.058, 0.082, 0.026), vec3f(0.160, 0.140, 0.064), clamp(fract(i.own.y * 3.0) * 0.75 + 0.25 * (own_hash(i.own.x, blade + 5.0) - 0.5), 0.0, 1.0));
  if (view.look == LOOK_DESERT) { colour = mix(vec3f(0.150, 0.128, 0.070), vec3f(0.245, 0.200, 0.110), own_hash(i.own.x, blade)); }
  if (view.look == LOOK_ALPINE) { colour = mix(vec3f(0.135, 0.112, 0.066), vec3f(0.210, 0.172, 0.105), own_hash(i.own.x, blade)); }
  // Here and there something flowers.
  let flower = step(0.965, i.own.y) * t * f32(view.look == LOOK_NATURAL);
  colour = mix(colour * (0.32 + 0.85 * t), mix(vec3f(0.75, 0.70, 0.62), vec3f(0.70, 0.52, 0.06), step(0.5, fract(i.own.x * 7.0))), flower);
  return instance_vertex(i, offset * i.place.w, normalize(vec3f(way * 0.45 - i.ground.xy * 0.5, 1.0)), colour, vec3f(0.0, t, t), 1.0);
}

// --- light

// 1 where a pixel belongs to the part that is drawn: what leaves and what comes share the pixels between them.
fn dissolved(pixel: vec2f, share: f32, comes: bool) -> bool {
  let at = fract(52.9829189 * fract(dot(floor(pixel), vec2f(0.06711056, 0.00583715))));
  return select(at >= share, at < 1.0 - share, comes);
}

fn lit_instance(albedo: vec3f, n: vec3f, own: vec4f, soft: f32, open: f32, relative: vec3f, pixel: vec2f) -> vec4f {
  let turned_to = dot(n, view.sun.xyz);
  let facing = max((turned_to + soft) / (1.0 + soft), 0.0);
  let sun = sun_light() * (facing * own.z / 3.14159265);
  let above = ambient_light(n);
  let sky = mix(above, vec3f(dot(above, vec3f(0.2126, 0.7152, 0.0722))), 0.25) * (1.35 * mix(1.0, own.w * open, view.shade));
  let world = relative + view.eye.xyz;
  let air = air_to(world);
  let shown = display(albedo * (sun + sky) * air.through + air.glow, pixel);
  return vec4f(with_cursors(shown.rgb, world), 1.0);
}

@fragment
fn tree_fragment(v: InstanceVertex) -> @location(0) vec4f {
  if (dissolved(v.position.xy, v.drawn, false)) { discard; }
  let broad = is_broad(v.own);
  // Boughs: some for each side, drawn out from the trunk; they end at their own lengths, and light shows between them.
  let along = select(vec2f(v.grown.x * 0.31, v.grown.y * 0.045), vec2f(v.grown.x * 0.11, v.grown.z * 0.55), broad) + v.own.xy * vec2f(3.0, 5.0);
  let bough = textureSampleLevel(noise, smooth_repeat, along, 0.5);
  let leaf = textureSampleLevel(noise, smooth_repeat, along * select(vec2f(2.3, 6.0), vec2f(4.1), broad) + 0.3, 0.0);
  let bark = v.grown.y < 0.0;
  let edge = abs(dot(normalize(v.normal), normalize(v.relative)));
  let lace = select(bough.r * 0.75 + leaf.r * 0.35 - 0.34 * (1.0 - smoothstep(0.0, 0.55, v.grown.y)), bough.r * 0.5 + leaf.r * 0.4 - 0.30 * (1.0 - smoothstep(0.1, 0.75, edge)) + 0.10, broad);
  if (!bark && lace < 0.30) { discard; }
  let n = normalize(v.normal + vec3f(noise_slope(leaf) * 0.30, 0.35 * (leaf.r - 0.5)));
  let tone = select(0.30 + 0.80 * bough.r + 0.55 * leaf.r, 1.0, bark);
  return lit_instance(v.albedo * tone, n, v.own, 0.35, mix(0.45, 1.0, v.grown.z), v.relative, v.position.xy);
}

@fragment
fn impostor_fragment(v: InstanceVertex) -> @location(0) vec4f {
  if (dissolved(v.position.xy, v.drawn, true)) { discard; }
  let t = v.grown.y;
  let u = v.grown.x * 0.44;
  let ragged = textureSampleLevel(noise, smooth_repeat, vec2f(u * 2.3, t * 1.9) + v.own.xy * 7.0, 1.0);
  let r = crown_radius(t, is_broad(v.own)) * (0.72 + 0.55 * ragged.r);
  let trunk = abs(u) < 0.016 && t < 0.2;
  if (abs(u) > r && !trunk) { discard; }
  let x = clamp(u / max(r, 0.01), -1.0, 1.0);
  let toward = -normalize(vec3f(v.relative.xy, 0.0) + vec3f(1.0e-6, 0.0, 0.0));
  let n = normalize(v.normal * x + toward * sqrt(1.0 - x * x) + vec3f(0.0, 0.0, 0.55));
  return lit_instance(tree_colour(v.own, t, v.grown.z) * (0.45 + 1.0 * ragged.g), n, v.own, 0.35, mix(0.45, 1.0, t), v.relative, v.position.xy);
}

@fragment
fn rock_fragment(v: InstanceVertex) -> @location(0) vec4f {
  let dx = dpdx(v.relative);
  let dy = dpdy(v.relative);
  // Facets, a little rounded, and rough.
  var face = normalize(cross(dx, dy));
  if (dot(face, v.relative) > 0.0) { face = -face; }
  let grain = textureSampleLevel(noise, smooth_repeat, v.grown.xy * 0.9 + v.grown.zx * 0.7 + v.own.xy, 0.5);
  let fine = textureSampleLevel(noise, smooth_repeat, v.grown.yz * 4.1 + v.grown.xz * 3.3, 1.0);
  let n = normalize(face + vec3f(noise_slope(grain), 0.0) * 0.16 + vec3f(noise_slope(fine) * 0.14, 0.0));
  var albedo = v.albedo * (0.55 + 0.5 * grain.r + 0.45 * fine.r);
  let lichen = smoothstep(0.60, 0.72, grain.g) * f32(view.look == LOOK_NATURAL);
  albedo = mix(albedo, vec3f(0.235, 0.225, 0.105), 0.45 * lichen);
  // Snow on what faces up, in winter.
  if (view.look == LOOK_ALPINE) { albedo = mix(albedo, vec3f(0.78, 0.81, 0.86), smoothstep(0.55, 0.80, face.z + 0.3 * (grain.r - 0.5))); }
  let foot = smoothstep(-0.25, 0.35, v.grown.z / max(length(v.grown), 0.05));
  return lit_instance(albedo, n, v.own, 0.0, mix(0.4, 1.0, foot), v.relative, v.position.xy);
}

@fragment
fn tuft_fragment(v: InstanceVertex) -> @location(0) vec4f {
  return lit_instance(v.albedo, normalize(v.normal), v.own, 0.45, mix(0.35, 1.0, v.grown.z), v.relative, v.position.xy);
}
