/** Lines that were in hand when drawing was paused: kept for whoever drew them, also over a reload, until they may draw. */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { Doc } from "../../doc/document.ts";
import type { Op, Stroke } from "../../generated/contract.ts";
import { createOps, curveOps } from "../../input/sketch/strokeops.ts";
import { strokeId } from "../../input/tools/stroketool.ts";
import type { Store } from "../device/storage.ts";

/** A person has one line in hand; what a lost connection held back may be a few more. */
const MOST = 8;
const MOST_CHARACTERS = 400_000;

export class Drafts {
  readonly #list = signal<readonly Stroke[]>([]);
  readonly #store: Store;
  readonly #key: string;

  constructor(store: Store, terrain: string) {
    this.#store = store;
    this.#key = `esker.drafts.${terrain}`;
    this.#list.value = read(store.getItem(this.#key));
  }

  get list(): ReadonlySignal<readonly Stroke[]> {
    return this.#list;
  }

  /** Keeps these strokes as they are now; of the same one the newer. */
  keep(strokes: readonly Stroke[]): void {
    if (strokes.length === 0) return;
    const ids = new Set(strokes.map((s) => s.id));
    this.#set([...this.#list.value.filter((s) => !ids.has(s.id)), ...strokes].slice(-MOST));
  }

  /** Forgets those that the document has just as they were kept. */
  settle(doc: Doc): void {
    const left = this.#list.value.filter((draft) => backOps(draft, doc, draft.id).length > 0);
    if (left.length < this.#list.value.length) this.#set(left);
  }

  /** The ops that bring all of them back, each line's together; then none is kept. */
  take(doc: Doc, client: string, now: number): Op[][] {
    const all = this.#list.value.map((draft, i) => backOps(draft, doc, strokeId(now, i, client)));
    this.#set([]);
    return all.filter((ops) => ops.length > 0);
  }

  drop(): void {
    this.#set([]);
  }

  #set(list: readonly Stroke[]): void {
    this.#list.value = list;
    const text = JSON.stringify(list);
    try {
      if (list.length === 0 || text.length > MOST_CHARACTERS) this.#store.removeItem(this.#key);
      else this.#store.setItem(this.#key, text);
    } catch {
      // Storage is full: they last as long as the page.
    }
  }
}

/** The ops that make a stroke what it was; one that is not there any more comes anew, under `id`. */
function backOps(draft: Stroke, doc: Doc, id: string): Op[] {
  const live = doc.strokes.get(draft.id);
  if (live === undefined) return createOps({ ...draft, id, finished: true });
  const ops: Op[] = [];
  const fields = Object.fromEntries(
    (["first", "last", "left", "right", "paint"] as const)
      .filter((name) => JSON.stringify(live[name]) !== JSON.stringify(draft[name]))
      .map((name) => [name, draft[name]]),
  );
  if (Object.keys(fields).length > 0) ops.push({ type: "stroke.set", stroke: draft.id, fields });
  if (JSON.stringify(live.curve) !== JSON.stringify(draft.curve))
    ops.push(...curveOps({ ...live, last: draft.last }, draft.curve));
  return ops;
}

function read(text: string | null): Stroke[] {
  try {
    const parsed: unknown = JSON.parse(text ?? "[]");
    if (!Array.isArray(parsed)) return [];
    return parsed.filter((s): s is Stroke => typeof s?.id === "string" && Array.isArray(s?.curve)).slice(-MOST);
  } catch {
    return [];
  }
}
