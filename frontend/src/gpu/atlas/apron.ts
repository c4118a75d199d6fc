/**
 * What is held of the samples of one atlas slot: a tile's 65 x 65 heights with a border of two from its neighbours
 * (DESIGN 9). What nobody holds is made on the device (synthesis.ts).
 *
 * Samples on a shared edge are taken from one owner, the southernmost, then westernmost, held tile that has them: while a
 * tile runs ahead of its neighbour (a preview beside an exact tile), both slots still hold the same edge.
 */

import { TILE_CELLS, TILE_SAMPLES } from "../../generated/contract.ts";

export const BORDER = 2;
export const SLOT_TEXELS = TILE_SAMPLES + 2 * BORDER;
export const SLOT_AREA = SLOT_TEXELS * SLOT_TEXELS;
/** The tile itself in a mask of nine tiles, bit (dy + 1) * 3 + dx + 1. */
export const SELF_BIT = 1 << 4;

/** Heights of the held tile of the same level at (x + dx, y + dy), or undefined; dx, dy from -1 to 1. */
export type HeldHeights = (dx: number, dy: number) => Float32Array | undefined;

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

/**
 * Writes the held samples to `out`, 69 x 69, row 0 south; others are left as they are. `copies`: each sample so many times
 * in a row; the atlas wants pairs (guide, base).
 */
export function assembleSlot(held: HeldHeights, out: Float32Array, copies = 2): void {
  // North to south and east to west: the last writer of a shared sample is its owner.
  for (let k = 8; k >= 0; k -= 1) {
    const across = SPANS[k % 3]!;
    const upward = SPANS[Math.floor(k / 3)]!;
    const source = held(across.d, upward.d);
    if (source !== undefined) copyPart(source, across, upward, out, copies);
  }
}

function copyPart(heights: Float32Array, across: Span, upward: Span, out: Float32Array, copies: number): void {
  const first = across.from - BORDER - across.shift;
  const width = across.to - across.from;
  for (let row = upward.from; row < upward.to; row += 1) {
    let from = (row - BORDER - upward.shift) * TILE_SAMPLES + first;
    let to = copies * (row * SLOT_TEXELS + across.from);
    for (const end = from + width; from < end; from += 1, to += copies) {
      const height = heights[from]!;
      out[to] = height;
      if (copies === 2) out[to + 1] = height;
    }
  }
}

/** The samples of one slot where nothing is made: one a place; without neighbours the border goes on with the edge's slope. */
export function assembleBordered(heights: Float32Array, held: HeldHeights, out: Float32Array): void {
  extrapolate(heights, out);
  assembleSlot((dx, dy) => (dx === 0 && dy === 0 ? heights : held(dx, dy)), out, 1);
}

function extrapolate(h: Float32Array, out: Float32Array): void {
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
      out[row * SLOT_TEXELS + col] = 2 * h[er * TILE_SAMPLES + ec]! - h[(2 * er - r) * TILE_SAMPLES + 2 * ec - c]!;
    }
  }
}
