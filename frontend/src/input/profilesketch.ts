/** Mountains and crevices: a line on the vertical plane through the first hit and the current end (DESIGN 12). */

import type { Camera } from "../core/camera.ts";
import { along, pathLength, rayPlane, simplifyTo } from "../core/geometry.ts";
import { clamp, DEG, distance, distanceXY } from "../core/math.ts";
import type { Ground, Ray, Vec3 } from "../core/types.ts";
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

/** The plane never turns closer than this to the line of sight: the projection stays well conditioned. */
const SIGHT_ANGLE = 20 * DEG;
/** A hit farther than this many times the first one is behind what the pen draws over. */
const FAR_HIT = 4;
/** Points farther from the eye than this many times the first hit are not believed. */
const FAR_POINT = 8;
/** Time in which a turning plane covers 63 % of its way. */
const TURN_TAU_MS = 70;
/** Below this distance from the start, in pixels, the end gives no direction. */
const DIRECTION_PX = 10;
/** Anchors closer than this share of the length of the line make no usable frame. */
const CLOSED = 0.05;

/** A climb below this share of the canvas height is a line along the ground, not a pen in the air. */
const CLIMB = 0.015;
/**
 * Share of its climb that the pen must have come back before its ray's end on the ground counts: much while it moves,
 * so that saddles between peaks do not swing the plane; less at the end, so that a ridge may end on farther ground.
 */
const BACK_LIVE = 0.6;
const BACK_END = 0.25;

export type Sense = "up" | "down";

export class ProfileSketch implements Sketch {
  readonly #camera: Camera;
  readonly #ground: Ground;
  readonly #first: Vec3;
  readonly #firstRange: number;
  readonly #sense: Sense;
  readonly #samples: Sample[];
  /** Direction of the line of sight at the start on the map, and of the camera's right hand. */
  readonly #sight: readonly [number, number];
  readonly #steepness: number;
  /** Direction of the plane on the map, radians from east; a plane has no sign, so it lives modulo π. */
  #angle: number;
  #target: number;
  #turnedAt: number;
  /** Side of the line of sight on which the plane was last: it does not flicker across. */
  #side: 1 | -1 = 1;
  /** Farthest way of the pen on the screen from its start to the tool's side, device pixels. */
  #climb = 0;

  constructor(start: SketchStart, sense: Sense) {
    this.#camera = start.camera;
    this.#ground = start.ground;
    this.#first = [start.hit[0], start.hit[1], start.ground.heightAt(start.hit[0], start.hit[1])];
    this.#firstRange = distance(start.sample.ray.origin, start.hit);
    this.#sense = sense;
    this.#samples = [start.sample];
    const { eye, target, up } = start.camera.state.value;
    const { dir } = start.sample.ray;
    const flat = Math.hypot(dir[0], dir[1]);
    const toward: readonly [number, number] = flat > 1e-6 ? [dir[0] / flat, dir[1] / flat] : headingOf(eye, target, up);
    this.#sight = toward;
    this.#steepness = flat;
    this.#angle = Math.atan2(-toward[0], toward[1]); // the camera-facing plane
    this.#target = this.#angle;
    this.#turnedAt = start.nowMs;
  }

  get samples(): readonly Sample[] {
    return this.#samples;
  }

