/**
 * The brush: a line on the ground that paints one channel of the detail within its radius (DESIGN 10; paper 1, interactive
 * painting). It is a stroke like any other, in the frame of its anchors; no height follows from it.
 */

import { pathLength, simplifyTo } from "../../core/geometry.ts";
import { distance, distanceXY } from "../../core/math.ts";
import type { Ground, Vec3 } from "../../core/types.ts";
import type { Paint, PaintChannel, Stroke } from "../../generated/contract.ts";
import {
  farthest,
  type Sample,
  SIMPLIFY_PX,
  type Sketch,
  type SketchShape,
  type SketchStart,
  SMOOTH_PX,
} from "../sketch/sketch.ts";

/** Channels in the order in which a key and the inspector go through them. */
export const PAINT_CHANNELS: readonly PaintChannel[] = [
  "snow",
  "forest",
  "grass",
  "wetness",
  "roughness",
  "amplitude",
  "erosion",
];

/** A line that comes back to within this share of its length has its last anchor where it is farthest from the first. */
const CLOSED = 0.25;
/** A ray that lands farther than this many times the first hit has slipped over a crest: the brush did not jump there. */
const FAR_HIT = 6;
/** A dab is a line this long, in radii: an anchor needs another to make a frame. */
const DAB = 0.05;
/** Radius at no pressure and at full pressure, in parts of the chosen one. */
const LIGHT = 0.35;
const FIRM = 1.25;

/** The least and the greatest radius of a brush on a terrain of `sizeM` metres. */
export function radiusRange(sizeM: number): readonly [number, number] {
  return [sizeM / 1024, sizeM / 4];
}

/** Three significant digits within the range: what a slider and a key can mean. */
export function brushRadius(radiusM: number, sizeM: number): number {
  const [least, most] = radiusRange(sizeM);
  return Number(Math.min(most, Math.max(least, radiusM)).toPrecision(3));
}

/** The brush under a pen's mean pressure 0..1. */
export function pressedPaint(paint: Paint, pressure: number): Paint {
  return { ...paint, radius_m: Number((paint.radius_m * (LIGHT + (FIRM - LIGHT) * pressure)).toPrecision(3)) };
}

/** The fields of a stroke that mean nothing to paint. */
export const NO_SECTION: Pick<Stroke, "left" | "right" | "plateau_radius_m" | "amplitude_m" | "roughness"> = {
  left: null,
  right: null,
  plateau_radius_m: 0,
  amplitude_m: 0,
  roughness: 0.5,
};

/** A sample of the brush and where it touched the ground. */
interface Touch {
  readonly sample: Sample;
  readonly at: Vec3;
}

export class BrushSketch implements Sketch {
  readonly settling = false;
  readonly #ground: Ground;
  readonly #range: number;
  /** A pixel where the line began, metres. */
  readonly #tolerance: number;
  readonly #touches: Touch[];
  readonly #samples: Sample[];

  constructor(start: SketchStart) {
    this.#ground = start.ground;
    this.#range = distance(start.sample.ray.origin, start.hit);
    this.#tolerance = SIMPLIFY_PX * start.camera.metresPerPixelAt(start.hit);
    this.#touches = [{ sample: start.sample, at: start.hit }];
    this.#samples = [start.sample];
  }

  get samples(): readonly Sample[] {
    return this.#samples;
  }

  add(sample: Sample): void {
    const at = this.#ground.raycast(sample.ray);
    if (at === null || distance(sample.ray.origin, at) > FAR_HIT * this.#range) return;
    this.#touches.push({ sample, at });
    this.#samples.push(sample);
  }

  shape(_nowMs: number, _exact: boolean, most: number): SketchShape {
    // On the map, not on the screen: what is straight there bends over a hill.
    const xy = this.#touches.flatMap(({ at }) => [at[0], at[1]]);
    const path = new Float64Array(simplifyTo(xy, this.#tolerance, most).flatMap((i) => this.#smoothed(i)));
    const first = this.#touches[0]!.at;
    const n = path.length;
    let last: Vec3 = [path[n - 3]!, path[n - 2]!, path[n - 1]!];
    if (distanceXY(last, first) < CLOSED * pathLength(path, 3)) last = farthest(path, first);
    return { first, last, points: path };
  }

  /** A brush draws on the ground itself: there is no plane to show. */
  corners(): null {
    return null;
  }

  /** Where a sample touched, its jitter averaged away as `smoothPixels` does it. */
  #smoothed(i: number): readonly number[] {
    const [before, here, after] = [this.#touches[i - 1], this.#touches[i]!, this.#touches[i + 1]];
    if (before === undefined || after === undefined || !near(before, here) || !near(after, here)) return here.at;
    return here.at.map((v, k) => (before.at[k]! + 2 * v + after.at[k]!) / 4);
  }
}

function near(a: Touch, b: Touch): boolean {
  return Math.hypot(a.sample.x - b.sample.x, a.sample.y - b.sample.y) < SMOOTH_PX;
}

/** The shape of a dab: one touch of the brush, as a line much shorter than its radius. */
export function dabShape({ hit, sample, ground }: SketchStart, radiusM: number): SketchShape {
  const { dir } = sample.ray;
  const flat = Math.hypot(dir[0], dir[1]);
  const [dx, dy] = flat > 1e-6 ? [dir[1] / flat, -dir[0] / flat] : [1, 0];
  const x = hit[0] + DAB * radiusM * dx;
  const y = hit[1] + DAB * radiusM * dy;
  const last: Vec3 = [x, y, ground.heightAt(x, y)];
  return { first: hit, last, points: new Float64Array([...hit, ...last]) };
}
