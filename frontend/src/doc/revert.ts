/** Taking one stroke's change back in the present document: the inner half of `undo.ts`. */

import {
  MAX_OPS_PER_GROUP,
  MAX_POINTS_PER_APPEND,
  type Op,
  type SimpleOp,
  type Stroke,
  type StrokeFields,
} from "../generated/contract.ts";
import { STROKE_WORDS, type State, type StrokeChange, type StrokeField, same, stateOf } from "./changes.ts";
import type { Doc } from "./document.ts";

const DELETED = "Somebody else has deleted this stroke since; your change of it was not undone.";
const DELETED_ALREADY = "This stroke is deleted already.";
const RESTORED_ALREADY = "This stroke is back already.";
const NOT_RESTORABLE = "This stroke can no longer be restored.";
const CHANGED = "Somebody else has changed this stroke since; it was kept.";
const LOCKED = "Somebody else has locked this stroke since; it was kept.";

/** A longer curve is restored by appends, since one message of 64 KiB does not hold it. */
const LARGE_CURVE_POINTS = 1024;

const FIELDS = (): StrokeField[] => Object.keys(STROKE_WORDS) as StrokeField[];

/** Appends to `ops` what takes the change back, and to `skipped` what was left alone. */
export class Reverter {
  readonly #id: string;
  readonly #change: StrokeChange;
  readonly #ops: SimpleOp[];
  readonly #skipped: string[];
  readonly #state: State;
  readonly #stroke: Stroke | null;

  constructor(id: string, change: StrokeChange, present: Doc, ops: SimpleOp[], skipped: string[]) {
    this.#id = id;
    this.#change = change;
    this.#ops = ops;
    this.#skipped = skipped;
    [this.#state, this.#stroke] = stateOf(present, id);
  }

  run(): void {
    const { before, after } = this.#change;
    if (before !== "live" && after === "live") this.#takeAway();
    else if (before === "live" && after === "deleted") this.#bringBack();
    else if (before === "live" && after === "live") {
      if (this.#stroke === null || this.#state !== "live") this.#skipped.push(DELETED);
      else this.#fields(this.#stroke);
    }
    // Anything else was drawn and cancelled within one step: nothing is left of it.
  }

  #takeAway(): void {
    const stroke = this.#stroke;
    if (stroke === null || this.#state !== "live") {
      this.#skipped.push(DELETED_ALREADY);
      return;
    }
    const content = this.#change.content;
    if (content === null || FIELDS().some((name) => !same(stroke[name], content[name]))) {
      this.#skipped.push(CHANGED);
      return;
    }
    let locked = stroke.locked;
    if (this.#change.before === "deleted" && this.#change.fields.size > 0) locked = this.#fields(stroke);
    if (locked) this.#set({ locked: false });
    this.#ops.push({ type: "stroke.delete", stroke: this.#id });
  }

  #bringBack(): void {
    if (this.#stroke === null) this.#skipped.push(NOT_RESTORABLE);
    else if (this.#state === "live") this.#skipped.push(RESTORED_ALREADY);
    else {
      this.#ops.push({ type: "stroke.restore", stroke: this.#id });
      this.#fields(this.#stroke);
    }
  }

  /** Puts the fields back that are still as I left them; returns whether the stroke is locked afterwards. */
  #fields(stroke: Stroke): boolean {
    const update = this.#restorable(stroke);
    if (stroke.locked && Object.keys(update).length > 0) {
      if (update.locked === undefined) {
        this.#skipped.push(LOCKED);
        return true;
      }
      this.#set({ locked: update.locked });
      delete update.locked;
    }
    const relock = update.locked;
    delete update.locked;
    const curve = update.curve;
    if (curve && curve.length > LARGE_CURVE_POINTS) {
      this.#append(curve, update.last ?? stroke.last);
      delete update.curve;
      delete update.last;
    }
    if (Object.keys(update).length > 0) this.#set(update);
    if (relock !== undefined) this.#set({ locked: relock });
    return relock ?? false;
  }

  #restorable(stroke: Stroke): StrokeFields {
    const update: Record<string, unknown> = {};
    for (const name of FIELDS()) {
      const change = this.#change.fields.get(name);
      if (change === undefined) continue;
      if (same(stroke[name], change[1])) update[name] = change[0];
      else
        this.#skipped.push(`Somebody else has changed the ${STROKE_WORDS[name]} of this stroke since; that was kept.`);
    }
    return update;
  }

  #set(fields: StrokeFields): void {
    this.#ops.push({ type: "stroke.set", stroke: this.#id, fields });
  }

  #append(curve: Stroke["curve"], last: Stroke["last"]): void {
    for (let start = 0; start < curve.length; start += MAX_POINTS_PER_APPEND) {
      const points = curve.slice(start, start + MAX_POINTS_PER_APPEND);
      this.#ops.push({ type: "stroke.append", stroke: this.#id, start, points, last });
    }
  }
}

function pointsIn(op: SimpleOp): number {
  if (op.type === "stroke.append") return op.points.length;
  return op.type === "stroke.set" ? (op.fields.curve?.length ?? 0) : 0;
}

/** One op if it fits in one message, a group if there are several, more groups only beyond the limits. */
export function grouped(ops: readonly SimpleOp[]): Op[] {
  const out: Op[] = [];
  let batch: SimpleOp[] = [];
  let points = 0;
  const flush = (): void => {
    if (batch.length > 0) out.push(batch.length === 1 ? batch[0]! : { type: "group", ops: batch });
    batch = [];
    points = 0;
  };
  for (const op of ops) {
    if (batch.length === MAX_OPS_PER_GROUP || points + pointsIn(op) > LARGE_CURVE_POINTS) flush();
    batch.push(op);
    points += pointsIn(op);
  }
  flush();
  return out;
}
