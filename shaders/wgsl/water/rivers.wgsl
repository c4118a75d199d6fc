// Rivers on the ground (docs/water.md): `river_map` holds, for each cell of lattices over the domain, the pieces of rivers that
// reach into it (frontend/src/tiles/water/rivermap.ts). The ground around a place finds the piece that is nearest, and
// with it a bed, wet banks, greener ground and the water itself. Where pixels are larger a coarser lattice is read, whose
// pieces reach further: a thin river is drawn wider there.
const RIVER_CELLS: i32 = 128;    // of the finest lattice, along a side; each further one has half as many
const RIVER_LATTICES: i32 = 5;
const RIVER_COLUMNS: i32 = 256;  // texels in a row of the map
const RIVER_REACH: f32 = 0.25;   // pieces are listed so many cells beyond their banks
const FAR_RIVER: f32 = 1.0e6;
// Half the least width of a river, and half of how softly its edge ends, pixels.
const LEAST_HALF_PX: f32 = 0.9;
const SOFT_PX: f32 = 0.6;
// A river that is drawn wider than it is shows this power of its share of that width.
const THIN_POWER: f32 = 0.25;
// Metres of depth at a width of 2.7 m, a little more than by the formula: what is not seen is not cut.
const BED_SHARE: f32 = 0.55;
const FAR_BED: f32 = 1500.0;

struct River {
  beyond: f32,     // metres from the water's edge to the place, below zero in the water
  half: f32,       // half the width of the water, metres
  along: f32,      // metres down the river
  across: f32,     // metres from its middle, to the left
  dir: vec2f,      // downstream
  out: vec2f,      // away from its middle
  share: f32,      // how far it is shown while rivers change
  pixel: f32,      // metres that a pixel covers across the river
  cover: f32,      // how much of the pixel its water covers
};

struct RiverList {
  first: i32,      // texel of its first piece
  count: i32,
  reach: f32,      // metres beyond their banks to which its pieces are whole
};

fn river_texel(k: i32) -> vec4f {
  return textureLoad(river_map, vec2i(k % RIVER_COLUMNS, k / RIVER_COLUMNS), 0);
}

// The pieces near a place, of the finest lattice in which they reach as far as pixels of `pixel` metres ask.
fn river_list(p: vec2f, pixel: f32) -> RiverList {
  var cells = RIVER_CELLS;
  var first = 0;
  for (var k = 1; k < RIVER_LATTICES; k += 1) {
    if ((LEAST_HALF_PX + SOFT_PX) * pixel <= RIVER_REACH * view.size / f32(cells)) { break; }
    first += cells * cells;
    cells = cells / 2;
  }
  let cell = clamp(vec2i(p / view.size * f32(cells)), vec2i(0), vec2i(cells - 1));
  let list = river_texel(first + cell.y * cells + cell.x);
  return RiverList(i32(list.x), i32(list.y), RIVER_REACH * view.size / f32(cells));
}

// The river that covers most of a place, else the one whose water is nearest. Of rivers that fade into each other the one that
// is seen more counts, so that a line stays whole.
fn river_near(p: vec2f, f: Footprint) -> River {
  var r = River(FAR_RIVER, 1.0, 0.0, 0.0, vec2f(1.0, 0.0), vec2f(0.0, 1.0), 0.0, 1.0, 0.0);
  if (view.has_rivers < 0.5) { return r; }
  let list = river_list(p, length(vec2f(length(f.dx.xy), length(f.dy.xy))));
  let widest = list.reach * (LEAST_HALF_PX / (LEAST_HALF_PX + SOFT_PX));
  for (var k = 0; k < list.count; k += 1) {
    let ends = river_texel(list.first + 2 * k);
    let more = river_texel(list.first + 2 * k + 1);
    let run = ends.zw - ends.xy;
    let length_m = max(length(run), 1.0e-4);
    let dir = run / length_m;
    let t = clamp(dot(p - ends.xy, dir), 0.0, length_m);
    let offset = p - (ends.xy + dir * t);
    let away = length(offset);
    let left = vec2f(-dir.y, dir.x);
    let pixel = min(length(vec2f(dot(f.dx.xy, left), dot(f.dy.xy, left))), widest / LEAST_HALF_PX);
    let half = mix(more.x, more.y, t / length_m);
    let drawn = max(half, LEAST_HALF_PX * pixel);
    let soft = max(SOFT_PX * pixel, 0.12 * half);
    let cover = (1.0 - smoothstep(-soft, soft, away - drawn)) * pow(half / drawn, THIN_POWER) * more.w;
    if (cover > r.cover + 1.0e-3 || (cover >= r.cover - 1.0e-3 && away - half < r.beyond)) {
      let out = select(left, offset / max(away, 1.0e-4), away > 1.0e-3);
      r = River(away - half, half, more.z + t, dot(offset, left), dir, out, more.w, pixel, cover);
    }
  }
  return r;
}

// How far the bed of a river lies below the ground at a place, `away` metres from the eye: depth of full banks by the width (Bieger
// et al. 2015). A function of the place and the eye alone, so that patches meet. Far off, where vertices are wider apart than
// the bed, it is not cut; at the domain's border it runs out, as walls stand there.
fn river_bed(p: vec2f, away: f32) -> f32 {
  if (view.has_rivers < 0.5 || view.eye.w > 0.5 || away > FAR_BED) { return 0.0; }
  let r = river_near(p, Footprint(vec3f(0.0), vec3f(0.0)));
  let depth = BED_SHARE * pow(2.0 * r.half / 2.7, 0.605) * r.share;
  let cut = 1.0 - smoothstep(-0.7 * r.half, 0.8 * r.half + 0.8, r.beyond);
  let near = 1.0 - smoothstep(50.0 * r.half, 130.0 * r.half, away);
  let border = min(min(p.x, p.y), min(view.size - p.x, view.size - p.y));
  return depth * cut * near * smoothstep(0.0, 0.004 * view.size, border);
}

