/** How a river, a road or a ridge is laid on the ground, and what of a stroke that makes (DESIGN 21). Pure. */

import { simplifyTo } from "../../core/geometry.ts";
import type { Vec3 } from "../../core/types.ts";
import { type Course, type Flank, MAX_COURSE_POINTS, type Stroke } from "../../generated/contract.ts";
import { farthest } from "./sketch.ts";
import { frameCurve, metres, type Triple } from "./strokeops.ts";

/** What a new course gets: `bankM` and `widthM` in metres, `depthM` below the ground (of a ridge: above it). */
export interface CourseStyle {
  readonly use: Course["use"];
  readonly widthM: number;
  readonly bankM: number;
  readonly depthM: number;
  /** Steepest grade of a road, as a tangent. */
  readonly grade: number;
}

/** A ridge rises from the ground and comes down to it over this share of its length at each end. */
const TAPER = 0.2;
/** A line that comes back to within this share of its length has its last anchor where it is farthest from the first. */
const CLOSED = 0.25;
/** Heights that stray less than this share of the depth, and so many metres, need no point of their own. */
const STRAY = 0.1;
const LEAST_STRAY_M = 0.25;

/** Distances along a line (xyz triples) on the map, metres. */
export function arcs(points: ArrayLike<number>): Float64Array {
  const out = new Float64Array(points.length / 3);
  for (let i = 1; i < out.length; i++)
    out[i] = out[i - 1]! + Math.hypot(points[3 * i]! - points[3 * i - 3]!, points[3 * i + 1]! - points[3 * i - 2]!);
  return out;
}

/**
 * The line (xyz triples on the ground, close enough to follow it) with the heights of its use. A river runs down: where
 * the ground's end lies above its beginning the line is turned round.
 */
export function laid(line: Float64Array, style: Omit<CourseStyle, "widthM" | "bankM">): Float64Array {
  const n = line.length / 3;
  const out = style.use === "river" && n > 1 && line[3 * n - 1]! > line[2]! ? reversed(line) : line.slice();
  const ground = out.filter((_, k) => k % 3 === 2);
  const along = arcs(out);
  const length = along.at(-1) ?? 0;
  const taper = (s: number): number => Math.min(1, Math.min(s, length - s) / Math.max(TAPER * length, 1e-9));
  const heights =
    style.use === "road"
      ? graded(ground, along, style.grade)
      : ground.map((z, i) => (style.use === "river" ? z - style.depthM : z + style.depthM * smooth(taper(along[i]!))));
  if (style.use === "river") runDown(heights);
  for (let i = 0; i < n; i++) out[3 * i + 2] = heights[i]!;
  return out;
}

/** Lowers what rises along the way. */
export function runDown(heights: Float64Array): void {
  for (let i = 1; i < heights.length; i++) heights[i] = Math.min(heights[i]!, heights[i - 1]!);
}

/**
 * The mean of the least line above and the greatest line below the heights that are nowhere steeper than `grade`: it cuts and
 * fills alike, and is nowhere steeper itself.
 */
export function graded(heights: Float64Array, along: Float64Array, grade: number): Float64Array {
  const below = heights.slice();
  const above = heights.slice();
  const limit = (i: number, j: number): void => {
    const step = grade * Math.abs(along[i]! - along[j]!);
    below[i] = Math.min(below[i]!, below[j]! + step);
    above[i] = Math.max(above[i]!, above[j]! - step);
  };
  for (let i = 1; i < heights.length; i++) limit(i, i - 1);
  for (let i = heights.length - 2; i >= 0; i--) limit(i, i + 1);
  return below.map((low, i) => (low + above[i]!) / 2);
}

/** The steepest grade along a line (xyz triples), as a tangent. */
export function steepest(points: ArrayLike<number>): number {
  const along = arcs(points);
  let most = 0;
  for (let i = 1; i < along.length; i++) {
    const run = along[i]! - along[i - 1]!;
    if (run > 0) most = Math.max(most, Math.abs(points[3 * i + 2]! - points[3 * i - 1]!) / run);
  }
  return most;
}

/** The points that a line needs: bends beyond `toleranceM` on the map, and heights that stray. */
export function thinned(line: Float64Array, toleranceM: number, depthM: number, most: number): Float64Array {
  const along = arcs(line);
  const xy = Array.from({ length: 2 * along.length }, (_, k) => line[3 * (k >> 1) + (k % 2)]!);
  const stray = Math.max(LEAST_STRAY_M, STRAY * depthM);
  // Heights along the way, scaled so that one tolerance serves both.
  const sz = Array.from(along).flatMap((s, i) => [s, (line[3 * i + 2]! * toleranceM) / stray]);
  const half = Math.max(2, Math.floor(Math.min(most, MAX_COURSE_POINTS) / 2));
  const kept = new Set([...simplifyTo(xy, toleranceM, half), ...simplifyTo(sz, toleranceM, half)]);
  return new Float64Array(
    [...kept].sort((a, b) => a - b).flatMap((i) => [line[3 * i]!, line[3 * i + 1]!, line[3 * i + 2]!]),
  );
}

/** The fields of a stroke that is this line (xyz triples), with a frame that moves with it. */
export function courseFields(
  points: Float64Array,
  course: Omit<Course, "rises">,
): { first: Triple; last: Triple; curve: [number, number][]; course: Course } {
  const n = points.length;
  const first = metres([points[0]!, points[1]!, points[2]!]);
  const gap = Math.hypot(points[n - 3]! - first[0], points[n - 2]! - first[1]);
  const end: Vec3 =
    gap < CLOSED * (arcs(points).at(-1) ?? 0) ? farthest(points, first) : [points[n - 3]!, points[n - 2]!, first[2]];
  const last = metres([end[0], end[1], first[2]]);
  const rises = Array.from({ length: n / 3 }, (_, i) => Math.round((points[3 * i + 2]! - first[2]) * 1000) / 1000);
  return { first, last, curve: frameCurve("course", points, first, last), course: { ...course, rises } };
}

/** The banks of a course: flanks without a slope, within which the ground runs to the line. */
export function bank(bankM: number): Flank | null {
  return bankM > 0 ? { slope_deg: null, extent_m: bankM, shape: "straight" } : null;
}

/** The heights of a course at its points brought to what its use asks for. */
export function obeying(points: Float64Array, course: Pick<Course, "use" | "grade">): Float64Array {
  const out = new Float64Array(points);
  const drawn = out.filter((_, k) => k % 3 === 2);
  const heights = course.use === "road" ? graded(drawn, arcs(out), course.grade) : drawn;
  if (course.use === "river") runDown(heights);
  for (const [i, z] of heights.entries()) out[3 * i + 2] = z;
  return out;
}

/** The part of a style that a stroke keeps as its course. */
export function courseOf({ use, grade, depthM }: CourseStyle): Omit<Course, "rises"> {
  return { use, grade, depth_m: depthM };
}

/** Style fields of a new course. */
export function courseSection(
  style: CourseStyle,
): Pick<Stroke, "left" | "right" | "plateau_radius_m" | "amplitude_m" | "roughness"> {
  const side = bank(style.bankM);
  return {
    left: side,
    right: side === null ? null : { ...side },
    plateau_radius_m: style.widthM / 2,
    amplitude_m: 0,
    roughness: 0.5,
  };
}

function smooth(t: number): number {
  return t * t * (3 - 2 * t);
}

function reversed(line: Float64Array): Float64Array {
  const out = new Float64Array(line.length);
  for (let i = 0; i < line.length; i += 3) out.set(line.subarray(i, i + 3), line.length - 3 - i);
  return out;
}
