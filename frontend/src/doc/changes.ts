/** The changes of an op, field by field, which undo remembers (`undo.ts`). Pure. */

import { msg } from "@lit/localize";
import type { Layer, Op, SetTerrain, SimpleOp, Stroke, TerrainSettings } from "../generated/contract.ts";
import type { Doc } from "./document.ts";

export type State = "absent" | "live" | "deleted";
export type Change = readonly [before: unknown, after: unknown];
export type Kind = "stroke" | "layer";
export type Item = Stroke | Layer;

/** The undoable fields of a stroke in the order in which they are restored, with the word a person reads. */
export const STROKE_WORDS = {
  first: msg("start"),
  last: msg("end"),
  curve: msg("line"),
  left: msg("left flank"),
  right: msg("right flank"),
  plateau_radius_m: msg("plateau radius"),
  amplitude_m: msg("noise amplitude"),
  roughness: msg("roughness"),
  yields: msg("yielding"),
  paint: msg("paint"),
  course: msg("course"),
  locked: msg("lock"),
  hidden: msg("visibility"),
  label: msg("label"),
} as const;

export const LAYER_WORDS = {
  name: msg("name"),
  anchor: msg("place"),
  rotation_deg: msg("rotation"),
  spacing_m: msg("spacing"),
  scale: msg("vertical scale"),
  lift_m: msg("lift"),
  accuracy_m: msg("accuracy"),
  priority: msg("order"),
  hidden: msg("visibility"),
  outline: msg("outline"),
  source: msg("source"),
  licence: msg("licence"),
} as const;

export const WORDS: { readonly [kind in Kind]: { readonly [field: string]: string } } = {
  stroke: STROKE_WORDS,
  layer: LAYER_WORDS,
};

export const TERRAIN_WORDS = {
  title: msg("title"),
  reach_m: msg("reach"),
  border: msg("border"),
  sea_level_m: msg("sea level"),
  lakes_m: msg("lakes"),
  rivers: msg("rivers"),
  wetness: msg("wetness"),
  seed: msg("seed"),
  look: msg("look"),
  detail: msg("detail"),
  rule: msg("rule"),
  erosion: msg("erosion"),
  erosion_scale: msg("size of the gullies"),
  hold: msg("hold of the crests"),
  sun_azimuth_deg: msg("direction of the sun"),
  sun_elevation_deg: msg("height of the sun"),
  place: msg("place on Earth"),
  task: msg("task"),
  task_pictures: msg("pictures of the task"),
} as const;

/** One step's changes of one stroke or layer. `content` is the item as I left it when it came to life or died. */
export interface ItemChange {
  readonly before: State;
  readonly after: State;
  readonly fields: ReadonlyMap<string, Change>;
  readonly content: Item | null;
}

export interface Changes {
  readonly strokes: ReadonlyMap<string, ItemChange>;
  readonly layers: ReadonlyMap<string, ItemChange>;
  readonly terrain: ReadonlyMap<string, Change>;
}

/** Structural equality of JSON values. */
export function same(a: unknown, b: unknown): boolean {
  if (a === b) return true;
  if (typeof a !== "object" || typeof b !== "object" || a === null || b === null) return false;
  if (Array.isArray(a)) return Array.isArray(b) && a.length === b.length && a.every((v, i) => same(v, b[i]));
  const keys = Object.keys(a);
  const [x, y] = [a as Record<string, unknown>, b as Record<string, unknown>];
  return keys.length === Object.keys(b).length && keys.every((k) => same(x[k], y[k]));
}

/** A field of a stroke or a layer by its name. */
export function fieldOf(item: Item, name: string): unknown {
  return (item as unknown as Record<string, unknown>)[name];
}

