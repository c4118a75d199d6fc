/** One drag of a handle: the place of the pointer gives the ops that bring the stroke there (DESIGN 12). Pure. */

import type { Camera } from "../../core/camera/camera.ts";
import { along, rayPlane } from "../../core/geometry.ts";
import { distance } from "../../core/math.ts";
import type { Ground, Ray, Vec3 } from "../../core/types.ts";
import type { Op, Stroke } from "../../generated/contract.ts";
import { bank } from "../sketch/courseline.ts";
import { anchorOn, curveOps, metres, roundCurve, solvedHeight } from "../sketch/strokeops.ts";
import { vertexOps } from "./coursedrag.ts";
import {
  across,
  crestIndex,
  flankWithFoot,
  type HandleKind,
  type HandleVisual,
  reliefBeside,
  type Section,
  sectionOf,
} from "./handles.ts";
import { brushRadius } from "./painttool.ts";

/** A plane near the horizon turns a pixel into kilometres: farther than this many times the handle is not believed. */
const FAR = 4;
/** A crest lower than this over its anchors is raised by a bump: it has no shape to scale. */
const FLAT_CREST_M = 1;

export interface DragStart {
  readonly stroke: Stroke;
  readonly handle: Pick<HandleVisual, "kind" | "position">;
  readonly camera: Camera;
  /** Frozen for this drag. */
  readonly ground: Ground;
  /** Where the pointer took the handle, device pixels. */
  readonly x: number;
  readonly y: number;
}

export class HandleDrag {
  readonly kind: HandleKind;
  readonly #o: DragStart;
  readonly #section: Section;
  /** From the pointer to the handle, so that it does not jump when it is taken. */
  readonly #dx: number;
  readonly #dy: number;
  readonly #range: number;

  constructor(start: DragStart) {
    this.#o = start;
    this.kind = start.handle.kind;
    this.#section = sectionOf(start.stroke);
    const p = start.camera.project(start.handle.position);
    this.#dx = p.x - start.x;
    this.#dy = p.y - start.y;
    this.#range = distance(start.camera.ray(p.x, p.y).origin, start.handle.position);
  }

  /** The ops for the pointer at (x, y); `both` drags equal flanks together. Empty when the place makes no sense. */
  ops(x: number, y: number, both = true): Op[] {
    const ray = this.#o.camera.ray(x + this.#dx, y + this.#dy);
    const { stroke, ground } = this.#o;
    if (stroke.course !== null && this.kind.startsWith("vertex-"))
      return vertexOps(stroke, Number(this.kind.slice(7)), both ? this.#onGround(ray) : this.#rise(ray, y), ground);
    if (stroke.course !== null && this.kind === "radius") return this.#bank(ray);
    switch (this.kind) {
      case "first":
      case "last":
        return this.#anchor(ray, this.kind);
      case "crest":
        return this.#crest(ray, y);
      case "left":
      case "right":
        return this.#flank(ray, this.kind, both);
      case "radius":
        return this.#radius(ray);
      case "move":
        return this.#move(ray);
      default:
        return [];
    }
  }

  #anchor(ray: Ray, which: "first" | "last"): Op[] {
    const { stroke, ground } = this.#o;
    const point = this.#onGround(ray);
    if (point === null) return [];
    const to = anchorOn(ground, point);
    if (stroke.kind === "profile") return [{ type: "stroke.anchor", stroke: stroke.id, which, to }];
    // A level stroke lies at the height of its first anchor; the last only turns and scales it.
    if (which === "last") {
      to[2] = stroke.first[2];
      return [{ type: "stroke.anchor", stroke: stroke.id, which, to }];
    }
    const last = metres([stroke.last[0], stroke.last[1], to[2]]);
    return [{ type: "stroke.set", stroke: stroke.id, fields: { first: to, last } }];
  }

