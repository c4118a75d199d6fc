/**
 * From pen samples to a stroke (DESIGN 12; paper 0, III-B). Pure but for the samples it collects: no events, no ops.
 *
 * Every sample is a ray of the camera at its moment, so a plane that turns re-projects them all. The ground is the one
 * that was drawn when the pen came down; nothing that changes afterwards moves the sketch.
 */

import type { Camera } from "../../core/camera/camera.ts";
import { add, sub } from "../../core/math.ts";
import type { Ground, Ray, Vec3 } from "../../core/types.ts";

export interface Sample {
  /** Device pixels. */
  readonly x: number;
  readonly y: number;
  readonly ray: Ray;
  /** 0..1; 0.5 where the device knows none. */
  readonly pressure: number;
}

/** Anchors and world points (xyz triples) of what has been sketched so far. */
export interface SketchShape {
  readonly first: Vec3;
  readonly last: Vec3;
  readonly points: Float64Array;
}

export interface Sketch {
  add(sample: Sample): void;
  /** The present shape, with at most `most` points; `exact` ends all smoothing in time. */
  shape(nowMs: number, exact: boolean, most: number): SketchShape;
  /** True while the shape still changes although the pen rests. */
  readonly settling: boolean;
  /** Corners of the plane that is drawn on; null where the ground itself is. */
  corners(shape: SketchShape): readonly [Vec3, Vec3, Vec3, Vec3] | null;
}

export interface SketchStart {
  readonly camera: Camera;
  readonly ground: Ground;
  /** Where the first ray met the ground. */
  readonly hit: Vec3;
  readonly sample: Sample;
  readonly nowMs: number;
}

/** Tolerance of the simplification in device pixels. */
export const SIMPLIFY_PX = 1;
/** Neighbouring samples nearer than this, in device pixels, are averaged. */
export const SMOOTH_PX = 8;

/**
 * Samples as xy pixels with their jitter averaged away: integer mouse positions would otherwise become stairs on the
 * crest. Neighbours closer than 8 px count with (1 2 1)/4; the ends stay.
 */
export function smoothPixels(samples: readonly Sample[]): Float64Array {
  const out = new Float64Array(2 * samples.length);
  for (const [i, s] of samples.entries()) {
    const before = samples[i - 1];
    const after = samples[i + 1];
    const near = (o: Sample | undefined): o is Sample =>
      o !== undefined && Math.hypot(o.x - s.x, o.y - s.y) < SMOOTH_PX;
    const soft = near(before) && near(after);
    out[2 * i] = soft ? (before.x + 2 * s.x + after.x) / 4 : s.x;
    out[2 * i + 1] = soft ? (before.y + 2 * s.y + after.y) / 4 : s.y;
  }
  return out;
}

/** The ray of a smoothed sample: its own, moved by the little that smoothing changed. */
export function smoothedRay(camera: Camera, sample: Sample, x: number, y: number): Ray {
  if (x === sample.x && y === sample.y) return sample.ray;
  const a = camera.ray(sample.x, sample.y);
  const b = camera.ray(x, y);
  const { origin, dir } = sample.ray;
  return { origin: add(origin, sub(b.origin, a.origin)), dir: add(dir, sub(b.dir, a.dir)) };
}

/**
 * The point of the path (xyz triples) that makes a usable frame with `first` although the path ends near it: the one
 * farthest away on the map.
 */
export function farthest(points: ArrayLike<number>, first: Vec3): Vec3 {
  let best: Vec3 = first;
  let most = -1;
  for (let i = 0; i < points.length; i += 3) {
    const d = Math.hypot(points[i]! - first[0], points[i + 1]! - first[1]);
    if (d > most) {
      most = d;
      best = [points[i]!, points[i + 1]!, points[i + 2]!];
    }
  }
  return best;
}

/** Average pen pressure of the samples, 0..1. */
export function meanPressure(samples: readonly Sample[]): number {
  return samples.reduce((sum, s) => sum + s.pressure, 0) / Math.max(1, samples.length);
}
