/**
 * Undo by person (DESIGN 4): the inverse of *my* step, evaluated against the present document. Pure but for the stack.
 *
 * Each op of mine is recorded as the fields it changed, with the value before and after. Undoing compares every such
 * field with the present document: where it still holds what I left it gets its old value back, where somebody else
 * has changed it since it is kept and reported. Twin of `backend/esker/document/undo.py` (`tests/vectors/undo.json`).
 */

import { msg, str } from "@lit/localize";
import type { Op, SetTerrain, SimpleOp, TerrainSettings } from "../generated/contract.ts";
import { apply, type Doc, Refusal } from "./apply.ts";
import { type Changes, changes, isEmpty, merge, same, TERRAIN_WORDS } from "./changes.ts";
import { grouped, LayerReverter, StrokeReverter } from "./revert.ts";

const DEFAULT_DEPTH = 500;

/** Ops to submit in order, and a sentence for each thing that was left alone. Without ops nothing was undone. */
export interface UndoPlan {
  readonly ops: readonly Op[];
  readonly skipped: readonly string[];
}

/** The ops that take back `op` right after it was applied to `before`. Throws Refusal when it does not apply. */
export function inverse(op: Op, before: Doc): readonly Op[] {
  const after = apply(before, op);
  return plan(changes(op, before, after), after).ops;
}

/** The ops that take `done` back in the present document, leaving everything that others changed since. */
export function plan(done: Changes, present: Doc): UndoPlan {
  const ops: SimpleOp[] = [];
  const skipped: string[] = [];
  for (const [id, change] of [...done.strokes].reverse()) new StrokeReverter(id, change, present, ops, skipped).run();
  for (const [id, change] of [...done.layers].reverse()) new LayerReverter(id, change, present, ops, skipped).run();
  const fields: Record<string, unknown> = {};
  for (const [name, word] of Object.entries(TERRAIN_WORDS)) {
    const change = done.terrain.get(name);
    if (change === undefined) continue;
    if (same(present.settings[name as keyof TerrainSettings], change[1])) fields[name] = change[0];
    else skipped.push(msg(str`Somebody else has changed the ${word} of the terrain since; that was kept.`));
  }
  if (Object.keys(fields).length > 0) ops.push({ type: "terrain.set", fields: fields as SetTerrain["fields"] });
  return { ops: grouped(ops), skipped };
}

interface Part {
  readonly opId: string | null;
  readonly changes: Changes;
}

interface Step {
  readonly gesture: string | null;
  readonly parts: readonly Part[];
}

/** The steps of one person on one terrain. Consecutive ops with the same `gesture` token are one step. */
export class UndoStack {
  readonly #depth: number;
  #done: Step[] = [];
  #undone: Step[] = [];

  constructor(depth = DEFAULT_DEPTH) {
    this.#depth = depth;
  }

  get canUndo(): boolean {
    return this.#done.length > 0;
  }

  get canRedo(): boolean {
    return this.#undone.length > 0;
  }

  /** Remembers an op of mine that took `before` to `after`. Clears what could be redone. */
  record(before: Doc, op: Op, after: Doc, gesture: string | null = null, opId: string | null = null): void {
    this.#undone = [];
    const part: Part = { opId, changes: changes(op, before, after) };
    const last = this.#done.at(-1);
    if (last !== undefined && gesture !== null && last.gesture === gesture)
      this.#done[this.#done.length - 1] = { gesture, parts: [...last.parts, part] };
    else this.#push({ gesture, parts: [part] });
  }

  /** Drops an op that the server refused, so that it is neither undone nor redone. */
  forget(opId: string): void {
    const keep = (steps: Step[]): Step[] =>
      steps
        .map((s) => ({ gesture: s.gesture, parts: s.parts.filter((p) => p.opId !== opId) }))
        .filter((s) => s.parts.length > 0);
    this.#done = keep(this.#done);
    this.#undone = keep(this.#undone);
  }

  /**
   * An op that the server has committed can no longer be refused, so its changes are merged with those of the committed
   * ops before it in the same step: a stroke of hundreds of appends is remembered by its first and last state alone.
   */
  settle(opId: string): void {
    for (let i = this.#done.length - 1; i >= 0; i--) {
      const { gesture, parts } = this.#done[i]!;
      const at = parts.findIndex((p) => p.opId === opId);
      if (at < 0) continue;
      const before = parts[at - 1];
      const merged = parts.slice(0, at);
      if (before?.opId === null) merged.pop();
      merged.push({
        opId: null,
        changes: before?.opId === null ? merge(before.changes, parts[at]!.changes) : parts[at]!.changes,
      });
      this.#done[i] = { gesture, parts: [...merged, ...parts.slice(at + 1)] };
      return;
    }
  }

  /** Ops that are remembered one by one, over all steps. */
  get size(): number {
    return this.#done.reduce((sum, step) => sum + step.parts.length, 0);
  }

  /** Takes back my last step. The returned ops must be submitted in order; they are not recorded again. */
  undo(present: Doc): UndoPlan {
    return this.#move(this.#done, this.#undone, present);
  }

  /** Takes back my last undo, by the same rules. */
  redo(present: Doc): UndoPlan {
    return this.#move(this.#undone, this.#done, present);
  }

  #push(step: Step): void {
    this.#done.push(step);
    if (this.#done.length > this.#depth) this.#done.shift();
  }

  #move(source: Step[], target: Step[], present: Doc): UndoPlan {
    for (let step = source.pop(); step !== undefined; step = source.pop()) {
      const merged = step.parts.map((p) => p.changes).reduce(merge);
      if (isEmpty(merged)) continue;
      const result = plan(merged, present);
      const parts: Part[] = [];
      try {
        for (const op of result.ops) {
          const after = apply(present, op);
          parts.push({ opId: null, changes: changes(op, present, after) });
          present = after;
        }
      } catch (error) {
        if (!(error instanceof Refusal)) throw error;
        return { ops: [], skipped: [...result.skipped, error.message] };
      }
      if (parts.length > 0) target.push({ gesture: null, parts });
      return result;
    }
    return { ops: [], skipped: [] };
  }
}
