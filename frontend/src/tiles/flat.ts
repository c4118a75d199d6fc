/**
 * Where contours show. On ground that is flat but for its synthesised detail a contour would follow the detail alone, as noise, and
 * nowhere more than at exactly its own height; so lines fade by the slope of the solved ground. What counts as flat depends on the
 * interval: ground on which the next line would lie farther away than half the domain. The printed map has the same rule
 * (`steep_cells` in backend/esker/exporting/printing/contours.py).
 */

import type { ChannelGrid, Tile, TileView } from "../core/types.ts";
import { TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";

/** Every so many contours one is an index contour. */
export const INDEX_EVERY = 5;
/** In parts of the domain's side: how far away the next line may lie. */
const FLAT_RUN = 0.5;
/** Level whose samples tell slopes: finer ones would see the steps in which heights are sent. */
const SLOPE_LEVEL = 1;

/** The slope, rise over run, below which ground is flat for contours of an interval. */
export function flatSlope(everyM: number, sizeM: number): number {
  return everyM / (FLAT_RUN * sizeM);
}

/** How far a contour shows on solved ground of a slope, 0..1. */
export function contourShare(slope: number, everyM: number, sizeM: number): number {
  const t = Math.min(1, Math.max(0, slope / flatSlope(everyM, sizeM) - 0.5));
  return t * t * (3 - 2 * t);
}

interface Known {
  readonly stamp: number;
  readonly everyM: number;
  readonly grid: ChannelGrid | null;
}

const known = new WeakMap<TileView, Known>();

/** How far contours show over the domain; null before the ground has come. The same grid while nothing changes. */
export function sharesOf(tiles: TileView, everyM: number): ChannelGrid | null {
  const last = known.get(tiles);
  if (last?.stamp === tiles.stamp && last.everyM === everyM) return last.grid;
  const grid = shares(tiles, everyM);
  const same =
    grid !== null && last?.grid?.side === grid.side && grid.values.every((v, i) => v === last.grid!.values[i]);
  known.set(tiles, { stamp: tiles.stamp, everyM, grid: same ? last.grid : grid });
  return known.get(tiles)!.grid;
}

function shares(tiles: TileView, everyM: number): ChannelGrid | null {
  for (let level = Math.min(SLOPE_LEVEL, tiles.levels); level >= 0; level--) {
    const found = tilesOf(tiles, level);
    if (found === null) continue;
    const side = TILE_CELLS * 2 ** level + 1;
    const heights = joined(found, side);
    const cell = tiles.sizeM / (side - 1);
    const values = new Float32Array(side * side);
    for (let row = 0; row < side; row++)
      for (let col = 0; col < side; col++)
        values[row * side + col] = contourShare(slopeAt(heights, side, row, col) / cell, everyM, tiles.sizeM);
    return { side, values };
  }
  return null;
}

function tilesOf(tiles: TileView, level: number): Tile[] | null {
  const n = 2 ** level;
  const found = Array.from({ length: n * n }, (_, i) => tiles.tile(level, i % n, Math.floor(i / n)));
  return found.every((t) => t !== undefined) ? (found as Tile[]) : null;
}

function joined(tiles: readonly Tile[], side: number): Float32Array {
  const out = new Float32Array(side * side);
  for (const tile of tiles)
    for (let r = 0; r < TILE_SAMPLES; r++)
      out.set(
        tile.heights.subarray(r * TILE_SAMPLES, (r + 1) * TILE_SAMPLES),
        (tile.y * TILE_CELLS + r) * side + tile.x * TILE_CELLS,
      );
  return out;
}

/** The steepest rise to a neighbour, metres a cell: what is thin is not missed. */
function slopeAt(z: Float32Array, side: number, row: number, col: number): number {
  const at = row * side + col;
  const here = z[at]!;
  const east = Math.max(col + 1 < side ? Math.abs(z[at + 1]! - here) : 0, col > 0 ? Math.abs(z[at - 1]! - here) : 0);
  const north = Math.max(
    row + 1 < side ? Math.abs(z[at + side]! - here) : 0,
    row > 0 ? Math.abs(z[at - side]! - here) : 0,
  );
  return Math.hypot(east, north);
}
