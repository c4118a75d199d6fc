// Rule `landscape`: multi-channel fractals (paper 1, section 4), the default. docs/synthesis.md, "Landscape";
// backend/esker/synthesis/rules/landscape.py.
const BSPLINE_BASE: bool = false;

fn mixed(before: vec4f, goal: vec4f, noise: vec4f, constants: SynthLevel) -> vec4f {
  let undecided = SYNTH_CHANNEL_NOISE_PURE + (4.0 - 4.0 * SYNTH_CHANNEL_NOISE_PURE) * goal * (1.0 - goal);
  return unit(blended(before + constants.channel_noise * noise * undecided, goal, constants.tie));
}

fn rule(level: u32, ground: Ground, before: SynthState, goal: Targets, asked: Asked,
    noise: SynthNoise) -> SynthState {
  let constants = site.levels[level];
  var out: SynthState;
  out.h = smoothness(blended(before.h + constants.smoothness_noise * noise_low(noise.b), goal.h, constants.tie));
  out.snow = painted(mixed(before.snow, goal.snow, noise_high(noise.b), constants), asked.snow);
  out.wet = painted(mixed(before.wet, goal.wet, noise_low(noise.c), constants), asked.wetness);
  out.grass = painted(mixed(before.grass, goal.grass, noise_high(noise.c), constants), asked.grass);
  out.forest = painted(mixed(before.forest, goal.forest, noise_low(noise.d), constants), asked.forest);
  out.foam = mixed(before.foam, goal.foam, noise_high(noise.d), constants);

  let share = SYNTH_FLAT_SHARE
    + (1.0 - SYNTH_FLAT_SHARE) * rise(SYNTH_AMPLITUDE_SLOPE_FROM, SYNTH_AMPLITUDE_SLOPE_TO, ground.guide_slope);
  let amplitude = max(vec4f(0.0), site.amplitude * share + asked.amplitude);
  let exponent = clamp(
    out.h + SYNTH_ROUGHNESS_TO_H * (0.5 - asked.roughness) + SYNTH_SNOW_TO_H * out.snow,
    vec4f(SYNTH_H_RANGE_FROM), vec4f(SYNTH_H_RANGE_TO));
  var size = amplitude * exp2(-f32(level) * exponent);
  out.finer = size * exp2(-exponent);
  var heard = vec4f(1.0);
  if (site.surveyed == 1u) {
    heard = audible(f32(level), asked.survey);
    size *= heard;
    out.finer *= hushed(f32(level), asked.survey, exponent);
  }
  if (site.eroded == 0u) {
    out.d = before.d + size * noise_full(noise.a);
    return out;
  }
  let worn = wear(level, ground, asked);
  out.d = before.d + size * worn.calm * noise_full(noise.a);
  let depth = worn.depth * heard;
  if (any(depth != vec4f(0.0))) { out.d += depth * gullies(level, ground, noise.i, noise.j); }
  var below = worn.finer;
  if (site.surveyed == 1u) { below *= hushed(f32(level), asked.survey, vec4f(-log2(SYNTH_GULLY_FALL))); }
  out.finer += below;
  return out;
}
