/** Finds the stroke or handle under the pointer, measured in device pixels. */

import type { Camera } from "../core/camera/camera.ts";
import { segmentDistance } from "../core/geometry.ts";
import type { Ground, Vec3 } from "../core/types.ts";
import type { Doc } from "../doc/document.ts";
import { worldPoints } from "../doc/strokes.ts";
import type { Stroke } from "../generated/contract.ts";
import { solvedHeight } from "./sketch/strokeops.ts";

export interface Shape {
  /** xyz triples. */
  readonly points: Float64Array;
  readonly centre: Vec3;
  readonly radius: number;
}

/** Strokes are immutable, so their world points can be remembered with them. */
const shapes = new WeakMap<Stroke, Shape>();

/** World points of a stroke's crest and a ball around them. */
export function shapeOf(stroke: Stroke): Shape {
  let shape = shapes.get(stroke);
  if (shape === undefined) {
    shape = measure(worldPoints(stroke));
    shapes.set(stroke, shape);
  }
  return shape;
}

/** Lines of paint on the ground, remembered while neither changes. */
const draped = new WeakMap<Stroke, { readonly ground: Ground; readonly shape: Shape }>();
/** Points of a draped line lie at most this share of the domain apart. */
const DRAPE_STEP = 1 / 256;
/** A line far outside of the domain is no reason for a million points. */
const MOST_PARTS = 256;

/** The line of a paint stroke on the solved ground, which stays as it is, and a ball around it. */
export function drapedOf(stroke: Stroke, ground: Ground): Shape {
  const known = draped.get(stroke);
  if (known?.ground === ground) return known.shape;
  const points = drape(worldPoints(stroke), ground.sizeM * DRAPE_STEP, (x, y) => solvedHeight(ground, x, y));
  const shape = measure(points);
  draped.set(stroke, { ground, shape });
  return shape;
}

/** The line (xyz triples) at other heights, with points at most `stepM` metres apart on the map. */
export function drape(
  line: ArrayLike<number>,
  stepM: number,
  heightAt: (x: number, y: number) => number,
): Float64Array {
  const out: number[] = [];
  const n = line.length / 3;
  for (let i = 0; i + 1 < n; i++) {
    const [x, y] = [line[3 * i]!, line[3 * i + 1]!];
    const [dx, dy] = [line[3 * i + 3]! - x, line[3 * i + 4]! - y];
    const parts = Math.max(1, Math.min(MOST_PARTS, Math.ceil(Math.hypot(dx, dy) / stepM)));
    for (let k = 0; k < parts; k++) {
      const [px, py] = [x + (k / parts) * dx, y + (k / parts) * dy];
      out.push(px, py, heightAt(px, py));
    }
  }
  if (n > 0) out.push(line[3 * n - 3]!, line[3 * n - 2]!, heightAt(line[3 * n - 3]!, line[3 * n - 2]!));
  return new Float64Array(out);
}

function measure(points: Float64Array): Shape {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i++) {
    low[i % 3] = Math.min(low[i % 3]!, points[i]!);
    high[i % 3] = Math.max(high[i % 3]!, points[i]!);
  }
  const mid = (k: number): number => (low[k]! + high[k]!) / 2;
  const radius = Math.hypot(high[0]! - low[0]!, high[1]! - low[1]!, high[2]! - low[2]!) / 2;
  return { points, centre: [mid(0), mid(1), mid(2)], radius };
}

export interface Picked {
  readonly stroke: Stroke;
  /** The point of the crest under the pointer. */
  readonly point: Vec3;
  readonly distancePx: number;
}

/** Kinds of strokes in the order in which they are looked for: those that make heights, and paint. */
export type PickOrder = readonly ("land" | "paint")[];

/**
 * The visible stroke whose line passes nearest to the pixel, within `radiusPx`, of the first kind in `order` that has one;
 * null when there is none. Lines of paint lie on `ground`.
 */
export function pickStroke(
  doc: Doc,
  camera: Camera,
  ground: Ground,
  x: number,
  y: number,
  radiusPx: number,
  order: PickOrder = ["land", "paint"],
): Picked | null {
  for (const kind of order) {
    let best: Picked | null = null;
    let within = radiusPx;
    for (const stroke of doc.strokes.values()) {
      if (stroke.hidden || stroke.curve.length === 0 || (stroke.kind === "paint") !== (kind === "paint")) continue;
      const shape = kind === "paint" ? drapedOf(stroke, ground) : shapeOf(stroke);
      const found = nearest(stroke, shape, camera, x, y, within);
      if (found === null) continue;
      best = found;
      within = found.distancePx;
    }
    if (best !== null) return best;
  }
  return null;
}

function nearest(
  stroke: Stroke,
  { points, centre, radius }: Shape,
  camera: Camera,
  x: number,
  y: number,
  within: number,
): Picked | null {
  const c = camera.project(centre);
  const reach = radius / camera.metresPerPixelAt(centre);
  if (c.depth > 2 * radius && Math.hypot(c.x - x, c.y - y) > 1.5 * reach + within) return null;
  const at = (i: number): Vec3 => [points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!];
  const map = camera.state.value.mode === "map";
  let best: Picked | null = null;
  let a = camera.project(at(0));
  for (let i = 0; i < points.length / 3; i++) {
    const b = camera.project(at(i));
    const seen = map || (a.depth > 0 && b.depth > 0);
    const { distance, t } = segmentDistance(x, y, a.x, a.y, b.x, b.y);
    if (seen && distance <= within) {
      within = distance;
      const p = at(Math.max(0, i - 1));
      const q = at(i);
      const point: Vec3 = [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), p[2] + t * (q[2] - p[2])];
      best = { stroke, point, distancePx: distance };
    }
    a = b;
  }
  return best;
}

/** The handle nearest to the pixel, within `radiusPx`. */
export function pickHandle<H extends { readonly position: Vec3 }>(
  handles: readonly H[],
  camera: Camera,
  x: number,
  y: number,
  radiusPx: number,
): H | null {
  let best: H | null = null;
  let within = radiusPx;
  for (const handle of handles) {
    const p = camera.project(handle.position);
    const d = Math.hypot(p.x - x, p.y - y);
    if (!p.visible || d > within) continue;
    within = d;
    best = handle;
  }
  return best;
}
