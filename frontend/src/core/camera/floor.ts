/** Keeping the eye out of the ground. Pure. */

import { addScaled, clamp, DEG, distance, sub } from "../math.ts";
import type { Ground, Vec3 } from "../types.ts";
import { type Pose, poseBasis } from "./state.ts";

/** How high the eye stands over the ground, metres; lower on small models. */
const EYE_HEIGHT_M = 1.7;
/** Room that the eye has to all sides, metres, three times as far as the picture's corners on the near plane. */
const ROOM_M = 0.45;
/** Directions in which it is looked for. */
const ROUND = Array.from({ length: 8 }, (_, k) => [Math.cos((k * Math.PI) / 4), Math.sin((k * Math.PI) / 4)] as const);

export const MAX_PITCH = 30 * DEG;
export const MIN_PITCH = -89 * DEG;

/**
 * The ground under an eye, and the least height at which it has room: eye height over the ground below, and over what rises
 * close beside it. On slopes and at the foot of walls the near plane would else reach into the ground.
 */
export function standingRoom(ground: Ground, [x, y]: Vec3, sizeM: number): { floor: number; lowest: number } {
  const floor = ground.heightAt(x, y);
  const room = Math.min(ROOM_M, sizeM / 400);
  let lowest = floor + Math.min(EYE_HEIGHT_M, sizeM / 100);
  for (const [east, north] of ROUND)
    lowest = Math.max(lowest, ground.heightAt(x + room * east, y + room * north) + room);
  return { floor, lowest };
}

/** The pose with its eye lifted to a place. Orbit keeps looking at its pivot; fly keeps its direction. */
export function lifted(pose: Pose, eye: Vec3, nearestM: number): Pose {
  if (pose.mode === "fly") return { ...pose, pivot: addScaled(eye, poseBasis(pose).forward, pose.distanceM) };
  const d = sub(pose.pivot, eye);
  const pitch = clamp(Math.atan2(d[2], Math.hypot(d[0], d[1])), MIN_PITCH, MAX_PITCH);
  const turned: Pose = { ...pose, pitch, distanceM: Math.max(nearestM, distance(eye, pose.pivot)) };
  return { ...turned, pivot: addScaled(eye, poseBasis(turned).forward, turned.distanceM) };
}
