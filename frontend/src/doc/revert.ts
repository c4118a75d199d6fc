/** Taking one change of a stroke or a layer back in the present document: the inner half of `undo.ts`. */

import { msg, str } from "@lit/localize";
import {
  type LayerFields,
  MAX_OPS_PER_GROUP,
  MAX_POINTS_PER_APPEND,
  type Op,
  type SimpleOp,
  type Stroke,
  type StrokeFields,
} from "../generated/contract.ts";
import { fieldOf, type Item, type ItemChange, type Kind, type State, same, stateOf, WORDS } from "./changes.ts";
import type { Doc } from "./document.ts";

/** A longer curve is restored by appends, since one message of 64 KiB does not hold it. */
const LARGE_CURVE_POINTS = 1024;

const KINDS: Readonly<Record<Kind, string>> = { stroke: msg("stroke"), layer: msg("layer") };

/**
 * Takes back one change. Strokes and layers share this: ops that do it are appended to `ops`, sentences about the rest
 * to `skipped`.
 */
abstract class Reverter {
  readonly #kind: Kind;
  protected readonly id: string;
  protected readonly change: ItemChange;
  protected readonly ops: SimpleOp[];
  protected readonly skipped: string[];
  protected readonly item: Item | null;
  readonly #state: State;

  constructor(kind: Kind, id: string, change: ItemChange, present: Doc, ops: SimpleOp[], skipped: string[]) {
    this.#kind = kind;
    this.id = id;
    this.change = change;
    this.ops = ops;
    this.skipped = skipped;
    [this.#state, this.item] = stateOf(kind, present, id);
  }

  /** `changed`: put the fields back first, as they were in the tombstone. */
  protected abstract remove(changed: boolean): void;
  protected abstract restore(): void;
  /** Puts the fields back that are still as I left them. */
  protected abstract putBack(): void;

  run(): void {
    const { before, after } = this.change;
    if (before !== "live" && after === "live") this.#takeAway();
    else if (before === "live" && after === "deleted") this.#bringBack();
    else if (before === "live" && after === "live") {
      if (this.item === null || this.#state !== "live")
        this.skipped.push(
          msg(str`Somebody else has deleted this ${KINDS[this.#kind]} since; your change of it was not undone.`),
        );
      else this.putBack();
    }
    // Anything else was made and taken away within one step: nothing is left of it.
  }

  #takeAway(): void {
    const { item, change } = this;
    if (item === null || this.#state !== "live") {
      this.skipped.push(msg(str`This ${KINDS[this.#kind]} is deleted already.`));
      return;
    }
    const content = change.content;
    const names = Object.keys(WORDS[this.#kind]);
    if (content === null || names.some((name) => !same(fieldOf(item, name), fieldOf(content, name)))) {
      this.skipped.push(msg(str`Somebody else has changed this ${KINDS[this.#kind]} since; it was kept.`));
      return;
    }
    this.remove(change.before === "deleted" && change.fields.size > 0);
  }

  #bringBack(): void {
    if (this.item === null) this.skipped.push(msg(str`This ${KINDS[this.#kind]} can no longer be restored.`));
    else if (this.#state === "live") this.skipped.push(msg(str`This ${KINDS[this.#kind]} is back already.`));
    else {
      this.restore();
      this.putBack();
    }
  }

  /** The fields that are still as I left them, with the values they had before. */
  protected restorable(item: Item): Record<string, unknown> {
    const update: Record<string, unknown> = {};
    for (const [name, word] of Object.entries(WORDS[this.#kind])) {
      const change = this.change.fields.get(name);
      if (change === undefined) continue;
      if (same(fieldOf(item, name), change[1])) update[name] = change[0];
      else
        this.skipped.push(
          msg(str`Somebody else has changed the ${word} of this ${KINDS[this.#kind]} since; that was kept.`),
        );
    }
    return update;
  }
}

/** Takes one layer's change back. */
export class LayerReverter extends Reverter {
  constructor(id: string, change: ItemChange, present: Doc, ops: SimpleOp[], skipped: string[]) {
    super("layer", id, change, present, ops, skipped);
  }

  protected remove(changed: boolean): void {
    if (changed) this.putBack();
    this.ops.push({ type: "layer.delete", layer: this.id });
  }

  protected restore(): void {
    this.ops.push({ type: "layer.restore", layer: this.id });
  }

  protected putBack(): void {
    const fields: LayerFields = this.restorable(this.item!);
    if (Object.keys(fields).length > 0) this.ops.push({ type: "layer.set", layer: this.id, fields });
  }
}

/** Takes one stroke's change back, minding its lock and curves that no message holds. */
export class StrokeReverter extends Reverter {
  constructor(id: string, change: ItemChange, present: Doc, ops: SimpleOp[], skipped: string[]) {
    super("stroke", id, change, present, ops, skipped);
  }

  protected remove(changed: boolean): void {
    const locked = changed ? this.#fields() : (this.item as Stroke).locked;
    if (locked) this.#set({ locked: false });
    this.ops.push({ type: "stroke.delete", stroke: this.id });
  }

  protected restore(): void {
    this.ops.push({ type: "stroke.restore", stroke: this.id });
  }

  protected putBack(): void {
    this.#fields();
  }

  /** Returns whether the stroke is locked afterwards. */
  #fields(): boolean {
    const stroke = this.item as Stroke;
    const update: StrokeFields = this.restorable(stroke);
    if (stroke.locked && Object.keys(update).length > 0) {
      if (update.locked === undefined) {
        this.skipped.push(msg("Somebody else has locked this stroke since; it was kept."));
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

  #set(fields: StrokeFields): void {
    this.ops.push({ type: "stroke.set", stroke: this.id, fields });
  }

  #append(curve: Stroke["curve"], last: Stroke["last"]): void {
    for (let start = 0; start < curve.length; start += MAX_POINTS_PER_APPEND) {
      const points = curve.slice(start, start + MAX_POINTS_PER_APPEND);
      this.ops.push({ type: "stroke.append", stroke: this.id, start, points, last });
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