  get settling(): boolean {
    return Math.abs(turn(this.#angle, this.#target)) > 0.2 * DEG;
  }

  add(sample: Sample): void {
    this.#samples.push(sample);
    this.#climb = Math.max(this.#climb, this.#way(sample));
  }

  shape(nowMs: number, exact: boolean, most: number): SketchShape {
    this.#aim(exact);
    const rested = 1 - Math.exp(-Math.max(0, nowMs - this.#turnedAt) / TURN_TAU_MS);
    this.#angle += turn(this.#angle, this.#target) * (exact ? 1 : rested);
    this.#turnedAt = nowMs;
    const pixels = smoothPixels(this.#samples);
    const kept = simplifyTo(pixels, SIMPLIFY_PX, most);
    const points: number[] = [...this.#first];
    for (const i of kept.slice(1)) {
      const ray = smoothedRay(this.#camera, this.#samples[i]!, pixels[2 * i]!, pixels[2 * i + 1]!);
      const p = this.#project(ray);
      if (p !== null) points.push(...p);
    }
    const path = new Float64Array(points);
    return { first: this.#first, last: this.#lastAnchor(path), points: path };
  }

  corners(shape: SketchShape): readonly [Vec3, Vec3, Vec3, Vec3] {
    const d: readonly [number, number] = [Math.cos(this.#angle), Math.sin(this.#angle)];
    let [u0, u1, z0, z1] = [0, 0, shape.first[2], shape.first[2]];
    for (let i = 0; i < shape.points.length; i += 3) {
      const u = (shape.points[i]! - shape.first[0]) * d[0] + (shape.points[i + 1]! - shape.first[1]) * d[1];
      u0 = Math.min(u0, u);
      u1 = Math.max(u1, u);
      z0 = Math.min(z0, shape.points[i + 2]!);
      z1 = Math.max(z1, shape.points[i + 2]!);
    }
    const margin = 0.08 * Math.max(u1 - u0, z1 - z0) + 1;
    const at = (u: number, z: number): Vec3 => [shape.first[0] + u * d[0], shape.first[1] + u * d[1], z];
    return [
      at(u0 - margin, z0 - margin),
      at(u1 + margin, z0 - margin),
      at(u1 + margin, z1 + margin),
      at(u0 - margin, z1 + margin),
    ];
  }

  /** Turns the plane toward where the pen is now. */
  #aim(exact: boolean): void {
    const sample = this.#samples.at(-1)!;
    const end = this.#end(sample.ray, this.#inTheAir(sample, exact));
    if (end === null) return;
    const metresPerPixel =
      (2 * this.#firstRange * Math.tan(0.5 * DEG * this.#camera.state.value.fovDeg)) / this.#camera.state.value.height;
    if (distanceXY(end, this.#first) < DIRECTION_PX * metresPerPixel) return;
    this.#target = this.#clampToSight(Math.atan2(end[1] - this.#first[1], end[0] - this.#first[0]));
  }

  /** How far the sample lies from the start to the tool's side on the screen: up for a mountain, down for a crevice. */
  #way(sample: Sample): number {
    const up = this.#samples[0]!.y - sample.y;
    return this.#sense === "up" ? up : -up;
  }

  /**
   * Whether the pen is over a silhouette rather than over its end: it has climbed and not come back. The ground behind
   * it is then only background: a plane through it would lay the line flat on that ground (docs/decisions).
   */
  #inTheAir(sample: Sample, exact: boolean): boolean {
    if (this.#climb < CLIMB * this.#camera.state.value.height) return false;
    return this.#climb - this.#way(sample) < (exact ? BACK_END : BACK_LIVE) * this.#climb;
  }

  /** Where the pen's ray ends on the ground; in the air or far behind, the drop of the pen's point. */
  #end(ray: Ray, inTheAir: boolean): Vec3 | null {
    const hit = inTheAir ? null : this.#ground.raycast(ray);
    if (hit !== null && distance(ray.origin, hit) <= FAR_HIT * this.#firstRange) return hit;
    const facing: Vec3 = [this.#sight[0], this.#sight[1], 0];
    const t = rayPlane(ray, this.#first, facing);
    if (t === null) return null;
    const p = along(ray, t);
    return [p[0], p[1], this.#ground.heightAt(p[0], p[1])];
  }

  #clampToSight(angle: number): number {
    const sight = Math.atan2(this.#sight[1], this.#sight[0]);
    const off = turn(sight, angle);
    // Looking steeply down no vertical plane is far from the line of sight; then only facing planes are left.
    const least = clamp(SIGHT_ANGLE / Math.max(0.3, this.#steepness), SIGHT_ANGLE, 60 * DEG);
    if (Math.abs(off) >= least) {
      this.#side = off > 0 ? 1 : -1;
      return angle;
    }
    return sight + this.#side * least;
  }

  /** The ray's point on the present plane, kept on the tool's side of the ground; null when it is not to be believed. */
  #project(ray: Ray): Vec3 | null {
    const normal: Vec3 = [-Math.sin(this.#angle), Math.cos(this.#angle), 0];
    const t = rayPlane(ray, this.#first, normal);
    if (t === null || t > FAR_POINT * this.#firstRange) return null;
    const p = along(ray, t);
    const floor = this.#ground.heightAt(p[0], p[1]);
    return [p[0], p[1], this.#sense === "up" ? Math.max(p[2], floor) : Math.min(p[2], floor)];
  }

  /** The foot of the last point; where that is next to the first anchor, of the point farthest from it. */
  #lastAnchor(points: Float64Array): Vec3 {
    const n = points.length;
    let end: Vec3 = [points[n - 3]!, points[n - 2]!, points[n - 1]!];
    if (distanceXY(end, this.#first) < CLOSED * pathLength(points, 3)) end = farthest(points, this.#first);
    const least = 1e-3 * this.#firstRange;
    if (distanceXY(end, this.#first) < least)
      end = [this.#first[0] + least * Math.cos(this.#angle), this.#first[1] + least * Math.sin(this.#angle), 0];
    return [end[0], end[1], this.#ground.heightAt(end[0], end[1])];
  }
}

/** The turn from plane direction `a` to `b`, in (-π/2, π/2]: planes have no sign. */
function turn(a: number, b: number): number {
  const d = (b - a) / Math.PI;
  return (d - Math.round(d)) * Math.PI;
}

function headingOf(eye: Vec3, target: Vec3, up: Vec3): readonly [number, number] {
  const d = [target[0] - eye[0], target[1] - eye[1]];
  const flat = Math.hypot(d[0]!, d[1]!);
  if (flat > 1e-6) return [d[0]! / flat, d[1]! / flat];
  const n = Math.hypot(up[0], up[1]) || 1;
  return [up[0] / n, up[1] / n];
}
