/** Where the crests of strokes cross on the map, and how high each of them would be there. Pure. */

import type { Stroke } from "../generated/contract.ts";
import { type CurvePoint, worldPoints } from "./strokes.ts";

/** A crossing of two crests: where it is on the map, and the heights that they ask for there, metres. */
export interface Meeting {
  readonly other: string;
  readonly x: number;
  readonly y: number;
  readonly mine: number;
  readonly theirs: number;
}

/** At most so many crossings are listed. */
export const MOST_MEETINGS = 24;
/** Heights that differ by less than this, metres, do not spoil one another. */
const AGREE_M = 1;

/** A crest in plan with its height: xyz triples along a line that does not go back, or level. */
interface Crest {
  readonly points: Float64Array;
  readonly box: readonly [number, number, number, number];
}

const crests = new WeakMap<Stroke, Crest>();

/** The crossings of a stroke with others that make height, nearest to its start first. */
export function meetings(stroke: Stroke, others: Iterable<Stroke>): Meeting[] {
  if (!makesHeight(stroke)) return [];
  const mine = crestOf(stroke);
  const found: Meeting[] = [];
  for (const other of others) {
    if (other.id === stroke.id || !makesHeight(other)) continue;
    const theirs = crestOf(other);
    if (!overlap(mine.box, theirs.box)) continue;
    const at = crossing(mine.points, theirs.points);
    if (at !== null && Math.abs(at.mine - at.theirs) > AGREE_M) found.push({ other: other.id, ...at });
  }
  const [x, y] = stroke.first;
  found.sort((a, b) => Math.hypot(a.x - x, a.y - y) - Math.hypot(b.x - x, b.y - y));
  return found.slice(0, MOST_MEETINGS);
}

function makesHeight(stroke: Stroke): boolean {
  return stroke.paint === null && !stroke.hidden && stroke.curve.length > 1;
}

function crestOf(stroke: Stroke): Crest {
  let crest = crests.get(stroke);
  if (crest === undefined) {
    const points = worldPoints(stroke.kind === "profile" ? { ...stroke, curve: skyline(stroke.curve) } : stroke);
    crest = { points, box: boxOf(points) };
    crests.set(stroke, crest);
  }
  return crest;
}

/**
 * Returns the curve without its ways back: points of ever greater u. Ground has no overhangs and follows the curve so.
 */
function skyline(curve: readonly CurvePoint[]): CurvePoint[] {
  const out: CurvePoint[] = [];
  for (const [u, w] of [...curve].sort((a, b) => a[0] - b[0])) {
    const last = out.at(-1);
    if (last !== undefined && last[0] === u) last[1] = Math.abs(w) > Math.abs(last[1]) ? w : last[1];
    else out.push([u, w]);
  }
  return out;
}

function boxOf(points: Float64Array): [number, number, number, number] {
  let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i += 3) {
    [x0, x1] = [Math.min(x0, points[i]!), Math.max(x1, points[i]!)];
    [y0, y1] = [Math.min(y0, points[i + 1]!), Math.max(y1, points[i + 1]!)];
  }
  return [x0, y0, x1, y1];
}

type Box = Crest["box"];

function overlap(a: Box, b: Box): boolean {
  return a[0] <= b[2] && b[0] <= a[2] && a[1] <= b[3] && b[1] <= a[3];
}

/** The crossing at which two crests differ most in height; null when they do not cross on the map. */
function crossing(a: Float64Array, b: Float64Array): Omit<Meeting, "other"> | null {
  let best: Omit<Meeting, "other"> | null = null;
  const whole = boxOf(b);
  for (let i = 3; i < a.length; i += 3) {
    if (!overlap(segmentBox(a, i), whole)) continue;
    for (let j = 3; j < b.length; j += 3) {
      const at = segmentsCross(a, i, b, j);
      if (at !== null && (best === null || Math.abs(at.mine - at.theirs) > Math.abs(best.mine - best.theirs)))
        best = at;
    }
  }
  return best;
}

function segmentBox(p: Float64Array, i: number): Box {
  const [x0, y0, x1, y1] = [p[i - 3]!, p[i - 2]!, p[i]!, p[i + 1]!];
  return [Math.min(x0, x1), Math.min(y0, y1), Math.max(x0, x1), Math.max(y0, y1)];
}

/** Where the segments that end at points i and j cross. */
function segmentsCross(a: Float64Array, i: number, b: Float64Array, j: number): Omit<Meeting, "other"> | null {
  const [ax, ay, bx, by] = [a[i - 3]!, a[i - 2]!, b[j - 3]!, b[j - 2]!];
  const [dx, dy, ex, ey] = [a[i]! - ax, a[i + 1]! - ay, b[j]! - bx, b[j + 1]! - by];
  const area = dx * ey - dy * ex;
  if (area === 0) return null;
  const s = ((bx - ax) * ey - (by - ay) * ex) / area;
  const t = ((bx - ax) * dy - (by - ay) * dx) / area;
  if (s < 0 || s > 1 || t < 0 || t > 1) return null;
  const height = (p: Float64Array, k: number, share: number): number => p[k - 1]! + share * (p[k + 2]! - p[k - 1]!);
  return { x: ax + s * dx, y: ay + s * dy, mine: height(a, i, s), theirs: height(b, j, t) };
}