// The bed that the river has cut: its banks fall towards the water, and the ground beside it is wet, further out greener.
fn river_banks(m: Material, r: River, s: Site) -> Material {
  if (r.share <= 0.0 || r.beyond > 5.0 * r.half + 8.0 || view.look == LOOK_PAPER) { return m; }
  let width = 2.0 * r.half;
  let lod = max(log2(s.footprint * 12.0), 0.0);
  let rough = textureSampleLevel(noise, smooth_repeat, s.p.xy / 21.0, lod);
  let wander = (rough.r - 0.5) * 1.4;
  let reach = max(r.beyond, 0.0) / (0.6 * width + 1.0);
  let cut = (1.0 - smoothstep(0.0, 1.0, reach)) * smoothstep(-0.6 * r.half, 0.1 * r.half, r.beyond);
  let wet = (1.0 - smoothstep(0.1, 0.9, reach + 0.5 * wander)) * r.share;
  let lush = (1.0 - smoothstep(0.3, 2.6, reach + wander)) * r.share * (1.0 - smoothstep(0.5, 0.9, s.steep)) * (1.0 - s.cover.snow);
  var green = m;
  green.albedo = mix(m.albedo, m.albedo * vec3f(0.62, 0.86, 0.50) + vec3f(0.002, 0.012, 0.001), select(0.48, 0.30, view.look == LOOK_DESERT) * lush);
  var out = soaked(green, 0.85 * wet);
  // Stones lie bare where the water stands higher at times.
  let stones = (1.0 - smoothstep(0.05, 0.30, reach + 0.35 * wander)) * r.share;
  out.albedo = mix(out.albedo, vec3f(0.120, 0.113, 0.102) * (0.6 + 0.8 * rough.g), 0.6 * stones);
  out.relief += vec3f(r.out * (0.55 * cut * r.share), 0.0);
  return out;
}

// How much of the pixel the water covers: it ends in lakes and the sea, of which `above` is the height.
fn river_cover(r: River, above: f32) -> f32 {
  return r.cover * smoothstep(-0.4, 0.3, above);
}

// The water of a river over lit ground: sky on ripples that run with it, a bed seen through it, white where it is steep.
fn river_water(colour: vec3f, r: River, s: Site, surface: Surface, dir: vec3f, above: f32) -> vec3f {
  let cover = river_cover(r, above);
  if (cover <= 0.002) { return colour; }
  let steep = clamp(-dot(surface.gradient, r.dir), 0.0, 1.5);
  let fast = 0.6 + 3.0 * sqrt(steep);
  let flow = vec2f(r.along - view.time * fast, r.across) / (3.0 * r.half + 2.0);
  let lod = max(log2(s.footprint / (3.0 * r.half + 2.0) * 256.0), 0.0);
  let a = textureSampleLevel(noise, smooth_repeat, flow * vec2f(0.22, 0.5), max(lod - 1.5, 0.0));
  let b = textureSampleLevel(noise, smooth_repeat, flow.yx * vec2f(0.9, 0.55) + vec2f(0.37, 0.0), max(lod - 0.5, 0.0));
  let ripple = noise_slope(a) * 0.05 + noise_slope(b) * 0.03;
  let n = normalize(vec3f(-(ripple.x * r.dir + ripple.y * vec2f(-r.dir.y, r.dir.x)) * (0.5 + steep) - 0.35 * surface.gradient, 1.0));
  let facing = clamp(dot(n, -dir), 0.0, 1.0);
  let fresnel = 0.02 + 0.98 * pow(1.0 - facing, 5.0);
  var mirror = reflect(dir, n);
  mirror.z = abs(mirror.z) + 0.02;
  let up = ambient_light(vec3f(0.0, 0.0, 1.0)) * surface.sky;
  let sun = sun_light() * (surface.sun * max(view.sun.z, 0.0) / 3.14159265);
  // Deeper in the middle, and where the river is wide.
  let depth = clamp(-r.beyond / r.half, 0.0, 1.0) * clamp(0.35 + 0.12 * r.half, 0.0, 1.0);
  let near_bed = mix(vec3f(0.15, 0.135, 0.105), vec3f(0.030, 0.072, 0.082), 0.35 + 0.6 * depth);
  // What is a few pixels wide is the blue of a map more than what lies in it.
  let far = smoothstep(0.12, 0.6, r.pixel / r.half);
  let bed = mix(near_bed, vec3f(0.050, 0.165, 0.290), 0.85 * far);
  let half_way = normalize(view.sun.xyz - dir);
  let glint = pow(max(dot(n, half_way), 0.0), 160.0) * 1.6;
  var water = bed * (sun + up) * (1.0 - fresnel) + (sky_colour(normalize(mirror)) * (0.35 + 0.65 * surface.sky) + sun_light() * surface.sun * glint) * fresnel;
  let lace = smoothstep(0.40, 0.72, 0.60 * b.g + 0.45 * a.r + 0.12 * (1.0 - depth));
  let white = smoothstep(0.12, 0.60, steep) * mix(lace, 0.28, far);
  water = mix(water, vec3f(0.78) * (sun + up), 0.85 * white);
  if (view.look == LOOK_PAPER) { water = vec3f(0.16, 0.36, 0.55) * (sun + up); }
  return mix(colour, water, cover);
}
