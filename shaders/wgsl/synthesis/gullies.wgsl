// Gullies: one octave a level of waves whose lines run down the slope (docs/synthesis.md, "Gullies";
// backend/esker/synthesis/rules/gullies.py). Polynomials stand for sine and arc tangent, so that all devices agree.
fn gully_sine(a: vec4f) -> vec4f {
  let p = a * a;
  let inner = SYNTH_GULLY_SINE_5 + p * (SYNTH_GULLY_SINE_7 + p * SYNTH_GULLY_SINE_9);
  return a * (SYNTH_GULLY_SINE_1 + p * (SYNTH_GULLY_SINE_3 + p * inner));
}

// |atan2(s, c)| / pi.
fn half_turns(s: vec4f, c: vec4f) -> vec4f {
  let high = max(abs(s), abs(c));
  let x = min(abs(s), abs(c)) / max(high, vec4f(1.0e-20));
  let p = x * x;
  let inner = SYNTH_GULLY_ARC_7 + p * (SYNTH_GULLY_ARC_9 + p * SYNTH_GULLY_ARC_11);
  let first = x * (SYNTH_GULLY_ARC_1 + p * (SYNTH_GULLY_ARC_3 + p * (SYNTH_GULLY_ARC_5 + p * inner)));
  let quarter = select(first, 0.5 - first, abs(s) > abs(c));
  return select(quarter, 1.0 - quarter, c < vec4f(0.0));
}

fn gully_rounded(t: vec4f, radius: f32) -> vec4f {
  return (sqrt(t * t + radius * radius) - radius) / (sqrt(1.0 + radius * radius) - radius);
}

// Height across a gully of depth 1, at t from its ridge, 0, to its bed, 1: hyperbolas at both ends.
fn gully_profile(t: vec4f) -> vec4f {
  let low = gully_rounded(t, SYNTH_GULLY_RIDGE);
  let high = 1.0 - gully_rounded(1.0 - t, SYNTH_GULLY_BED);
  return SYNTH_GULLY_MIDDLE - (low * (1.0 - t) + high * t);
}

// A cell of the lattice of pivots as the hash takes it. In a cyclic domain there is a whole number of them.
fn lattice_index(level: u32, cell: i32) -> u32 {
  if (site.cyclic == 0u) { return bitcast<u32>(cell); }
  let count = (TILE_CELLS << level) / site.gully_side;
  return bitcast<u32>((cell + count) % count);
}

// The octave of a level for a depth of 1. A wave reaches less than a cell beyond its own: the nine cells about a sample are
// all that it sees, and the sixteen about four children add nothing else.
fn gullies(level: u32, ground: Ground, i: vec2i, j: vec2i) -> vec4f {
  let side = site.gully_side;
  let first = vec2i(i.x + side, j.x + side) / side - 1;   // no index is below -side
  let last = vec2i(i.y + side, j.y + side) / side - 1;
  let per_cell = 1.0 / f32(side);
  let u = vec2f(i - first.x * side) * per_cell;
  let v = vec2f(j - first.y * side) * per_cell;
  let turn = 1.0 / sqrt(ground.slope_x * ground.slope_x + ground.slope_y * ground.slope_y
    + SYNTH_GULLY_TURN * SYNTH_GULLY_TURN);
  let nx = -ground.slope_y * turn;
  let ny = ground.slope_x * turn;
  let key = site.levels[level].gully_key;
  var cosine = vec4f(0.0);
  var sine = vec4f(0.0);
  var weights = vec4f(0.0);
  for (var b = first.y - 1; b <= last.y + 1; b += 1) {
    let row = synth_mix(key + lattice_index(level, b));
    for (var a = first.x - 1; a <= last.x + 1; a += 1) {
      let word = vec4u(synth_mix(row + lattice_index(level, a)));
      let east = f32(a - first.x) + (0.5 + SYNTH_GULLY_JITTER * noise_low(word).x);
      let north = f32(b - first.y) + (0.5 + SYNTH_GULLY_JITTER * noise_high(word).x);
      let qx = u.xyxy - east;
      let qy = v.xxyy - north;
      let w = max(vec4f(0.0), 1.0 - (qx * qx + qy * qy));
      let turns = SYNTH_GULLY_CELL * (qx * nx + qy * ny);
      let t = turns - floor(turns + 0.5);
      let weight = w * w;
      cosine += weight * gully_sine(0.25 - abs(t));
      sine += weight * gully_sine(select(select(vec4f(0.5), vec4f(-0.5), t < vec4f(0.0)) - t, t, abs(t) <= vec4f(0.25)));
      weights += weight;
    }
  }
  let length = sqrt(cosine * cosine + sine * sine);
  let agree = min(vec4f(1.0), length / (SYNTH_GULLY_AGREEMENT * weights + SYNTH_GULLY_AGREEMENT_LEAST));
  return agree * agree * (3.0 - 2.0 * agree) * gully_profile(half_turns(sine, cosine));
}

// What gullies leave of the noise of d, how deep they are, and the most that the next level's may be, metres.
struct Wear {
  calm: vec4f,
  depth: vec4f,
  finer: vec4f,
};

fn gully_steepness(slope: vec4f) -> vec4f {
  return rise(SYNTH_GULLY_FLAT_FROM, SYNTH_GULLY_FLAT_TO, slope) * min(slope, vec4f(SYNTH_GULLY_STEEP));
}

fn wear(level: u32, ground: Ground, asked: Asked) -> Wear {
  let constants = site.levels[level];
  let painted = site.erosion * (1.0 + min(asked.erosion, vec4f(0.0))) + max(asked.erosion, vec4f(0.0));
  let strength = min(painted, vec4f(MAX_EROSION));
  let shallow = min(strength, vec4f(1.0));
  let steep = gully_steepness(ground.guide_slope);
  let away = max(vec4f(0.0), site.far * asked.far - site.far_margin) / constants.wave;
  let held = site.hold * (1.0 - rise(SYNTH_GULLY_HOLD_FROM, SYNTH_GULLY_HOLD_TO, away));
  let l = vec4f(f32(level));
  let back = SYNTH_GULLY_CALM_GAIN * rise(SYNTH_GULLY_CALM_LEVELS_FROM, SYNTH_GULLY_CALM_LEVELS_TO, l);
  let less = (SYNTH_GULLY_CALM - back) / SYNTH_GULLY_STEEP * shallow * steep;
  let quiet = (1.0 - rise(SYNTH_GULLY_QUIET_LEVELS_FROM, SYNTH_GULLY_QUIET_LEVELS_TO, l)) * shallow * held;
  let crest = 1.0 - site.hold * rise(SYNTH_GULLY_CREST_FROM, SYNTH_GULLY_CREST_TO, -ground.concavity);
  let foot = 1.0 - SYNTH_GULLY_FOOT_SHARE * rise(SYNTH_GULLY_FOOT_FROM, SYNTH_GULLY_FOOT_TO, ground.concavity);
  var out: Wear;
  out.calm = (1.0 - less) * (1.0 - quiet);
  out.depth = select(constants.depth, 0.0, level == 0u) * strength * steep * crest * foot * (1.0 - held);
  // The guide of finer levels may be somewhat steeper between its samples.
  out.finer = SYNTH_GULLY_MOST * SYNTH_GULLY_FALL * constants.depth * strength
    * gully_steepness(SYNTH_GULLY_STEEPER * ground.guide_slope);
  return out;
}
