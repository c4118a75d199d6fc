/**
 * Applying operations to a document (DESIGN 4). Pure: a document and an op give a new document or throw a Refusal.
 *
 * Twin of `backend/esker/document/ops.py`; `tests/vectors/ops.json` holds the cases that both languages read.
 */

import { msg, str } from "@lit/localize";
import { plainOp } from "../core/plain.ts";
import {
  type AppendPoints,
  DOMAIN_MARGIN,
  MAX_POINTS_PER_STROKE,
  MAX_POINTS_PER_TERRAIN,
  MAX_STROKES,
  NULLABLE_STROKE_FIELDS,
  NULLABLE_TERRAIN_FIELDS,
  type Op,
  type SetStroke,
  type SetTerrain,
  type SimpleOp,
  type Stroke,
  type TerrainSettings,
} from "../generated/contract.ts";
import { changed, type Doc, fullCourse, fullFlank, fullStroke, Refusal } from "./document.ts";
import { LayerEditor } from "./layers.ts";
import { misfit, worldPoints } from "./strokes.ts";

export { type Doc, Refusal } from "./document.ts";

/** The document after `op` (clock + 1). Throws Refusal, leaving `doc` as it was. */
export function apply(doc: Doc, op: Op): Doc {
  const editor = new Editor(doc);
  for (const part of op.type === "group" ? op.ops : [op]) editor.run(plainOp(part));
  return {
    id: doc.id,
    clock: doc.clock + 1,
    settings: editor.settings,
    strokes: editor.strokes,
    deleted: editor.deleted,
    layers: editor.layers.layers,
    deletedLayers: editor.layers.deleted,
  };
}

/** One application in progress. Copies the maps on first write only. */
class Editor {
  settings: TerrainSettings;
  strokes: ReadonlyMap<string, Stroke>;
  deleted: ReadonlyMap<string, Stroke>;
  readonly layers: LayerEditor;
  #own: { strokes: Map<string, Stroke>; deleted: Map<string, Stroke> } | null = null;

  constructor(base: Doc) {
    this.settings = base.settings;
    this.strokes = base.strokes;
    this.deleted = base.deleted;
    this.layers = new LayerEditor(base);
  }

  run(op: SimpleOp): void {
    switch (op.type) {
      case "stroke.begin":
        this.#begin(fullStroke(op.stroke));
        break;
      case "stroke.append":
        this.#append(op);
        break;
      case "stroke.finish":
        this.#put({ ...this.#live(op.stroke), finished: true });
        break;
      case "stroke.set":
        this.#set(op);
        break;
      case "stroke.anchor":
        this.#put({ ...this.#editable(op.stroke), [op.which]: op.to });
        break;
      case "stroke.delete":
        this.#delete(op.stroke);
        break;
      case "stroke.restore":
        this.#restore(op.stroke);
        break;
      case "terrain.set":
        this.#setTerrain(op);
        break;
      default:
        this.layers.run(op);
    }
  }

  #writable(): { strokes: Map<string, Stroke>; deleted: Map<string, Stroke> } {
    if (this.#own === null) {
      this.#own = { strokes: new Map(this.strokes), deleted: new Map(this.deleted) };
      this.strokes = this.#own.strokes;
      this.deleted = this.#own.deleted;
    }
    return this.#own;
  }

  #live(id: string): Stroke {
    const stroke = this.strokes.get(id);
    if (stroke !== undefined) return stroke;
    if (this.deleted.has(id))
      throw new Refusal("deleted_stroke", msg("This stroke was deleted. Restore it before you change it."));
    throw new Refusal("unknown_stroke", msg("There is no such stroke in this terrain."));
  }

  #editable(id: string): Stroke {
    const stroke = this.#live(id);
    if (stroke.locked) throw new Refusal("locked_stroke", msg("This stroke is locked. Unlock it to change it."));
    return stroke;
  }

  #put(stroke: Stroke): void {
    this.#check(stroke);
    this.#writable().strokes.set(stroke.id, stroke);
  }

  #check(stroke: Stroke): void {
    if (stroke.curve.length > MAX_POINTS_PER_STROKE)
      throw new Refusal("too_many_points", msg(str`A stroke holds at most ${MAX_POINTS_PER_STROKE} points.`));
    const bound = DOMAIN_MARGIN * this.settings.size_m;
    const outside = (v: number): boolean => !(Math.abs(v) <= bound);
    if (stroke.first.some(outside) || stroke.last.some(outside))
      throw new Refusal("out_of_domain", msg("An anchor lies farther than ten times the terrain from its corner."));
    const wrong = misfit(stroke);
    if (wrong !== null) throw new Refusal("bad_field", wrong);
    if (worldPoints(stroke).some(outside))
      throw new Refusal("out_of_domain", msg("A point lies farther than ten times the terrain from its corner."));
  }

  #begin(stroke: Stroke): void {
    if (this.strokes.has(stroke.id) || this.deleted.has(stroke.id))
      throw new Refusal("duplicate_stroke", msg("A stroke with this id exists already."));
    this.#checkRoom();
    this.#put(stroke);
  }

  #checkRoom(): void {
    if (this.strokes.size >= MAX_STROKES)
      throw new Refusal("too_many_strokes", msg(str`A terrain holds at most ${MAX_STROKES} strokes.`));
  }

  #append(op: AppendPoints): void {
    const old = this.#editable(op.stroke);
    if (op.start > old.curve.length)
      throw new Refusal("bad_index", msg("The points do not continue the stroke that the server holds."));
    const curve = op.start === 0 ? op.points : [...old.curve.slice(0, op.start), ...op.points];
    this.#put({ ...old, curve, last: op.last });
  }

  #set(op: SetStroke): void {
    const old = this.#live(op.stroke);
    const update = changed(op.fields, NULLABLE_STROKE_FIELDS);
    if (old.locked && Object.keys(update).some((name) => name !== "locked"))
      throw new Refusal("locked_stroke", msg("This stroke is locked. Unlock it to change it."));
    const next: Stroke = { ...old, ...(update as Partial<Stroke>) };
    this.#put({ ...next, left: fullFlank(next.left), right: fullFlank(next.right), course: fullCourse(next.course) });
  }

  #delete(id: string): void {
    const old = this.#editable(id);
    const { strokes, deleted } = this.#writable();
    strokes.delete(id);
    deleted.set(id, old);
    let points = 0;
    for (const stroke of deleted.values()) points += stroke.curve.length;
    for (const [oldest, stroke] of deleted) {
      if (deleted.size <= MAX_STROKES && points <= MAX_POINTS_PER_TERRAIN) break;
      deleted.delete(oldest);
      points -= stroke.curve.length;
    }
  }

  #restore(id: string): void {
    if (this.strokes.has(id)) throw new Refusal("duplicate_stroke", msg("This stroke is not deleted."));
    const stroke = this.deleted.get(id);
    if (stroke === undefined) throw new Refusal("unknown_stroke", msg("There is no such deleted stroke to restore."));
    this.#checkRoom();
    this.#writable().deleted.delete(id);
    this.#put(stroke);
  }

  #setTerrain(op: SetTerrain): void {
    this.settings = { ...this.settings, ...(changed(op.fields, NULLABLE_TERRAIN_FIELDS) as Partial<TerrainSettings>) };
  }
}
