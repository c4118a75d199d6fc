/** Mountains and crevices: a line on the vertical plane through the first hit and the current end (DESIGN 12). */

import type { Camera } from "../../core/camera/camera.ts";
import { along, pathLength, rayPlane, simplifyTo } from "../../core/geometry.ts";
import { clamp, cross, DEG, distance, distanceXY, normalize, sub } from "../../core/math.ts";
import type { Ground, Ray, Vec3 } from "../../core/types.ts";
import { endOnGround, endPixel, type Sense, wayOf } from "./profileend.ts";
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
/** Points farther from the eye than this many times the first hit are not believed. */
const FAR_POINT = 8;
/** Time in which a turning plane covers 63 % of its way. */
const TURN_TAU_MS = 70;
/** Anchors closer than this share of the length of the line make no usable frame. */
const CLOSED = 0.05;

export class ProfileSketch implements Sketch {
  readonly #camera: Camera;
  readonly #ground: Ground;
  readonly #first: Vec3;
  readonly #firstRange: number;
  readonly #sense: Sense;
  readonly #samples: Sample[];
  /** Direction of the line of sight at the start on the map. */
  readonly #sight: readonly [number, number];
  readonly #steepness: number;
  /** Direction of the plane that faces the picture: parallel to its rows. */
  readonly #facing: number;
  /** Direction of the plane on the map, radians from east; a plane has no sign, so it lives modulo π. */
  #angle: number;
  #target: number;
  #turnedAt: number;
  /** Side of the line of sight on which the plane was last: it does not flicker across. */
  #side: 1 | -1;
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
    const right = normalize(cross(sub(target, eye), up));
    this.#facing = Math.atan2(right[1], right[0]);
    const { dir } = start.sample.ray;
    const flat = Math.hypot(dir[0], dir[1]);
    this.#sight = flat > 1e-6 ? [dir[0] / flat, dir[1] / flat] : [-right[1], right[0]];
    this.#steepness = flat;
    this.#angle = this.#facing;
    this.#side = turn(Math.atan2(this.#sight[1], this.#sight[0]), this.#facing) > 0 ? 1 : -1;
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
    this.#climb = Math.max(this.#climb, wayOf(this.#samples[0]!, sample, this.#sense));
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

  /** Turns the plane toward where the line will end, as far as that is known; until then it faces the picture. */
  #aim(released: boolean): void {
    const [start, pen] = [this.#samples[0]!, this.#samples.at(-1)!];
    const { height } = this.#camera.state.value;
    const found = endPixel(start, pen, this.#climb, this.#sense, height, released);
    this.#target = this.#clampToSight(this.#facing, false);
    if (found === null || found.say === 0) return;
    const ray = found.at === pen ? pen.ray : smoothedRay(this.#camera, pen, found.at.x, found.at.y);
    const end = endOnGround(ray, this.#ground, this.#first, this.#firstRange);
    if (end === null || distanceXY(end, this.#first) === 0) return;
    const toEnd = this.#clampToSight(Math.atan2(end[1] - this.#first[1], end[0] - this.#first[0]), true);
    this.#target += found.say * turn(this.#target, toEnd);
  }

  /** The nearest direction that is far enough from the line of sight; `remember`: its side is kept from now on. */
  #clampToSight(angle: number, remember: boolean): number {
    const sight = Math.atan2(this.#sight[1], this.#sight[0]);
    const off = turn(sight, angle);
    // Looking steeply down no vertical plane is far from the line of sight; then only facing planes are left.
    const least = clamp(SIGHT_ANGLE / Math.max(0.3, this.#steepness), SIGHT_ANGLE, 60 * DEG);
    if (Math.abs(off) >= least) {
      if (remember) this.#side = off > 0 ? 1 : -1;
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
