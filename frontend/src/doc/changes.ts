/** What an op changed, field by field: the memory of undo (`undo.ts`). Pure. */

import type { Op, Stroke, TerrainSettings } from "../generated/contract.ts";
import type { Doc } from "./document.ts";

export type State = "absent" | "live" | "deleted";
export type Change = readonly [before: unknown, after: unknown];
export type StrokeField = keyof typeof STROKE_WORDS;

/** The undoable fields of a stroke in the order in which they are restored, with the word a person reads. */
export const STROKE_WORDS = {
  first: "start",
  last: "end",
  curve: "line",
  left: "left flank",
  right: "right flank",
  plateau_radius_m: "plateau radius",
  amplitude_m: "noise amplitude",
  roughness: "roughness",
  paint: "paint",
  locked: "lock",
  hidden: "visibility",
  label: "label",
} as const;

export const TERRAIN_WORDS = {
  title: "title",
  reach_m: "reach",
  border: "border",
  sea_level_m: "sea level",
  seed: "seed",
  look: "look",
  detail: "detail",
  rule: "rule",
  sun_azimuth_deg: "direction of the sun",
  sun_elevation_deg: "height of the sun",
} as const;

/** What one step of mine did to a stroke. `content` is the stroke as I left it when it came to life or died. */
export interface StrokeChange {
  readonly before: State;
  readonly after: State;
  readonly fields: ReadonlyMap<StrokeField, Change>;
  readonly content: Stroke | null;
}

export interface Changes {
  readonly strokes: ReadonlyMap<string, StrokeChange>;
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

/** Whether the stroke is there, and the stroke (or its tombstone). */
export function stateOf(doc: Doc, id: string): [State, Stroke | null] {
  const live = doc.strokes.get(id);
  if (live !== undefined) return ["live", live];
  const gone = doc.deleted.get(id);
  return gone !== undefined ? ["deleted", gone] : ["absent", null];
}

/** What `op` changed between the two documents, field by field. */
export function changes(op: Op, before: Doc, after: Doc): Changes {
  const strokes = new Map<string, StrokeChange>();
  const terrain = new Map<string, Change>();
  for (const part of op.type === "group" ? op.ops : [op]) {
    if (part.type === "terrain.set") {
      for (const name of Object.keys(TERRAIN_WORDS) as (keyof TerrainSettings & keyof typeof TERRAIN_WORDS)[]) {
        const [old, now] = [before.settings[name], after.settings[name]];
        if (part.fields[name] !== undefined && old !== now) terrain.set(name, [old, now]);
      }
      continue;
    }
    const id = part.type === "stroke.begin" ? part.stroke.id : part.stroke;
    strokes.set(id, strokeChange(id, before, after));
  }
  return { strokes, terrain };
}

function strokeChange(id: string, before: Doc, after: Doc): StrokeChange {
  const [oldState, old] = stateOf(before, id);
  const [newState, now] = stateOf(after, id);
  const fields = new Map<StrokeField, Change>();
  if (old !== null && now !== null)
    for (const name of Object.keys(STROKE_WORDS) as StrokeField[])
      if (!same(old[name], now[name])) fields.set(name, [old[name], now[name]]);
  return { before: oldState, after: newState, fields, content: oldState !== newState ? now : null };
}

function mergeFields<K>(earlier: ReadonlyMap<K, Change>, later: ReadonlyMap<K, Change>): Map<K, Change> {
  const out = new Map(earlier);
  for (const [name, [old, now]] of later) out.set(name, [out.has(name) ? out.get(name)![0] : old, now]);
  return out;
}

function mergeStroke(earlier: StrokeChange, later: StrokeChange): StrokeChange {
  let content = later.content;
  if (content === null && earlier.content !== null) {
    const update = [...later.fields].map(([name, [, now]]) => [name, now] as const);
    content = { ...earlier.content, ...(Object.fromEntries(update) as Partial<Stroke>) };
  }
  return {
    before: earlier.before,
    after: later.after,
    fields: mergeFields(earlier.fields, later.fields),
    content,
  };
}

/** These changes followed by later ones. */
export function merge(earlier: Changes, later: Changes): Changes {
  const strokes = new Map(earlier.strokes);
  for (const [id, change] of later.strokes) {
    const old = strokes.get(id);
    strokes.set(id, old === undefined ? change : mergeStroke(old, change));
  }
  return { strokes, terrain: mergeFields(earlier.terrain, later.terrain) };
}

/** True when there is nothing that undo could put back. */
export function isEmpty(done: Changes): boolean {
  if (done.terrain.size > 0) return false;
  return [...done.strokes.values()].every((s) => s.fields.size === 0 && s.before === s.after);
}
