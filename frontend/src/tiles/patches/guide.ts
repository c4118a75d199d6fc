/**
 * The solved ground as the synthesis reads it: windows of whole levels that may reach over the domain's border. Beyond an
 * edge the ground goes on point-symmetrically, 2 z(edge) - z(as far inside), x first, then y: a function of the global
 * index alone, so tiles along the edge agree. Twin of `extended` in `backend/esker/synthesis/site.py`.
 */

import type { Tile } from "../../core/types.ts";
import { TILE_CELLS, TILE_SAMPLES } from "../../generated/contract.ts";
import type { Area } from "../detail/subdivide.ts";

/** Height of the sample in row j and column i of a level, inside the domain; undefined where it is not known. */
export type HeightOf = (level: number, j: number, i: number) => number | undefined;

/**
 * Writes the heights of an area of a level that are known, in metres, and NaN for the others; how many are. `area`
 * reaches over the domain's border by less than the domain.
 */
export function fillKnown(heightOf: HeightOf, { level, r0, r1, c0, c1 }: Area, out: Float64Array): number {
  const last = TILE_CELLS * 2 ** level;
  const inRow = (j: number, i: number): number => {
    const edge = Math.min(Math.max(i, 0), last);
    const here = heightOf(level, j, edge) ?? Number.NaN;
    return edge === i ? here : Math.fround(2 * here - (heightOf(level, j, 2 * edge - i) ?? Number.NaN));
  };
  let k = 0;
  let known = 0;
  for (let j = r0; j < r1; j += 1) {
    const edge = Math.min(Math.max(j, 0), last);
    for (let i = c0; i < c1; i += 1, k += 1) {
      const here = inRow(edge, i);
      const z = edge === j ? here : Math.fround(2 * here - inRow(2 * edge - j, i));
      out[k] = z;
      if (!Number.isNaN(z)) known += 1;
    }
  }
  return known;
}

/** Fills an area as `fillKnown` does. Returns false when one of the samples is not known. */
export function fillArea(heightOf: HeightOf, area: Area, out: Float64Array): boolean {
  return fillKnown(heightOf, area, out) === (area.r1 - area.r0) * (area.c1 - area.c0);
}

/**
 * Heights of the tiles that are held. A sample on a shared edge has one owner, the southernmost, then westernmost held
 * tile that has it, as in the renderer's slots (gpu/atlas/apron.ts).
 */
export function heightsOfTiles(tile: (level: number, x: number, y: number) => Tile | undefined): HeightOf {
  let last: Tile | undefined;
  const take = (level: number, x: number, y: number): Tile | undefined => {
    if (last?.level === level && last.x === x && last.y === y) return last;
    const found = tile(level, x, y);
    if (found !== undefined) last = found;
    return found;
  };
  return (level, j, i) => {
    const x = Math.max(0, Math.ceil(i / TILE_CELLS) - 1);
    const y = Math.max(0, Math.ceil(j / TILE_CELLS) - 1);
    const right = i === (x + 1) * TILE_CELLS ? x + 1 : x;
    const upper = j === (y + 1) * TILE_CELLS ? y + 1 : y;
    const owner =
      take(level, x, y) ??
      (right === x ? undefined : take(level, right, y)) ??
      (upper === y ? undefined : take(level, x, upper)) ??
      (right === x || upper === y ? undefined : take(level, right, upper));
    return owner?.heights[(j - owner.y * TILE_CELLS) * TILE_SAMPLES + i - owner.x * TILE_CELLS];
  };
}
