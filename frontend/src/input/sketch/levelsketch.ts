/** Plateaux on the horizontal plane of the first hit, and straight ridges on the map (DESIGN 12). */

import type { Camera } from "../../core/camera/camera.ts";
import { along, pathLength, rayPlane, simplifyTo } from "../../core/geometry.ts";
import { distance, distanceXY } from "../../core/math.ts";
import type { Ground, Ray, Vec3 } from "../../core/types.ts";
import type { Sense } from "./profileend.ts";
import {
  farthest,
  type Sample,
  SIMPLIFY_PX,
  type Sketch,
  type SketchShape,
  type SketchStart,
  smoothedRay,
  smoothPixels,
} from "./sketch.ts";

/** Points farther from the eye than this many times the first hit are not believed: the plane meets the horizon. */
const FAR_POINT = 6;
/** A line that comes back to within this share of its length is an outline. */
const CLOSED = 0.25;

/** The horizontal plane through the first hit, and the point of a ray on it; null near the horizon. */
class HorizontalPlane {
  readonly first: Vec3;
  readonly #range: number;

  constructor(start: SketchStart) {
    this.first = [start.hit[0], start.hit[1], start.ground.heightAt(start.hit[0], start.hit[1])];
    this.#range = distance(start.sample.ray.origin, start.hit);
  }

  point(ray: Ray): Vec3 | null {
    const t = rayPlane(ray, this.first, [0, 0, 1]);
    if (t === null || t > FAR_POINT * this.#range) return null;
    const p = along(ray, t);
    return [p[0], p[1], this.first[2]];
  }
}

export class LevelSketch implements Sketch {
  readonly #camera: Camera;
  readonly #plane: HorizontalPlane;
  readonly #samples: Sample[];
  readonly settling = false;

  constructor(start: SketchStart) {
    this.#camera = start.camera;
    this.#plane = new HorizontalPlane(start);
    this.#samples = [start.sample];
  }

  get samples(): readonly Sample[] {
    return this.#samples;
  }

  add(sample: Sample): void {
    if (this.#plane.point(sample.ray) !== null) this.#samples.push(sample);
  }

  shape(_nowMs: number, _exact: boolean, most: number): SketchShape {
    const { first } = this.#plane;
    const pixels = smoothPixels(this.#samples);
    const points: number[] = [...first];
    for (const i of simplifyTo(pixels, SIMPLIFY_PX, most).slice(1)) {
      const p = this.#plane.point(smoothedRay(this.#camera, this.#samples[i]!, pixels[2 * i]!, pixels[2 * i + 1]!));
      if (p !== null) points.push(...p);
    }
    const path = new Float64Array(points);
    const n = path.length;
    let last: Vec3 = [path[n - 3]!, path[n - 2]!, first[2]];
    if (distanceXY(last, first) < CLOSED * pathLength(path, 3)) last = farthest(path, first);
    return { first, last, points: path };
  }

  corners(shape: SketchShape): readonly [Vec3, Vec3, Vec3, Vec3] {
    const xs = shape.points.filter((_, i) => i % 3 === 0);
    const ys = shape.points.filter((_, i) => i % 3 === 1);
    const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const m = 0.1 * Math.max(x1 - x0, y1 - y0) + 1;
    const z = shape.first[2];
    return [
      [x0 - m, y0 - m, z],
      [x1 + m, y0 - m, z],
      [x1 + m, y1 + m, z],
      [x0 - m, y1 + m, z],
    ];
  }
}

const RIDGE_POINTS = 17;
/** Height of the default profile as a share of the length of the ridge. */
const RIDGE_HEIGHT = 0.25;

/**
 * Seen from above, height has no direction on the screen: a mountain or crevice is a straight ridge from the first to
 * the last point, with a smooth default profile that the crest handle changes.
 */
export class RidgeSketch implements Sketch {
  readonly #ground: Ground;
  readonly #plane: HorizontalPlane;
  readonly #sign: number;
  readonly #samples: Sample[];
  readonly settling = false;

  constructor(start: SketchStart, sense: Sense) {
    this.#ground = start.ground;
    this.#plane = new HorizontalPlane(start);
    this.#sign = sense === "up" ? 1 : -1;
    this.#samples = [start.sample];
  }

  get samples(): readonly Sample[] {
    return this.#samples;
  }

  add(sample: Sample): void {
    if (this.#plane.point(sample.ray) !== null) this.#samples.push(sample);
  }

  shape(): SketchShape {
    const { first } = this.#plane;
    const end = this.#ground.raycast(this.#samples.at(-1)!.ray) ?? this.#plane.point(this.#samples.at(-1)!.ray)!;
    const last: Vec3 = [end[0], end[1], this.#ground.heightAt(end[0], end[1])];
    const height = this.#sign * RIDGE_HEIGHT * distanceXY(first, last);
    const points = new Float64Array(3 * RIDGE_POINTS);
    for (let i = 0; i < RIDGE_POINTS; i++) {
      const u = i / (RIDGE_POINTS - 1);
      const bump = (1 - (2 * u - 1) ** 2) ** 2;
      const foot = first[2] + u * (last[2] - first[2]);
      points.set(
        [first[0] + u * (last[0] - first[0]), first[1] + u * (last[1] - first[1]), foot + height * bump],
        3 * i,
      );
    }
    return { first, last, points };
  }

  corners(shape: SketchShape): readonly [Vec3, Vec3, Vec3, Vec3] {
    const { first, last } = shape;
    const top = this.#sign * RIDGE_HEIGHT * distanceXY(first, last);
    return [first, last, [last[0], last[1], last[2] + top], [first[0], first[1], first[2] + top]];
  }
}
