/** Rule `plain`: no detail; every channel is its target. Twin of `backend/esker/synthesis/rules/plain.py`. */

import { SYNTH_SMOOTHNESS_MAX, SYNTH_SMOOTHNESS_MIN } from "../../generated/contract.ts";
import { clamp, type Sample, type Site } from "./rule.ts";
import { painted, targets } from "./targets.ts";

export function plain(site: Site, at: Sample, relief: boolean): void {
  const wanted = targets(site, at, relief);
  at.h = clamp(wanted.h, SYNTH_SMOOTHNESS_MIN, SYNTH_SMOOTHNESS_MAX);
  at.snow = painted(clamp(wanted.snow, 0, 1), at.snowBias);
  if (!relief) {
    at.wet = painted(clamp(wanted.wet, 0, 1), at.wetBias);
    at.grass = painted(clamp(wanted.grass, 0, 1), at.grassBias);
    at.forest = painted(clamp(wanted.forest, 0, 1), at.forestBias);
    at.foam = wanted.foam;
  }
  at.d = 0;
  at.sigma = 0;
  at.exponent = 1;
  at.gully = 0;
}
