/**
 * A child tile predicted from its parent (DESIGN 6): the interpolating 4-point rule (-1, 9, 9, -1)/16 in both
 * directions, one-sided (5, 15, -5, 1)/16 at the border of the parent tile. Twin of `backend/esker/tiles/codec.py`.
 *
 * Samples on a tile's edge depend on the parent's samples on that edge only, so neighbours predict equal edges.
 */

import { TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";

const N = TILE_SAMPLES;
const HALF = TILE_CELLS / 2;
/** Rows and columns of the parent that a child reads: its own 33 and one or two beyond, inside the tile. */
const SPAN = HALF + 3;

const columns = new Float64Array(SPAN * N);

/**
 * Interpolates 65 values, 16 times too large, from the parent's line. `first` is the parent index of the child's first
 * sample (0 or 32); `base` and `step` address the line in `source`.
 */
function line(
  source: ArrayLike<number>,
  base: number,
  step: number,
  first: number,
  out: Float64Array,
  outBase: number,
  outStep: number,
): void {
  for (let i = 0; i <= HALF; i++) out[outBase + 2 * i * outStep] = 16 * source[base + (first + i) * step]!;
  for (let i = 0; i < HALF; i++) {
    const at = base + (first + i) * step;
    const k = first + i;
    let value: number;
    if (k === 0)
      value = 5 * source[at]! + 15 * source[at + step]! - 5 * source[at + 2 * step]! + source[at + 3 * step]!;
    else if (k === TILE_CELLS - 1)
      value = 5 * source[at + step]! + 15 * source[at]! - 5 * source[at - step]! + source[at - 2 * step]!;
    else value = 9 * (source[at]! + source[at + step]!) - source[at - step]! - source[at + 2 * step]!;
    out[outBase + (2 * i + 1) * outStep] = value;
  }
}

const scaled = new Float64Array(N * N);

/** The tensor product, 256 times too large, in `scaled`. All sums of integers below 2^28 are exact in float64. */
function interpolate(parent: ArrayLike<number>, x: number, y: number): Float64Array {
  const firstCol = HALF * (x & 1);
  const firstRow = HALF * (y & 1);
  const lowRow = Math.max(0, firstRow - 1);
  const highRow = Math.min(TILE_CELLS, firstRow + HALF + 1);
  // One-sided rules reach four samples inward, always inside the child's own half.
  for (let r = lowRow; r <= highRow; r++) line(parent, r * N, 1, firstCol, columns, (r - lowRow) * N, 1);
  for (let c = 0; c < N; c++) verticalLine(c, firstRow, lowRow);
  return scaled;
}

/** Interpolates one column of `columns`, whose row 0 is the parent's row `lowRow`, into `scaled`. */
function verticalLine(c: number, firstRow: number, lowRow: number): void {
  line(columns, c - lowRow * N, N, firstRow, scaled, c, N);
}

/**
 * Exact prediction in quanta of the child's level from the parent's quanta (twice as large):
 * `floor((sum + 64) / 128)`. `parent` and `out` are 65x65, row 0 south; (x, y) is the child, only parities matter.
 */
export function predictInts(parent: Int32Array, x: number, y: number, out: Int32Array): void {
  const sums = interpolate(parent, x, y);
  for (let i = 0; i < N * N; i++) out[i] = Math.floor((sums[i]! + 64) / 128);
}

/** The same rule in metres, without rounding to quanta: what a child moves by when its parent moves by `parent`. */
export function predictMetres(parent: Float32Array, x: number, y: number, out: Float32Array): void {
  const sums = interpolate(parent, x, y);
  for (let i = 0; i < N * N; i++) out[i] = sums[i]! / 256;
}