/** Returns whether the stroke or layer is there, and the item or its tombstone. */
export function stateOf(kind: Kind, doc: Doc, id: string): [State, Item | null] {
  const live = (kind === "stroke" ? doc.strokes : doc.layers).get(id);
  if (live !== undefined) return ["live", live];
  const gone = (kind === "stroke" ? doc.deleted : doc.deletedLayers).get(id);
  return gone !== undefined ? ["deleted", gone] : ["absent", null];
}

/** The stroke or layer that an op of one is about. */
export function subjectOf(op: Exclude<SimpleOp, SetTerrain>): [kind: Kind, id: string] {
  if (op.type === "stroke.begin") return ["stroke", op.stroke.id];
  if (op.type === "layer.add") return ["layer", op.layer.id];
  return "layer" in op ? ["layer", op.layer] : ["stroke", op.stroke];
}

/** Returns the changes between the two documents that `op` made, field by field. */
export function changes(op: Op, before: Doc, after: Doc): Changes {
  const items = { stroke: new Map<string, ItemChange>(), layer: new Map<string, ItemChange>() };
  const terrain = new Map<string, Change>();
  for (const part of op.type === "group" ? op.ops : [op]) {
    if (part.type === "terrain.set") {
      for (const name of Object.keys(TERRAIN_WORDS) as (keyof TerrainSettings & keyof typeof TERRAIN_WORDS)[]) {
        const [old, now] = [before.settings[name], after.settings[name]];
        if (part.fields[name] !== undefined && !same(old, now)) terrain.set(name, [old, now]);
      }
      continue;
    }
    const [kind, id] = subjectOf(part);
    items[kind].set(id, itemChange(kind, id, before, after));
  }
  return { strokes: items.stroke, layers: items.layer, terrain };
}

function itemChange(kind: Kind, id: string, before: Doc, after: Doc): ItemChange {
  const [oldState, old] = stateOf(kind, before, id);
  const [newState, now] = stateOf(kind, after, id);
  const fields = new Map<string, Change>();
  if (old !== null && now !== null)
    for (const name of Object.keys(WORDS[kind])) {
      const pair = [fieldOf(old, name), fieldOf(now, name)] as const;
      if (!same(pair[0], pair[1])) fields.set(name, pair);
    }
  return { before: oldState, after: newState, fields, content: oldState !== newState ? now : null };
}

function mergeFields(earlier: ReadonlyMap<string, Change>, later: ReadonlyMap<string, Change>): Map<string, Change> {
  const out = new Map(earlier);
  for (const [name, [old, now]] of later) out.set(name, [out.has(name) ? out.get(name)![0] : old, now]);
  return out;
}

function mergeItem(earlier: ItemChange, later: ItemChange): ItemChange {
  let content = later.content;
  if (content === null && earlier.content !== null) {
    const update = [...later.fields].map(([name, [, now]]) => [name, now] as const);
    content = { ...earlier.content, ...(Object.fromEntries(update) as Partial<Item>) } as Item;
  }
  return {
    before: earlier.before,
    after: later.after,
    fields: mergeFields(earlier.fields, later.fields),
    content,
  };
}

function mergeItems(
  earlier: ReadonlyMap<string, ItemChange>,
  later: ReadonlyMap<string, ItemChange>,
): Map<string, ItemChange> {
  const out = new Map(earlier);
  for (const [id, change] of later) {
    const old = out.get(id);
    out.set(id, old === undefined ? change : mergeItem(old, change));
  }
  return out;
}

/** Joins these changes with later ones. */
export function merge(earlier: Changes, later: Changes): Changes {
  return {
    strokes: mergeItems(earlier.strokes, later.strokes),
    layers: mergeItems(earlier.layers, later.layers),
    terrain: mergeFields(earlier.terrain, later.terrain),
  };
}

/** True when there is nothing that undo could put back. */
export function isEmpty(done: Changes): boolean {
  if (done.terrain.size > 0) return false;
  return [...done.strokes.values(), ...done.layers.values()].every((s) => s.fields.size === 0 && s.before === s.after);
}
