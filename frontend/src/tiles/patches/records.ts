/** The patches of a cut as the device reads them (shaders/wgsl/ground/patch.wgsl). */

export const EDGE_WEST = 1;
export const EDGE_EAST = 2;
export const EDGE_SOUTH = 4;
export const EDGE_NORTH = 8;

/**
 * Uint32 words of a patch record; the vertex shader reads the same (ground/patch.wgsl): column of the south-west vertex in samples
 * of its level | edge bits << 24 | border bits << 28; row | level << 24 | (1 << 31 where some of it lies below the sea);
 * own slot | parent slot << 12 | own morph weight as unorm8 << 24; four morph weights of the corners as unorm8 (south-west,
 * south-east, north-west, north-east).
 */
export const RECORD_WORDS = 4;
/** Words that say what is known of a patch beside what is drawn (Cut.facts, shaders/wgsl/hidden/hidden.wgsl). */
export const FACT_WORDS = 3;
const INDEX_MASK = 0xffffff;
/** Slots of the atlas have fewer bits. */
const SLOT_MASK = 0xfff;
const WET = 1 << 31;

/** The fields of a record. */
export interface PatchRecord {
  readonly level: number;
  /** Place of the south-west vertex, in samples of the level. */
  readonly column: number;
  readonly row: number;
  readonly slot: number;
  readonly parent: number;
  readonly edges: number;
  readonly border: number;
  readonly wet: boolean;
  /** Morph weight of what is not near an edge, as unorm8. */
  readonly own: number;
  /** Morph weights of the corners as unorm8. */
  readonly corners: number;
}

export function writeRecord(records: Uint32Array, patch: number, of: PatchRecord): void {
  const at = patch * RECORD_WORDS;
  records[at] = (of.column | (of.edges << 24) | (of.border << 28)) >>> 0;
  records[at + 1] = (of.row | (of.level << 24) | (of.wet ? WET : 0)) >>> 0;
  records[at + 2] = ((of.slot & SLOT_MASK) | ((of.parent & SLOT_MASK) << 12) | (of.own << 24)) >>> 0;
  records[at + 3] = of.corners >>> 0;
}

export function recordColumn(records: Uint32Array, patch: number): number {
  return records[patch * RECORD_WORDS]! & INDEX_MASK;
}

export function recordRow(records: Uint32Array, patch: number): number {
  return records[patch * RECORD_WORDS + 1]! & INDEX_MASK;
}

export function recordLevel(records: Uint32Array, patch: number): number {
  return (records[patch * RECORD_WORDS + 1]! >>> 24) & 31;
}

export function recordSlot(records: Uint32Array, patch: number): number {
  return records[patch * RECORD_WORDS + 2]! & SLOT_MASK;
}

export function recordParent(records: Uint32Array, patch: number): number {
  return (records[patch * RECORD_WORDS + 2]! >>> 12) & SLOT_MASK;
}

/** Morph weight of what is not near an edge, 0 to 1. */
export function recordMorph(records: Uint32Array, patch: number): number {
  return (records[patch * RECORD_WORDS + 2]! >>> 24) / 255;
}

export function recordEdges(records: Uint32Array, patch: number): number {
  return (records[patch * RECORD_WORDS]! >>> 24) & 15;
}

export function recordBorder(records: Uint32Array, patch: number): number {
  return records[patch * RECORD_WORDS]! >>> 28;
}

/** True where some of the patch lies below the sea. */
export function isWet(records: Uint32Array, patch: number): boolean {
  return (records[patch * RECORD_WORDS + 1]! & WET) !== 0;
}
