/** The handles of an elevation grid that is being placed on the ground, and what dragging one does. Pure. */

import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import type { Camera } from "../../core/camera/camera.ts";
import { along, rayPlane } from "../../core/geometry.ts";
import { fixed } from "../../core/language.ts";
import {
  centreOf,
  covers,
  extentOf,
  type GridPlace,
  type GridShape,
  latticeCorners,
  latticeOf,
  latticePoint,
  moved,
  type Point,
  respaced,
  turned,
  wrapDegrees,
} from "../../core/lattice.ts";
import { clamp, DEG, distance } from "../../core/math.ts";
import type { Ground, Ray, Vec3 } from "../../core/types.ts";

/** A grid that somebody lays: a file that has no place of its own yet, or a layer that is moved. */
export interface Placing extends GridShape {
  readonly id: string;
  /** Lowest and highest sample, before scale and lift, metres. */
  readonly low_m: number;
  readonly high_m: number;
  readonly place: ReadonlySignal<GridPlace>;
  /** Lays it anew; changes of one gesture belong together. The sentence of a refusal, or null. */
  moveTo(place: GridPlace, gesture: string): string | null;
  /** Leaves it where it is now. */
  finish(): void;
  /** Gives it up, or puts it back where it was. */
  cancel(): void;
}

export type GridHandleKind = "grid-move" | "grid-turn" | "grid-lift" | "grid-0" | "grid-1" | "grid-2" | "grid-3";

export interface GridHandle {
  readonly id: string;
  readonly kind: GridHandleKind;
  readonly position: Vec3;
  readonly label: string;
  readonly active: boolean;
}

const CORNERS = ["grid-0", "grid-1", "grid-2", "grid-3"] as const;
const CORNER_NAMES = [
  msg("South-west corner"),
  msg("South-east corner"),
  msg("North-east corner"),
  msg("North-west corner"),
] as const;
/** How far beyond the north edge the turning handle stands, and how high the lifting one, as shares of the diagonal. */
const TURN_OUT = 0.09;
const LIFT_LEAST = 0.1;
const LIFT_MOST = 0.4;
/** Nearer than this to a right angle a rotation becomes one, degrees. */
const SNAP_DEG = 2;
/** A plane near the horizon turns a pixel into kilometres: farther than this many times the handle is not believed. */
const FAR = 4;
/** A grid is not made smaller than this share of the terrain by dragging. */
const LEAST_SHARE = 1 / 1000;

/** Highest world height of the grid where it lies, metres. */
export function topOf(placing: Pick<Placing, "low_m" | "high_m">, place: GridPlace): number {
  return Math.max(place.scale * placing.low_m, place.scale * placing.high_m) + place.lift_m;
}

/** All handles. The corner labels are as the grid lies at rotation 0. `map`: seen from above nothing can be lifted. */
export function gridHandles(
  placing: Placing,
  ground: Ground,
  active: GridHandleKind | null,
  map = false,
): GridHandle[] {
  const place = placing.place.value;
  const [wide, tall] = extentOf(placing, place);
  const diagonal = Math.hypot(wide, tall);
  const out: GridHandle[] = [];
  const put = (kind: GridHandleKind, position: Vec3, label: string): void => {
    out.push({ id: `${placing.id}/${kind}`, kind, position, label, active: kind === active });
  };
  const onGround = ([x, y]: Point): Vec3 => [x, y, ground.heightAt(x, y)];
  for (const [i, [u, v]] of latticeCorners(placing).entries())
    put(CORNERS[i]!, onGround(latticePoint(place, u, v)), `${CORNER_NAMES[i]} · ${lengths(wide, tall)}`);
  const beyond = (TURN_OUT * diagonal) / place.spacing_m[1];
  const turnAt = latticePoint(place, (placing.cols - 1) / 2, placing.rows - 1 + beyond);
  put("grid-turn", onGround(turnAt), msg(str`Turned ${fixed(place.rotation_deg, 1)}°`));
  const centre = onGround(centreOf(placing, place));
  put("grid-move", centre, msg("Move"));
  if (map) return out;
  const rise = clamp(topOf(placing, place) - centre[2], LIFT_LEAST * diagonal, LIFT_MOST * diagonal);
  const lift = `${place.lift_m < 0 ? "−" : "+"}${Math.round(Math.abs(place.lift_m))} m`;
  put("grid-lift", [centre[0], centre[1], centre[2] + rise], msg(str`Lift ${lift}`));
  return out;
}

function lengths(wide: number, tall: number): string {
  const km = Math.max(wide, tall) >= 2000;
  const text = (m: number): string => (km ? fixed(m / 1000, 2) : fixed(m, m < 20 ? 1 : 0));
  return `${text(wide)} × ${text(tall)} ${km ? "km" : "m"}`;
}

