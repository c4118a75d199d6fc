/** A line that begins beside the land, or on the face where the land is cut off: at the border where that is near, else not at all. Pure. */

import type { Camera } from "../../core/camera/camera.ts";
import { along } from "../../core/geometry.ts";
import { clamp } from "../../core/math.ts";
import type { Ground, Ray, Vec3 } from "../../core/types.ts";
import { groundBeyond } from "./profileend.ts";
import type { Sample } from "./sketch.ts";

/** A line that begins up to so many CSS pixels beside the land begins at the land's border. */
export const BESIDE_PX = 64;
/** Such a line begins this share of the land's side inside the border, so that its ray meets the land. */
const INSIDE = 1 / 1000;

/** The sample with which a line begins: its own on the land, that at the border within `reachPx` device pixels of it; else null. */
export function beginOnLand(camera: Camera, ground: Ground, sample: Sample, reachPx: number): Sample | null {
  if (ground.raycast(sample.ray) !== null) return sample;
  const { sizeM } = ground;
  const beyond =
    onCutFace(sample.ray, ground) ??
    groundBeyond(sample.ray, ground, ground.heightAt(sizeM / 2, sizeM / 2), sizeM * INSIDE);
  if (beyond === null) return null;
  const inside = (v: number): number => clamp(v, sizeM * INSIDE, sizeM * (1 - INSIDE));
  const [x, y] = [inside(beyond[0]), inside(beyond[1])];
  const at = camera.project([x, y, ground.heightAt(x, y)]);
  if (!at.visible || Math.hypot(at.x - sample.x, at.y - sample.y) > reachPx) return null;
  const ray = camera.ray(at.x, at.y);
  return ground.raycast(ray) === null ? null : { ...sample, x: at.x, y: at.y, ray };
}

/** Where a ray meets the face at which the land is cut off, below its border; null where the ray misses it. */
function onCutFace({ origin, dir }: Ray, ground: Ground): Vec3 | null {
  const { sizeM } = ground;
  let from = 0;
  let to = Number.POSITIVE_INFINITY;
  for (const axis of [0, 1] as const) {
    const a = -origin[axis] / dir[axis];
    const b = (sizeM - origin[axis]) / dir[axis];
    from = Math.max(from, Math.min(a, b));
    to = Math.min(to, Math.max(a, b));
  }
  if (from <= 0 || !(from < to)) return null;
  const met = along({ origin, dir }, from);
  return met[2] < ground.heightAt(met[0], met[1]) ? met : null;
}
