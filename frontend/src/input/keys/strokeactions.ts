/** Actions by which keys change the selected stroke. */

import type { Op, Paint, Stroke } from "../../generated/contract.ts";
import { drapedOf, shapeOf } from "../picking.ts";
import { createOps, metres } from "../sketch/strokeops.ts";
import { moveOps, raiseOps } from "../tools/handledrag.ts";
import { handlesOf } from "../tools/handles.ts";
import { type ActionContext, GESTURE_MS } from "./action.ts";

/** Edits that the selected stroke allows. */
export class StrokeActions {
  readonly #c: ActionContext;
  #gesture = { name: "", kind: "", at: -Infinity };

  constructor(context: ActionContext) {
    this.#c = context;
  }

  /** The selected stroke, or null. */
  stroke(): Stroke | null {
    return this.#c.doc.doc.value?.strokes.get(this.#c.selection.value ?? "") ?? null;
  }

  readonly selected = (): boolean => this.#c.canEdit() && this.stroke() !== null;
  readonly usable = (): boolean => this.selected() && this.stroke()?.locked === false;
  /** Says whether the stroke has height and a section to change: paint has neither. */
  readonly shaped = (): boolean => this.usable() && this.stroke()?.kind !== "paint";
  readonly any = (): boolean => (this.#c.doc.doc.value?.strokes.size ?? 0) > 0;

  travel(way: "undo" | "redo"): void {
    this.#c.cancel();
    const { skipped } = this.#c.doc[way]();
    for (const sentence of new Set(skipped)) this.#c.onMessage(sentence);
  }

  remove(): void {
    const stroke = this.stroke();
    if (stroke === null || !this.#submit([{ type: "stroke.delete", stroke: stroke.id }])) return;
    this.#c.selection.value = null;
  }

  /** A copy a little to the right on the screen, selected. */
  duplicate(): void {
    const stroke = this.stroke();
    if (stroke === null) return;
    const step = this.#c.ground().sizeM / 40;
    const [dx, dy] = this.direction(step, -step);
    const moved = (p: Stroke["first"]): Stroke["first"] => metres([p[0] + dx, p[1] + dy, p[2]]);
    const id = this.#c.newId();
    const copy: Stroke = {
      ...stroke,
      id,
      first: moved(stroke.first),
      last: moved(stroke.last),
      locked: false,
      finished: true,
    };
    if (this.#submit(createOps(copy), `duplicate-${id}`)) this.#c.selection.value = id;
  }

  mirror(): void {
    const s = this.stroke();
    if (s !== null) this.#submit([{ type: "stroke.set", stroke: s.id, fields: { left: s.right, right: s.left } }]);
  }

  toggle(field: "locked" | "hidden"): void {
    const s = this.stroke();
    if (s !== null) this.#submit([{ type: "stroke.set", stroke: s.id, fields: { [field]: !s[field] } }]);
  }

  raise(sign: number): void {
    const s = this.stroke();
    if (s !== null) this.#submit(raiseOps(s, (sign * this.#c.ground().sizeM) / 400), this.#repeated("raise"));
  }

  /** Changes the paint of the selected stroke; repeats within a moment are one step of undo. */
  repaint(paint: Paint): void {
    const s = this.stroke();
    if (s !== null) this.#submit([{ type: "stroke.set", stroke: s.id, fields: { paint } }], this.#repeated("paint"));
  }

  /** Moves the stroke by a small step as seen on the screen. */
  nudge(right: number, away: number): void {
    const s = this.stroke();
    if (s === null) return;
    const step = this.#c.ground().sizeM / 256;
    const [dx, dy] = this.direction(right * step, away * step);
    this.#submit(moveOps(s, dx, dy, this.#c.ground()), this.#repeated("nudge"));
  }

  step(by: number): void {
    const ids = [...(this.#c.doc.doc.value?.strokes.keys() ?? [])];
    if (ids.length === 0) return;
    const at = ids.indexOf(this.#c.selection.value ?? "");
    this.#c.selection.value = ids[at < 0 ? (by > 0 ? 0 : ids.length - 1) : (at + by + ids.length) % ids.length]!;
  }

  frame(): void {
    const s = this.stroke();
    if (s === null || s.curve.length === 0) {
      this.#c.camera.home();
      return;
    }
    const { points } = s.kind === "paint" ? drapedOf(s, this.#c.freeze()) : shapeOf(s);
    const crest = Array.from(
      { length: points.length / 3 },
      (_, i) => [...points.subarray(3 * i, 3 * i + 3)] as Stroke["first"],
    );
    this.#c.camera.frame([...crest, ...handlesOf(s, this.#c.ground(), null).map((h) => h.position)]);
  }

  /** Metres on the map of a step to the right and away, as seen on the screen. */
  direction(right: number, away: number): [number, number] {
    const { eye, target, up } = this.#c.camera.state.value;
    let [fx, fy] = [target[0] - eye[0], target[1] - eye[1]];
    if (Math.hypot(fx, fy) < 1e-6) [fx, fy] = [up[0], up[1]];
    const n = Math.hypot(fx, fy) || 1;
    return [(right * fy + away * fx) / n, (-right * fx + away * fy) / n];
  }

  #repeated(kind: string): string {
    const now = this.#c.now();
    const id = this.#c.selection.value;
    if (this.#gesture.kind !== `${kind}/${id}` || now - this.#gesture.at > GESTURE_MS)
      this.#gesture = { name: `${kind}-${id}-${Math.floor(now)}`, kind: `${kind}/${id}`, at: now };
    this.#gesture.at = now;
    return this.#gesture.name;
  }

  #submit(ops: readonly Op[], gesture?: string): boolean {
    for (const op of ops) {
      const refusal = this.#c.doc.submit(op, gesture);
      if (refusal === null) continue;
      this.#c.onMessage(refusal.message, { code: refusal.code, op });
      return false;
    }
    return true;
  }
}
