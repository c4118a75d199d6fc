/**
 * Vertical exaggeration as a lens. The pose of a camera lies in the world as it is seen, whose heights are `k` times the true ones;
 * everybody else works in the true world. So the picture is one linear map away from the true one: matrices, rays, culling and
 * handles go along by themselves, and cracks cannot open. Pure.
 */

import type { Ground, Ray, Vec3 } from "../types.ts";

export const MOST_EXAGGERATION = 5;

/** A true place as it is seen. */
export function raised(p: Vec3, k: number): Vec3 {
  return k === 1 ? p : [p[0], p[1], p[2] * k];
}

/** A seen place as it truly is. */
export function lowered(p: Vec3, k: number): Vec3 {
  return k === 1 ? p : [p[0], p[1], p[2] / k];
}

/** A seen ray in the true world. */
export function loweredRay({ origin, dir, spread }: Ray, k: number): Ray {
  if (k === 1) return { origin, dir, spread: spread! };
  const d: Vec3 = [dir[0], dir[1], dir[2] / k];
  const length = Math.hypot(...d);
  // A metre of the true way is `1 / length` metres of the seen one.
  return {
    origin: lowered(origin, k),
    dir: [d[0] / length, d[1] / length, d[2] / length],
    spread: [spread![0], spread![1] / length],
  };
}

/** The ground as it is seen. */
export function raisedGround(ground: Ground, k: number): Ground {
  return k === 1 ? ground : { ...ground, heightAt: (x, y, cellM) => k * ground.heightAt(x, y, cellM) };
}
