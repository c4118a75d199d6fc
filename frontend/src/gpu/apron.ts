/**
 * The samples of one atlas slot: a tile's 65 x 65 heights with a border of two from its neighbours (DESIGN 9).
 *
 * Samples on a shared edge are taken from one owner, the southernmost, then westernmost, held tile that has them: while a
 * tile runs ahead of its neighbour (a preview beside an exact tile), both slots still hold the same edge. Where no
 * neighbour is held the border goes on with the slope of the edge.
 */

import type { Tile } from "../core/types.ts";
import { TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";

export const BORDER = 2;
export const SLOT_TEXELS = TILE_SAMPLES + 2 * BORDER;

/** Tile of the same level at (x + dx, y + dy), or undefined; dx, dy from -1 to 1. */
export type Neighbour = (dx: number, dy: number) => Tile | undefined;

/** Part of a row or column: slot range [from, to) and where the neighbour's samples for it start. */
interface Span {
  readonly d: number;
  readonly from: number;
  readonly to: number;
  /** sample of the neighbour = slot index - BORDER - shift. */
  readonly shift: number;
}

const SPANS: readonly Span[] = [
  { d: -1, from: 0, to: BORDER + 1, shift: -TILE_CELLS },
  { d: 0, from: BORDER, to: BORDER + TILE_SAMPLES, shift: 0 },
  { d: 1, from: BORDER + TILE_CELLS, to: SLOT_TEXELS, shift: TILE_CELLS },
];

/** Fills `out` (69 x 69, row 0 south). */
export function assembleSlot(tile: Tile, neighbour: Neighbour, out: Float32Array): void {
  const sources = SPANS.flatMap((upward) =>
    SPANS.map((across) => (across.d === 0 && upward.d === 0 ? tile : neighbour(across.d, upward.d))),
  );
  if (sources.includes(undefined)) extrapolate(tile, out);
  // North to south and east to west: the last writer of a shared sample is its owner.
  for (let k = 8; k >= 0; k -= 1) {
    const source = sources[k];
    if (source !== undefined) copyPart(source.heights, SPANS[k % 3]!, SPANS[Math.floor(k / 3)]!, out);
  }
}

function copyPart(heights: Float32Array, across: Span, upward: Span, out: Float32Array): void {
  const first = across.from - BORDER - across.shift;
  const width = across.to - across.from;
  for (let row = upward.from; row < upward.to; row += 1) {
    const from = (row - BORDER - upward.shift) * TILE_SAMPLES + first;
    const to = row * SLOT_TEXELS + across.from;
    if (width > 8) out.set(heights.subarray(from, from + width), to);
    else for (let k = 0; k < width; k += 1) out[to + k] = heights[from + k]!;
  }
}

function extrapolate(tile: Tile, out: Float32Array): void {
  const h = tile.heights;
  const last = TILE_SAMPLES - 1;
  for (let row = 0; row < SLOT_TEXELS; row += 1) {
    const inRow = row >= BORDER && row < BORDER + TILE_SAMPLES;
    for (let col = 0; col < SLOT_TEXELS; col += 1) {
      if (inRow && col === BORDER) {
        col += TILE_SAMPLES - 1;
        continue;
      }
      const r = row - BORDER;
      const c = col - BORDER;
      const er = Math.min(last, Math.max(0, r));
      const ec = Math.min(last, Math.max(0, c));
      // Mirror about the edge sample: 2 h(edge) - h(as far inside).
      const mr = 2 * er - r;
      const mc = 2 * ec - c;
      out[row * SLOT_TEXELS + col] = 2 * h[er * TILE_SAMPLES + ec]! - h[mr * TILE_SAMPLES + mc]!;
    }
  }
}
