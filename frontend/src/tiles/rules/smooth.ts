/**
 * Rule `smooth`: no detail; channels go to their targets without noise, and ground that was never solved is a bicubic
 * B-spline (paper 1, section 4: smooth surfaces). Twin of `backend/esker/synthesis/rules/smooth.py`.
 */

import { SYNTH_SMOOTHNESS_MAX, SYNTH_SMOOTHNESS_MIN } from "../../generated/contract.ts";
import { clamp, type Sample, type Site } from "./rule.ts";
import { blended, painted, targets, tie } from "./targets.ts";

export function smooth(site: Site, at: Sample, relief: boolean): void {
  const tied = tie(at.level);
  const wanted = targets(site, at, relief);
  const drawn = (before: number, target: number): number => clamp(blended(before, target, tied), 0, 1);
  at.h = clamp(blended(at.h, wanted.h, tied), SYNTH_SMOOTHNESS_MIN, SYNTH_SMOOTHNESS_MAX);
  at.snow = painted(drawn(at.snow, wanted.snow), at.snowBias);
  if (!relief) {
    at.wet = painted(drawn(at.wet, wanted.wet), at.wetBias);
    at.grass = painted(drawn(at.grass, wanted.grass), at.grassBias);
    at.forest = painted(drawn(at.forest, wanted.forest), at.forestBias);
    at.foam = drawn(at.foam, wanted.foam);
  }
  at.d = 0;
  at.sigma = 0;
  at.exponent = 1;
  at.gully = 0;
}
