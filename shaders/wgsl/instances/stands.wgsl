// Where trees, rocks and tufts stand: a pure function of the place on the ground, so that everybody sees the same ones and
// they stay as the eye moves and as tiles refine. The plane is cut into square cells for each kind; a cell's hash says where
// in it one may stand, how large it is, and how much must grow there for it to stand. (docs/renderer.md, "Instances";
// twin: backend/esker/render/stands.py.)
const KIND_TREE: u32 = 0u;
const KIND_ROCK: u32 = 1u;
const KIND_TUFT: u32 = 2u;
const KINDS: u32 = 3u;

// Side of a cell, metres.
fn cell_of_kind(kind: u32) -> f32 {
  return array<f32, 3>(6.5, 4.0, 0.32)[kind];
}

// Metres beyond which none is drawn.
fn reach_of_kind(kind: u32) -> f32 {
  return array<f32, 3>(1600.0, 260.0, 28.0)[kind];
}

// The hash of the noise textures (gpu/synthesis/noise.ts).
fn stand_hash(i: vec2i, seed: u32) -> u32 {
  let u = bitcast<vec2u>(i);
  var h = (u.x * 0x27d4eb2du) ^ (u.y * 0x165667b1u) ^ (seed * 0x9e3779b1u);
  h = (h ^ (h >> 15u)) * 0x85ebca6bu;
  h = (h ^ (h >> 13u)) * 0xc2b2ae35u;
  return h ^ (h >> 16u);
}

struct Stand {
  at: vec2f,      // in its cell, 0..1
  least: f32,     // it stands where the kind's density is at least this
  size: f32,      // 0 small, 1 large
  turn: f32,      // 0..1
  hue: f32,       // 0..1
};

fn stand_of(cell: vec2i, kind: u32) -> Stand {
  let a = stand_hash(cell, 3u * kind + 501u);
  let b = stand_hash(cell, 3u * kind + 502u);
  let c = stand_hash(cell, 3u * kind + 503u);
  let k = 1.0 / 65536.0;
  // A little room between neighbours.
  let at = 0.06 + 0.88 * vec2f(f32(a & 0xffffu), f32(a >> 16u)) * k;
  return Stand(at, f32(b & 0xffffu) * k, f32(b >> 16u) * k, f32(c & 0xffffu) * k, f32(c >> 16u) * k);
}

// What the ground offers at a place.
struct Soil {
  grass: f32,
  forest: f32,
  snow: f32,
  wet: f32,
  smoothness: f32,
  steep: f32,     // tangent of the slope
  height: f32,    // above the sea or zero, as a fraction of the relief
  woods: f32,     // broad noise, 0..1: where woods stand that no channel tells of
};

fn ramp(low: f32, high: f32, x: f32) -> f32 {
  let t = clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// Share of the cells of a kind in which one stands.
fn density(kind: u32, look: u32, s: Soil) -> f32 {
  if (look == LOOK_PAPER) { return 0.0; }
  let bare = 1.0 - ramp(0.25, 0.75, s.snow);
  if (kind == KIND_TREE) {
    let level = 1.0 - ramp(0.75, 1.15, s.steep);
    if (look == LOOK_ALPINE) {
      return level * max(ramp(0.52, 0.64, s.woods) * (1.0 - ramp(0.036, 0.060, s.height)), ramp(0.30, 0.70, s.forest)) * 0.9;
    }
    if (look == LOOK_DESERT) { return level * bare * (0.5 * ramp(0.35, 0.8, s.forest) + 0.02 * s.grass + 0.10 * ramp(0.4, 0.8, s.wet)); }
    return level * bare * (0.94 * ramp(0.28, 0.72, s.forest) + 0.012 * s.grass * ramp(0.05, 0.3, s.forest + 0.06));
  }
  if (kind == KIND_ROCK) {
    let slopes = ramp(0.30, 0.75, s.steep) * (1.0 - ramp(1.0, 1.5, s.steep));
    let rough = 1.0 - ramp(0.30, 0.60, s.smoothness);
    let strewn = 0.035 + 0.32 * slopes + 0.10 * rough;
    return strewn * (1.0 - 0.6 * s.forest) * mix(1.0, 0.45, ramp(0.5, 0.9, s.snow));
  }
  let gentle = 1.0 - ramp(0.85, 1.25, s.steep);
  if (look == LOOK_DESERT) { return gentle * bare * (0.05 + 0.45 * s.grass + 0.22 * ramp(0.50, 0.62, s.woods)); }
  if (look == LOOK_ALPINE) { return gentle * bare * 0.5; }
  return gentle * bare * ramp(0.25, 0.6, s.grass) * (1.0 - 0.55 * ramp(0.4, 0.8, s.forest));
}
