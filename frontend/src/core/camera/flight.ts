/** The way from one pose to another. Pure. */

import { clamp, mix, mix3, wrapAngle } from "../math.ts";
import type { Pose } from "./state.ts";

export interface Flight {
  readonly from: Pose;
  readonly to: Pose;
  readonly durationS: number;
  readonly elapsedS: number;
}

/** The pose on the way: slow at both ends, distances by their ratio. */
export function poseOn({ from, to, durationS, elapsedS }: Flight): Pose {
  const t = clamp(elapsedS / durationS, 0, 1);
  if (t >= 1) return to;
  const e = t * t * (3 - 2 * t);
  return {
    ...to,
    pivot: mix3(from.pivot, to.pivot, e),
    distanceM: from.distanceM * (to.distanceM / from.distanceM) ** e,
    heading: wrapAngle(from.heading + wrapAngle(to.heading - from.heading) * e),
    pitch: mix(from.pitch, to.pitch, e),
  };
}
