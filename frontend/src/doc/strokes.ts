/** Strokes as geometry: frames, world points, bounds (DESIGN 4). Twin of `backend/esker/document/strokes.py`. Pure. */

import { msg, str } from "@lit/localize";
import { type Flank, MAX_COURSE_POINTS, type Stroke } from "../generated/contract.ts";

/** An anchor: x, y, z in metres. */
export type Anchor = readonly [number, number, number];
export type CurvePoint = [number, number];
export type StrokeShape = Pick<Stroke, "kind" | "first" | "last" | "curve"> & { readonly course?: Stroke["course"] };

/** Axis-aligned rectangle in world metres. */
export interface Rect {
  readonly x0: number;
  readonly y0: number;
  readonly x1: number;
  readonly y1: number;
}

/** The crest polyline as xyz triples, metres: the curve taken out of the frame of the anchors. */
export function worldPoints(stroke: StrokeShape): Float64Array {
  const { curve, first, last } = stroke;
  const out = new Float64Array(3 * curve.length);
  const dx = last[0] - first[0];
  const dy = last[1] - first[1];
  const dz = last[2] - first[2];
  const profile = stroke.kind === "profile";
  const rises = stroke.course?.rises ?? [];
  for (let i = 0; i < curve.length; i++) {
    const [u, v] = curve[i]!;
    out[3 * i] = first[0] + u * dx - (profile ? 0 : v * dy);
    out[3 * i + 1] = first[1] + u * dy + (profile ? 0 : v * dx);
    out[3 * i + 2] = profile ? first[2] + u * dz + v : first[2];
    if (rises.length > 0) out[3 * i + 2] = first[2] + rises[Math.min(i, rises.length - 1)]!;
  }
  return out;
}

/**
 * World points (xyz triples) in the profile frame of the anchors: the inverse of `worldPoints`.
 *
 * Points off the plane are projected on it along its horizontal normal. A zero-length frame puts all u at 0.
 */
export function profileCurve(points: ArrayLike<number>, first: Anchor, last: Anchor): CurvePoint[] {
  const dx = last[0] - first[0];
  const dy = last[1] - first[1];
  const length2 = dx * dx + dy * dy;
  const curve: CurvePoint[] = [];
  for (let i = 0; i + 2 < points.length; i += 3) {
    const u = length2 > 0 ? ((points[i]! - first[0]) * dx + (points[i + 1]! - first[1]) * dy) / length2 : 0;
    curve.push([u, points[i + 2]! - (first[2] + u * (last[2] - first[2]))]);
  }
  return curve;
}

/** World points (xyz triples) in the similarity frame of the anchors; heights are dropped. */
export function levelCurve(points: ArrayLike<number>, first: Anchor, last: Anchor): CurvePoint[] {
  const dx = last[0] - first[0];
  const dy = last[1] - first[1];
  const length2 = dx * dx + dy * dy;
  const curve: CurvePoint[] = [];
  for (let i = 0; i + 2 < points.length; i += 3) {
    const qx = points[i]! - first[0];
    const qy = points[i + 1]! - first[1];
    curve.push(length2 > 0 ? [(qx * dx + qy * dy) / length2, (qy * dx - qx * dy) / length2] : [0, 0]);
  }
  return curve;
}

/** What is wrong with the fields of a stroke of its kind, for a person; null when nothing is. */
export function misfit(stroke: Stroke): string | null {
  if ((stroke.kind === "paint") !== (stroke.paint !== null))
    return msg("A paint stroke needs 'paint' (channel, value, radius), and only a paint stroke.");
  if ((stroke.kind === "course") !== (stroke.course !== null))
    return msg("A course needs 'course' (use, heights), and only a course.");
  if (stroke.course === null) return null;
  if (stroke.curve.length > MAX_COURSE_POINTS) return msg(str`A course holds at most ${MAX_COURSE_POINTS} points.`);
  const { rises } = stroke.course;
  if (stroke.course.use === "river" && rises.some((rise, i) => i > 0 && rise > rises[i - 1]!))
    return msg("A river never rises along its way.");
  return null;
}

/** Farthest horizontal distance from the crest at which the stroke constrains anything, metres. */
export function influenceExtent(stroke: Pick<Stroke, "left" | "right" | "plateau_radius_m" | "paint">): number {
  if (stroke.paint !== null) return stroke.paint.radius_m;
  const extent = (f: Flank | null): number => f?.extent_m ?? 0;
  return stroke.plateau_radius_m + Math.max(extent(stroke.left), extent(stroke.right));
}

/** The rectangle outside which the stroke constrains nothing; null for a stroke without effect. */
export function bounds(stroke: Stroke): Rect | null {
  if (stroke.hidden || stroke.curve.length === 0) return null;
  const p = worldPoints(stroke);
  let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < p.length; i += 3) {
    x0 = Math.min(x0, p[i]!);
    x1 = Math.max(x1, p[i]!);
    y0 = Math.min(y0, p[i + 1]!);
    y1 = Math.max(y1, p[i + 1]!);
  }
  const m = influenceExtent(stroke);
  return { x0: x0 - m, y0: y0 - m, x1: x1 + m, y1: y1 + m };
}
