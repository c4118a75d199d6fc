// Rule `plain`: no detail; every channel is its target. docs/synthesis.md, "Plain";
// backend/esker/synthesis/rules/plain.py.
const BSPLINE_BASE: bool = false;

fn rule(level: u32, ground: Ground, before: SynthState, goal: Targets, asked: Asked,
    noise: SynthNoise) -> SynthState {
  var out: SynthState;
  out.h = smoothness(goal.h);
  out.snow = painted(unit(goal.snow), asked.snow);
  out.wet = painted(unit(goal.wet), asked.wetness);
  out.grass = painted(unit(goal.grass), asked.grass);
  out.forest = painted(unit(goal.forest), asked.forest);
  out.foam = goal.foam;
  return out;
}