  /** The ground under the pen; beside it, or far away, the ground under the plane through the handle. */
  #onGround(ray: Ray): Vec3 | null {
    const hit = this.#o.ground.raycast(ray);
    return hit !== null && distance(ray.origin, hit) <= FAR * this.#range ? hit : this.#drop(ray);
  }

  /** The pen's point on the camera-facing vertical plane through the handle, dropped on the ground. */
  #drop(ray: Ray): Vec3 | null {
    const point = this.#onFacingPlane(ray);
    return point === null ? null : [point[0], point[1], this.#o.ground.heightAt(point[0], point[1])];
  }

  #onFacingPlane(ray: Ray): Vec3 | null {
    const { position } = this.#o.handle;
    const { eye } = this.#o.camera.state.value;
    const flat = Math.hypot(position[0] - eye[0], position[1] - eye[1]);
    if (flat < 1e-6) return null;
    const normal: Vec3 = [(position[0] - eye[0]) / flat, (position[1] - eye[1]) / flat, 0];
    const t = rayPlane(ray, position, normal);
    return t === null || t > FAR * this.#range ? null : along(ray, t);
  }

  #crest(ray: Ray, y: number): Op[] {
    const rise = this.#rise(ray, y);
    return rise === null ? [] : raiseOps(this.#o.stroke, rise);
  }

  /** How far above the handle the pen is, metres; seen from above, how far up on the screen. */
  #rise(ray: Ray, y: number): number | null {
    const { handle, camera } = this.#o;
    const steep = camera.state.value.mode === "map" || Math.abs(ray.dir[2]) > 0.978;
    if (steep) return (this.#o.y - y) * camera.metresPerPixelAt(handle.position);
    const point = this.#onFacingPlane(ray);
    return point === null ? null : point[2] - handle.position[2];
  }

  /** Both banks of a course, by where one of them ends. */
  #bank(ray: Ray): Op[] {
    const { stroke, ground } = this.#o;
    const point = this.#onLevel(ray);
    if (point === null) return [];
    const [cx, cy] = across(this.#section, 0);
    const away = Math.hypot(point[0] - cx, point[1] - cy) - stroke.plateau_radius_m;
    const side = bank(Math.round(10 * Math.max(ground.sizeM / 1024, Math.min(ground.sizeM / 8, away))) / 10);
    return [{ type: "stroke.set", stroke: stroke.id, fields: { left: side, right: side } }];
  }

  #flank(ray: Ray, side: "left" | "right", both: boolean): Op[] {
    const { stroke, ground } = this.#o;
    const flank = stroke[side];
    const point = this.#onLevel(ray);
    if (flank === null || point === null) return [];
    const sign = side === "left" ? 1 : -1;
    const [cx, cy] = across(this.#section, 0);
    const out = (point[0] - cx) * this.#section.left[0] + (point[1] - cy) * this.#section.left[1];
    const foot = Math.max(ground.sizeM / 4000, Math.min(ground.sizeM, sign * out - stroke.plateau_radius_m));
    const next = flankWithFoot(flank, reliefBeside(stroke, this.#section, flank, sign, ground), foot);
    const other = side === "left" ? stroke.right : stroke.left;
    const linked = both && other !== null && JSON.stringify(other) === JSON.stringify(flank);
    const fields = linked ? { left: next, right: { ...next } } : { [side]: next };
    return [{ type: "stroke.set", stroke: stroke.id, fields }];
  }

  #radius(ray: Ray): Op[] {
    const { stroke, ground } = this.#o;
    const point = this.#onLevel(ray);
    if (stroke.paint === null || point === null) return [];
    const [cx, cy] = across(this.#section, 0);
    const radius_m = brushRadius(Math.hypot(point[0] - cx, point[1] - cy), ground.sizeM);
    return [{ type: "stroke.set", stroke: stroke.id, fields: { paint: { ...stroke.paint, radius_m } } }];
  }

  #move(ray: Ray): Op[] {
    const point = this.#onLevel(ray);
    if (point === null) return [];
    const { position } = this.#o.handle;
    return moveOps(this.#o.stroke, point[0] - position[0], point[1] - position[1], this.#o.ground);
  }

  /** The ray on the horizontal plane of the handle: dragging does not depend on the stroke's own, moving ground. */
  #onLevel(ray: Ray): Vec3 | null {
    const t = rayPlane(ray, this.#o.handle.position, [0, 0, 1]);
    return t === null || t > FAR * this.#range ? null : along(ray, t);
  }
}

/** Ops that raise the crest by `rise` metres: a profile is scaled (or bulged when flat), a level stroke lifted. */
export function raiseOps(stroke: Stroke, rise: number): Op[] {
  if (stroke.kind !== "profile") {
    const lift = (p: Vec3): [number, number, number] => metres([p[0], p[1], stroke.first[2] + rise]);
    return [{ type: "stroke.set", stroke: stroke.id, fields: { first: lift(stroke.first), last: lift(stroke.last) } }];
  }
  const crest = stroke.curve[crestIndex(stroke)]?.[1] ?? 0;
  const scaled = Math.abs(crest) >= FLAT_CREST_M;
  const k = (crest + rise) / crest;
  const bump = (u: number): number => (u <= 0 || u >= 1 ? 0 : Math.sin(Math.PI * u) ** 2);
  const curve = stroke.curve.map(([u, w]): [number, number] => [u, scaled ? w * k : w + rise * bump(u)]);
  return curveOps(stroke, roundCurve("profile", curve));
}

/** Ops that move a stroke over the ground; its height follows the ground under its anchors. */
export function moveOps(stroke: Stroke, dx: number, dy: number, ground: Ground): Op[] {
  const moved = (p: Vec3): [number, number, number] => {
    const rise = solvedHeight(ground, p[0] + dx, p[1] + dy) - solvedHeight(ground, p[0], p[1]);
    return metres([p[0] + dx, p[1] + dy, p[2] + rise]);
  };
  const first = moved(stroke.first);
  const last = moved(stroke.last);
  if (stroke.kind === "level") last[2] = first[2];
  return [{ type: "stroke.set", stroke: stroke.id, fields: { first, last } }];
}
