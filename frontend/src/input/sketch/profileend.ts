/**
 * Where a profile that is being drawn will end: what turns its plane (docs/decisions/0009). Pure.
 *
 * While the pen is in the air its own ray meets ground that is only background. The ground that counts lies in the row of
 * the picture in which the line began, below the column in which an arch that has come so far would end. That place moves
 * continuously, and the pen arrives at it.
 */

import { along, rayPlane } from "../../core/geometry.ts";
import { clamp, distance } from "../../core/math.ts";
import type { Ground, Ray, Vec3 } from "../../core/types.ts";

export type Sense = "up" | "down";

export interface Pixel {
  readonly x: number;
  readonly y: number;
}

/** A climb below this share of the canvas height is a line along the ground; from twice this share on the pen is in the air. */
const CLIMB = 0.015;
/** Share of its climb that the pen must have come back at release for its own ray to name the end on the ground. */
const BACK_END = 0.25;
/** Between these distances of the end from the start, shares of the canvas height, the end gains its say while one draws. */
const NEAR = 0.012;
const FULL = 0.06;
/** A hit farther than this many times the first one is behind what the pen draws over. */
const FAR_HIT = 4;
/** Rounds in which a ray finds the ground beyond the border. */
const ROUNDS = 12;

/** How far the pen lies from the start to the tool's side on the screen: up for a mountain, down for a crevice. */
export function wayOf(start: Pixel, pen: Pixel, sense: Sense): number {
  return sense === "up" ? start.y - pen.y : pen.y - start.y;
}

/**
 * The pixel below which the line ends on the ground, and how much that says about the plane's direction, 0..1.
 * `climb`: farthest way of the pen so far. Null: the pen was lifted in the air, and the plane faces the picture.
 */
export function endPixel(
  start: Pixel,
  pen: Pixel,
  climb: number,
  sense: Sense,
  height: number,
  released: boolean,
): { readonly at: Pixel; readonly say: number } | null {
  const way = wayOf(start, pen, sense);
  const back = climb > 0 ? clamp((climb - way) / climb, 0, 1) : 1;
  const far = (at: Pixel): number => Math.hypot(at.x - start.x, at.y - start.y);
  if (released) {
    if (climb >= CLIMB * height && back < BACK_END) return null;
    return { at: pen, say: far(pen) < NEAR * height ? 0 : 1 };
  }
  const air = smooth(climb / (CLIMB * height) - 1);
  const over = Math.max(0, way) * air;
  // A parabola that has come back by this share of its height has covered this share of its way.
  const covered = (1 + Math.sqrt(back)) / 2;
  const x = start.x + (pen.x - start.x) * (1 + air * (1 / covered - 1));
  const at = { x, y: sense === "up" ? pen.y + over : pen.y - over };
  return { at, say: smooth((far(at) / height - NEAR) / (FULL - NEAR)) };
}

/**
 * Where a ray ends on the ground, beyond the border on the border's height drawn on outward; null in the sky and far behind.
 * `first` is where the line began, `rangeM` how far from the eye that is.
 */
export function endOnGround(ray: Ray, ground: Ground, first: Vec3, rangeM: number): Vec3 | null {
  const near = (p: Vec3): Vec3 | null => (distance(ray.origin, p) <= FAR_HIT * rangeM ? p : null);
  const hit = ground.raycast(ray) ?? groundBeyond(ray, ground, first[2], 1e-3 * rangeM);
  return hit === null ? null : near(hit);
}

/** Where a ray that misses the land meets the border's height drawn on outward, to `withinM` metres; sought from a height on. */
export function groundBeyond(ray: Ray, ground: Ground, fromM: number, withinM: number): Vec3 | null {
  let level = fromM;
  for (let round = 0; round < ROUNDS; round++) {
    const t = rayPlane(ray, [0, 0, level], [0, 0, 1]);
    if (t === null) return null;
    const [x, y] = along(ray, t);
    const z = ground.heightAt(x, y);
    if (Math.abs(z - level) < withinM) return [x, y, z];
    level = z;
  }
  return null;
}

function smooth(t: number): number {
  const s = clamp(t, 0, 1);
  return s * s * (3 - 2 * s);
}