/** Says whether a point of the ground lies on the grid, so that dragging there moves it. */
export function gridAt(placing: Placing, point: Vec3): boolean {
  return covers(placing, placing.place.peek(), point[0], point[1]);
}

export interface GridDragStart {
  readonly placing: Placing;
  readonly handle: Pick<GridHandle, "kind" | "position">;
  readonly camera: Camera;
  readonly sizeM: number;
  /** Where the pointer took the handle, device pixels. */
  readonly x: number;
  readonly y: number;
}

/** One drag of a handle. Moves are reckoned from the place at its start, so that nothing adds up. */
export class GridDrag {
  readonly kind: GridHandleKind;
  readonly #o: GridDragStart;
  readonly #from: GridPlace;
  /** From the pointer to the handle, so that it does not jump when it is taken. */
  readonly #dx: number;
  readonly #dy: number;
  readonly #range: number;

  constructor(start: GridDragStart) {
    this.#o = start;
    this.kind = start.handle.kind;
    this.#from = start.placing.place.peek();
    const p = start.camera.project(start.handle.position);
    this.#dx = p.x - start.x;
    this.#dy = p.y - start.y;
    this.#range = distance(start.camera.ray(p.x, p.y).origin, start.handle.position);
  }

  /**
   * The place for the pointer at (x, y); null when that makes no sense. `regular`: corners keep the proportions and turns
   * snap to right angles.
   */
  place(x: number, y: number, regular = true): GridPlace | null {
    const ray = this.#o.camera.ray(x + this.#dx, y + this.#dy);
    if (this.kind === "grid-lift") return this.#lift(ray, y);
    const point = this.#onLevel(ray);
    if (point === null) return null;
    if (this.kind === "grid-move") {
      const { position } = this.#o.handle;
      return moved(this.#from, point[0] - position[0], point[1] - position[1]);
    }
    if (this.kind === "grid-turn") return this.#turn(point, regular);
    return this.#corner(CORNERS.indexOf(this.kind), point, regular);
  }

  /** The corner across stays where it is. */
  #corner(index: number, point: Vec3, regular: boolean): GridPlace {
    const { placing, sizeM } = this.#o;
    const corners = latticeCorners(placing);
    const [u, v] = corners[index]!;
    const [fu, fv] = corners[(index + 2) % 4]!;
    const [pu, pv] = latticeOf(this.#from, point[0], point[1]);
    const [ex, ey] = extentOf(placing, this.#from);
    const least = (extent: number): number => (LEAST_SHARE * sizeM) / extent;
    let kx = (pu - fu) / (u - fu);
    let ky = (pv - fv) / (v - fv);
    // The foot of the pointer on the diagonal, in metres.
    if (regular) kx = ky = (kx * ex * ex + ky * ey * ey) / (ex * ex + ey * ey);
    kx = Math.max(kx, regular ? least(Math.min(ex, ey)) : least(ex));
    ky = regular ? kx : Math.max(ky, least(ey));
    const [sx, sy] = this.#from.spacing_m;
    return respaced(this.#from, [kx * sx, ky * sy], fu, fv);
  }

  #turn(point: Vec3, regular: boolean): GridPlace {
    const { placing, handle } = this.#o;
    const [cx, cy] = centreOf(placing, this.#from);
    const was = Math.atan2(handle.position[1] - cy, handle.position[0] - cx);
    const now = Math.atan2(point[1] - cy, point[0] - cx);
    let rotation = wrapDegrees(this.#from.rotation_deg + (now - was) / DEG);
    const right = 90 * Math.round(rotation / 90);
    if (regular && Math.abs(rotation - right) < SNAP_DEG) rotation = right;
    return turned(placing, this.#from, rotation);
  }

  #lift(ray: Ray, y: number): GridPlace | null {
    const { handle, camera } = this.#o;
    const { position } = handle;
    let rise: number;
    if (camera.state.value.mode === "map" || Math.abs(ray.dir[2]) > 0.978)
      rise = (this.#o.y - y) * camera.metresPerPixelAt(position);
    else {
      const { eye } = camera.state.value;
      const flat = Math.hypot(position[0] - eye[0], position[1] - eye[1]) || 1;
      const t = rayPlane(ray, position, [(position[0] - eye[0]) / flat, (position[1] - eye[1]) / flat, 0]);
      if (t === null || t > FAR * this.#range) return null;
      rise = along(ray, t)[2] - position[2];
    }
    return { ...this.#from, lift_m: this.#from.lift_m + rise };
  }

  #onLevel(ray: Ray): Vec3 | null {
    const t = rayPlane(ray, this.#o.handle.position, [0, 0, 1]);
    return t === null || t > FAR * this.#range ? null : along(ray, t);
  }
}
