/**
 * The line or outline that is measured, or the place from which water is followed: points on the map, set by clicks, drawn in one
 * go, taken by their handles. It changes no document and belongs to this page alone. While it is open it has the pointer, as a grid that is being placed has.
 */

import { msg, str } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import { type Place, simplified } from "../../core/measure/places.ts";
import type { Ground, Vec3 } from "../../core/types.ts";

/** `water`: one point, from which water is followed. */
export type RulerKind = "line" | "area" | "water";

/** A point as it is taken hold of. */
export interface RulerHandle {
  readonly kind: "ruler";
  readonly position: Vec3;
  readonly label: string;
  readonly active: boolean;
}

/** The most points that are left of a line drawn in one go: each has a handle. */
const MOST_DRAWN = 24;
/** The most points that may be set. */
export const MOST_POINTS = 64;
/** Pixels by which a drawn line may move when points are left out. */
const TOLERANCE_PX = 2;

export class Ruler {
  readonly #kind = signal<RulerKind | null>(null);
  readonly #points = signal<readonly Place[]>([]);
  readonly #active = signal<number | null>(null);
  /** As it was before the drag under way. */
  #before: readonly Place[] | null = null;
  #drawing = false;

  /** What is measured; null while the ruler is put away. */
  get kind(): ReadonlySignal<RulerKind | null> {
    return this.#kind;
  }

  get points(): ReadonlySignal<readonly Place[]> {
    return this.#points;
  }

  /** Takes the ruler in hand; points that are set stay when a line becomes an outline. Water begins at the last one. */
  open(kind: RulerKind): void {
    if ((kind === "water") !== (this.#kind.peek() === "water")) this.#points.value = this.#points.peek().slice(-1);
    this.#kind.value = kind;
  }

  /** Puts the ruler away; its points come back with it. */
  close(): void {
    this.cancel();
    this.#kind.value = null;
  }

  /** Sets a point at the end. False where there are too many. */
  add(hit: Place | Vec3): boolean {
    if (this.#kind.peek() === "water") {
      this.#points.value = [[hit[0], hit[1]]];
      return true;
    }
    if (this.#points.peek().length >= MOST_POINTS) return false;
    this.#points.value = [...this.#points.peek(), [hit[0], hit[1]]];
    return true;
  }

  /** Puts a point elsewhere: what somebody types. */
  put(index: number, place: Place): void {
    this.#points.value = this.#points.peek().map((p, i) => (i === index ? place : p));
  }

  /** Takes the last point back; false when there is none, or the ruler is put away. */
  removeLast(): boolean {
    if (this.#kind.peek() === null || this.#points.peek().length === 0) return false;
    this.#points.value = this.#points.peek().slice(0, -1);
    return true;
  }

  remove(index: number): void {
    this.#points.value = this.#points.peek().filter((_, i) => i !== index);
  }

  clear(): void {
    this.#points.value = [];
  }

  /** Takes hold of the point at a handle. */
  take({ position: [x, y] }: Pick<RulerHandle, "position">): void {
    const points = this.#points.peek();
    const away = points.map((p) => Math.hypot(p[0] - x, p[1] - y));
    this.#before = points;
    this.#active.value = away.indexOf(Math.min(...away));
  }

  /** The held point goes along; nothing happens where the pointer has left the land. */
  move(hit: Vec3 | null): void {
    const index = this.#active.peek();
    if (index !== null && hit !== null) this.put(index, [hit[0], hit[1]]);
  }

  /** A line is drawn in one go: it takes the place of what was there. */
  begin(hit: Vec3): void {
    this.#before = this.#points.peek();
    this.#drawing = true;
    this.#points.value = [[hit[0], hit[1]]];
  }

  draw(hit: Vec3 | null): void {
    if (!this.#drawing || hit === null) return;
    const before = this.#kind.peek() === "water" ? [] : this.#points.peek();
    this.#points.value = [...before, [hit[0], hit[1]]];
  }

  /** The pointer was lifted. `pixelM`: what a pixel covers there. */
  finish(pixelM: number): void {
    if (this.#drawing && this.#kind.peek() !== "water") {
      const kept = simplified(this.#points.peek(), TOLERANCE_PX * pixelM, MOST_DRAWN);
      // An outline that was drawn back to its beginning is closed by itself.
      const [first, last] = [kept[0]!, kept.at(-1)!];
      const closed =
        this.#kind.peek() === "area" &&
        kept.length > 3 &&
        Math.hypot(first[0] - last[0], first[1] - last[1]) < 24 * pixelM;
      this.#points.value = closed ? kept.slice(0, -1) : kept;
    }
    this.#end();
  }

  /** Gives up the drag under way; true when there was one. */
  cancel(): boolean {
    const before = this.#before;
    if (before !== null) this.#points.value = before;
    this.#end();
    return before !== null;
  }

  /** The points as handles on the ground; none while a line is being drawn. */
  handles(ground: Ground): readonly RulerHandle[] {
    const active = this.#active.value;
    if (this.#kind.value === null || (this.#drawing && this.#points.value.length > MOST_DRAWN)) return [];
    return this.#points.value.map(([x, y], i) => ({
      kind: "ruler",
      position: [x, y, ground.heightAt(x, y)],
      label: this.#kind.value === "water" ? msg("Where the drop falls") : msg(str`Point ${i + 1}`),
      active: i === active,
    }));
  }

  #end(): void {
    this.#before = null;
    this.#drawing = false;
    this.#active.value = null;
  }
}
