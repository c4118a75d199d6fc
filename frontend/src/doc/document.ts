/** The document as the page holds it: an immutable value. Maps keep the order in which strokes came. */

import { msg, str } from "@lit/localize";
import {
  type Course,
  DEFAULT_COURSE_GRADE,
  DEFAULT_EXTENT_FRACTION,
  DEFAULT_SIZE_M,
  DEFAULT_SLOPE_DEG,
  type Document,
  type Flank,
  type Layer,
  type RejectCode,
  type Stroke,
  type TerrainSettings,
} from "../generated/contract.ts";

export interface Doc {
  readonly id: string;
  readonly clock: number;
  readonly settings: TerrainSettings;
  readonly strokes: ReadonlyMap<string, Stroke>;
  /** Tombstones: removed strokes, so that a delete can be undone. */
  readonly deleted: ReadonlyMap<string, Stroke>;
  /** Elevation grids that are laid on the terrain. */
  readonly layers: ReadonlyMap<string, Layer>;
  readonly deletedLayers: ReadonlyMap<string, Layer>;
}

/** An op that cannot apply: `code` for machines, the message for a person. The document is unchanged. */
export class Refusal extends Error {
  readonly code: RejectCode;

  constructor(code: RejectCode, message: string) {
    super(message);
    this.name = "Refusal";
    this.code = code;
  }
}

/** The document that a snapshot describes. */
export function fromDocument(document: Document): Doc {
  return {
    id: document.id,
    clock: document.clock,
    settings: document.settings,
    strokes: new Map(document.strokes.map((s) => [s.id, s])),
    deleted: new Map(document.deleted.map((s) => [s.id, s])),
    layers: new Map(document.layers.map((l) => [l.id, l])),
    deletedLayers: new Map(document.deleted_layers.map((l) => [l.id, l])),
  };
}

/** A snapshot as sent and stored. */
export function toDocument(doc: Doc): Document {
  return {
    id: doc.id,
    clock: doc.clock,
    settings: doc.settings,
    strokes: [...doc.strokes.values()],
    deleted: [...doc.deleted.values()],
    layers: [...doc.layers.values()],
    deleted_layers: [...doc.deletedLayers.values()],
  };
}

/** A flank with the defaults of the contract filled in. */
export function fullFlank(flank: Partial<Flank> | null): Flank | null {
  if (flank === null) return null;
  return {
    slope_deg: DEFAULT_SLOPE_DEG,
    extent_m: DEFAULT_SIZE_M * DEFAULT_EXTENT_FRACTION,
    shape: "concave",
    ...flank,
  };
}

/** A course with the defaults of the contract filled in. */
export function fullCourse(course: (Partial<Course> & Pick<Course, "use">) | null): Course | null {
  return course === null ? null : { rises: [], grade: DEFAULT_COURSE_GRADE, depth_m: 0, ...course };
}

/** A stroke with the defaults of the contract filled in: ops from other clients may leave them out. */
export function fullStroke(stroke: Partial<Stroke> & Pick<Stroke, "id" | "kind" | "first" | "last" | "curve">): Stroke {
  return {
    author: "",
    plateau_radius_m: 0,
    amplitude_m: 0,
    roughness: 0.5,
    yields: 0,
    paint: null,
    locked: false,
    hidden: false,
    label: "",
    finished: false,
    ...stroke,
    left: fullFlank(stroke.left ?? null),
    right: fullFlank(stroke.right ?? null),
    course: fullCourse(stroke.course ?? null),
  };
}

/** The fields that a partial update really sets. Throws Refusal when a field that has no null is null. */
export function changed(fields: object, nullable: readonly string[]): Record<string, unknown> {
  const update: Record<string, unknown> = {};
  for (const [name, value] of Object.entries(fields)) {
    if (value === undefined) continue;
    if (value === null && !nullable.includes(name)) throw new Refusal("bad_field", msg(str`'${name}' needs a value.`));
    update[name] = value;
  }
  return update;
}
