/** Tiles as numbers: map keys that need no strings. */

/** Packs a tile into one integer below 2^31: `level << 24 | y << 12 | x`. */
export function tileKey(level: number, x: number, y: number): number {
  return (level << 24) | (y << 12) | x;
}

export function keyLevel(key: number): number {
  return key >> 24;
}

export function keyX(key: number): number {
  return key & 0xfff;
}

export function keyY(key: number): number {
  return (key >> 12) & 0xfff;
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
