/** Tiles as numbers: map keys that need no strings. */

import { MAX_SYNTHESIS_LEVEL } from "../generated/contract.ts";

/** Columns and rows of a level are below this. */
const SIDE = 2 ** MAX_SYNTHESIS_LEVEL;
const AREA = SIDE * SIDE;

/** Packs a tile of a level up to MAX_SYNTHESIS_LEVEL into one whole number: level, row, column, 17 bits each below level. */
export function tileKey(level: number, x: number, y: number): number {
  return level * AREA + y * SIDE + x;
}

export function keyLevel(key: number): number {
  return Math.floor(key / AREA);
}

export function keyX(key: number): number {
  return key % SIDE;
}

export function keyY(key: number): number {
  return Math.floor(key / SIDE) % SIDE;
}

/** Key of the tile one level coarser that covers this one. The root has none: check the level first. */
export function parentKey(key: number): number {
  return tileKey(keyLevel(key) - 1, keyX(key) >> 1, keyY(key) >> 1);
}

/** True for every tile at or below one of `ancestors`, all of them tiles of `level`. One look-up, however many there are. */
export function isUnderAny(key: number, ancestors: ReadonlySet<number>, level: number): boolean {
  const shift = keyLevel(key) - level;
  return shift >= 0 && ancestors.has(tileKey(level, keyX(key) >> shift, keyY(key) >> shift));
}
