// Rule `smooth`: no detail; channels go to their targets without noise, and ground that was never solved is a bicubic
// B-spline (paper 1, section 4). docs/synthesis.md, "Smooth"; backend/esker/synthesis/rules/smooth.py.
const BSPLINE_BASE: bool = true;

fn rule(level: u32, ground: Ground, before: SynthState, goal: Targets, asked: Asked,
    noise: SynthNoise) -> SynthState {
  let tie = site.levels[level].tie;
  var out: SynthState;
  out.h = smoothness(blended(before.h, goal.h, tie));
  out.snow = painted(unit(blended(before.snow, goal.snow, tie)), asked.snow);
  out.wet = painted(unit(blended(before.wet, goal.wet, tie)), asked.wetness);
  out.grass = painted(unit(blended(before.grass, goal.grass, tie)), asked.grass);
  out.forest = painted(unit(blended(before.forest, goal.forest, tie)), asked.forest);
  out.foam = unit(blended(before.foam, goal.foam, tie));
  return out;
}
