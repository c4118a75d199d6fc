/** Which stroke or handle is under the pointer, measured in device pixels. */

import type { Camera } from "../core/camera.ts";
import { segmentDistance } from "../core/geometry.ts";
import type { Vec3 } from "../core/types.ts";
import type { Doc } from "../doc/document.ts";
import { worldPoints } from "../doc/strokes.ts";
import type { Stroke } from "../generated/contract.ts";

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

/** The visible stroke whose crest passes nearest to the pixel, within `radiusPx`; null when there is none. */
export function pickStroke(doc: Doc, camera: Camera, x: number, y: number, radiusPx: number): Picked | null {
  let best: Picked | null = null;
  for (const stroke of doc.strokes.values()) {
    if (stroke.hidden || stroke.curve.length === 0) continue;
    const found = nearest(stroke, camera, x, y, best?.distancePx ?? radiusPx);
    if (found !== null) best = found;
  }
  return best;
}

function nearest(stroke: Stroke, camera: Camera, x: number, y: number, within: number): Picked | null {
  const { points, centre, radius } = shapeOf(stroke);
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
