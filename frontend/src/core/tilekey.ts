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

/** True for `key` itself and for every tile below `ancestor`. */
export function isUnder(key: number, ancestor: number): boolean {
  const shift = keyLevel(key) - keyLevel(ancestor);
  return shift >= 0 && keyX(key) >> shift === keyX(ancestor) && keyY(key) >> shift === keyY(ancestor);
}
