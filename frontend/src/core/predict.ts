/**
 * A child tile predicted from its parent (DESIGN 6): the interpolating 4-point rule (-1, 9, 9, -1)/16 in both
 * directions, one-sided (5, 15, -5, 1)/16 at the border of the parent tile. Twin of `backend/esker/tiles/codec/payload.py`.
 *
 * Samples on a tile's edge depend on the parent's samples on that edge only, so neighbours predict equal edges.
 */

import { TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";

type Samples = Int32Array | Float32Array;

const N = TILE_SAMPLES;
const HALF = TILE_CELLS / 2;
/** Rows and columns of the parent that a child reads: its own 33 and one or two beyond, inside the tile. */
const SPAN = HALF + 3;

const columns = new Float64Array(SPAN * N);
const scaled = new Float64Array(N * N);

/** The four samples, as steps from the one before the middle, and weights for the middle after parent sample `k`. */
interface Rule {
  readonly at: readonly [number, number, number, number];
  readonly weights: readonly [number, number, number, number];
}

const INNER: Rule = { at: [-1, 0, 1, 2], weights: [-1, 9, 9, -1] };
const FIRST: Rule = { at: [0, 1, 2, 3], weights: [5, 15, -5, 1] };
const LAST: Rule = { at: [-2, -1, 0, 1], weights: [1, -5, 15, 5] };

function rule(k: number): Rule {
  return k === 0 ? FIRST : k === TILE_CELLS - 1 ? LAST : INNER;
}

/** Row `row` of the parent from column `first` on, 16 times too large, as the child's 65 columns in `columns`. */
function widenRow(parent: Samples, row: number, first: number, out: number): void {
  const base = row * N + first;
  for (let i = 0; i <= HALF; i++) columns[out + 2 * i] = 16 * parent[base + i]!;
  const from = first === 0 ? 1 : 0;
  const to = first === 0 ? HALF : HALF - 1;
  for (let i = from; i < to; i++) {
    const at = base + i;
    columns[out + 2 * i + 1] = 9 * (parent[at]! + parent[at + 1]!) - parent[at - 1]! - parent[at + 2]!;
  }
  const edge = first === 0 ? 0 : HALF - 1;
  const { at, weights } = rule(first + edge);
  let sum = 0;
  for (let j = 0; j < 4; j++) sum += weights[j]! * parent[base + edge + at[j]!]!;
  columns[out + 2 * edge + 1] = sum;
}

/** The tensor product, 256 times too large, in `scaled`. All sums of integers below 2^28 are exact in float64. */
function interpolate(parent: Samples, x: number, y: number): void {
  const firstCol = HALF * (x & 1);
  const firstRow = HALF * (y & 1);
  const lowRow = Math.max(0, firstRow - 1);
  const highRow = Math.min(TILE_CELLS, firstRow + HALF + 1);
  // One-sided rules reach four samples inward, always inside the child's own half.
  for (let r = lowRow; r <= highRow; r++) widenRow(parent, r, firstCol, (r - lowRow) * N);
  for (let i = 0; i <= HALF; i++) {
    const from = (firstRow + i - lowRow) * N;
    const to = 2 * i * N;
    for (let c = 0; c < N; c++) scaled[to + c] = 16 * columns[from + c]!;
    if (i < HALF) middleRow(from, rule(firstRow + i), to + N);
  }
}

function middleRow(from: number, { at, weights }: Rule, to: number): void {
  const [a, b, c, d] = at.map((step) => from + step * N) as [number, number, number, number];
  const [wa, wb, wc, wd] = weights;
  for (let i = 0; i < N; i++) {
    scaled[to + i] = wa * columns[a + i]! + wb * columns[b + i]! + wc * columns[c + i]! + wd * columns[d + i]!;
  }
}

/**
 * Exact prediction in quanta of the child's level. `ratio`: quanta of the child in one of the parent's, 2 for heights
 * (`floor((sum + 64) / 128)`), 1 for the other channels (`floor((sum + 128) / 256)`). `parent` and `out` are 65x65, row 0
 * south; (x, y) is the child, only parities matter.
 */
export function predictInts(parent: Int32Array, x: number, y: number, out: Int32Array, ratio: 1 | 2 = 2): void {
  interpolate(parent, x, y);
  const whole = 256 / ratio;
  for (let i = 0; i < N * N; i++) out[i] = Math.floor((scaled[i]! + whole / 2) / whole);
}

/** Predicts in metres, without rounding to quanta, what a child moves by when its parent moves by `parent`. */
export function predictMetres(parent: Float32Array, x: number, y: number, out: Float32Array): void {
  interpolate(parent, x, y);
  for (let i = 0; i < N * N; i++) out[i] = scaled[i]! / 256;
}
