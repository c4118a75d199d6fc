/** Ops for whole strokes, within the limits of the wire. Pure. */

import type { Ground, Vec3 } from "../../core/types.ts";
import { type CurvePoint, levelCurve, profileCurve } from "../../doc/strokes.ts";
import { MAX_POINTS_PER_APPEND, type Op, type Stroke } from "../../generated/contract.ts";

export type Triple = [number, number, number];

/** One op takes at most so many points: more may not fit into one message. */
const MOST_POINTS_IN_SET = 1024;

/** Millimetres are far below a quantum; shorter numbers make shorter messages. */
export function metres(p: Vec3): Triple {
  const r = (v: number): number => Math.round(v * 1000) / 1000;
  return [r(p[0]), r(p[1]), r(p[2])];
}

/** Height without synthesised detail: strokes constrain the solved ground, and detail is added to it. */
export function solvedHeight(ground: Ground, x: number, y: number): number {
  return ground.solvedAt?.(x, y) ?? ground.heightAt(x, y);
}

/** A point on the ground as it is drawn, as an anchor: lowered by the detail there. */
export function anchorOn(ground: Ground, p: Vec3): Triple {
  return metres([p[0], p[1], p[2] - ground.heightAt(p[0], p[1]) + solvedHeight(ground, p[0], p[1])]);
}

/** Curve coordinates to 10⁻⁷ of the frame and a millimetre. */
export function roundCurve(kind: Stroke["kind"], curve: readonly CurvePoint[]): CurvePoint[] {
  const fine = (v: number): number => Math.round(v * 1e7) / 1e7;
  const mm = (v: number): number => Math.round(v * 1e3) / 1e3;
  return curve.map(([u, v]) => [fine(u), kind === "profile" ? mm(v) : fine(v)]);
}

/** World points (xyz triples) in the frame of the anchors, rounded for the wire. */
export function frameCurve(kind: Stroke["kind"], points: ArrayLike<number>, first: Vec3, last: Vec3): CurvePoint[] {
  return roundCurve(kind, kind === "profile" ? profileCurve(points, first, last) : levelCurve(points, first, last));
}

/** The appends that replace the curve from its beginning and move the last anchor. */
export function appendOps(stroke: string, curve: readonly CurvePoint[], last: Triple): Op[] {
  const ops: Op[] = [];
  for (let start = 0; start === 0 || start < curve.length; start += MAX_POINTS_PER_APPEND)
    ops.push({ type: "stroke.append", stroke, start, points: curve.slice(start, start + MAX_POINTS_PER_APPEND), last });
  return ops;
}

/** The ops that give a stroke a new curve. */
export function curveOps(stroke: Stroke, curve: CurvePoint[]): Op[] {
  if (curve.length <= MOST_POINTS_IN_SET) return [{ type: "stroke.set", stroke: stroke.id, fields: { curve } }];
  return appendOps(stroke.id, curve, stroke.last);
}

/** The ops that create a whole stroke at once. */
export function createOps(stroke: Stroke): Op[] {
  if (stroke.curve.length <= MOST_POINTS_IN_SET) return [{ type: "stroke.begin", stroke }];
  const begin: Op = { type: "stroke.begin", stroke: { ...stroke, curve: [], finished: false, locked: false } };
  const finish: Op = { type: "stroke.finish", stroke: stroke.id };
  return [begin, ...appendOps(stroke.id, stroke.curve, stroke.last), finish];
}
