/**
 * Lowest and highest sample of a tile's 16 sub-patches, and the error of drawing the parent there (DESIGN 9). Twin of
 * `backend/esker/tiles/bounds.py`. Sub-patches are `[row * 4 + col]`, 16 cells a side, edge samples shared.
 */

import { PATCH_CELLS, SUBPATCHES, TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";

const N = TILE_SAMPLES;
type Samples = Int32Array | Float32Array;

/** Writes the lowest and highest of 65x65 `samples` per sub-patch. */
export function subRange(samples: Samples, low: Samples, high: Samples): void {
  for (let sub = 0; sub < SUBPATCHES * SUBPATCHES; sub++) {
    const r0 = PATCH_CELLS * Math.floor(sub / SUBPATCHES);
    const c0 = PATCH_CELLS * (sub % SUBPATCHES);
    let min = Number.POSITIVE_INFINITY;
    let max = Number.NEGATIVE_INFINITY;
    for (let r = r0; r <= r0 + PATCH_CELLS; r++) {
      for (let i = r * N + c0, end = i + PATCH_CELLS; i <= end; i++) {
        const v = samples[i]!;
        if (v < min) min = v;
        if (v > max) max = v;
      }
    }
    low[sub] = min;
    high[sub] = max;
  }
}

/**
 * Twice the largest distance of `samples` to the bilinear surface of the parent, per sub-patch, in the samples' unit.
 * `ratio` is the parent's unit in the samples' unit (2 for quanta, 1 for metres); (x, y) is the child.
 */
export function subDistance(
  samples: Samples,
  parent: Samples,
  ratio: number,
  x: number,
  y: number,
  out: Float64Array,
): void {
  const half = ratio / 2;
  const origin = (TILE_CELLS / 2) * ((y & 1) * N + (x & 1));
  out.fill(0);
  for (let r = 0; r < N; r++) {
    // The four parent samples around: at even rows and columns two or all of them are the same one.
    const below = origin + (r >> 1) * N;
    const above = r & 1 ? below + N : below;
    for (let c = 0; c < N; c++) {
      const west = c >> 1;
      const east = (c & 1) + west;
      const drawn =
        half * (parent[below + west]! + parent[below + east]! + parent[above + west]! + parent[above + east]!);
      const distance = Math.abs(2 * samples[r * N + c]! - drawn);
      widen(out, r, c, distance);
    }
  }
}

/** Counts a distance for every sub-patch that has the sample: one, on shared edges two, at shared corners four. */
function widen(out: Float64Array, r: number, c: number, distance: number): void {
  const row = Math.min(r >> 4, SUBPATCHES - 1);
  const col = Math.min(c >> 4, SUBPATCHES - 1);
  const at = row * SUBPATCHES + col;
  if (distance <= out[at]! && (r & 15) !== 0 && (c & 15) !== 0) return;
  const west = (c & 15) === 0 && c > 0 && c < TILE_CELLS;
  const south = (r & 15) === 0 && r > 0 && r < TILE_CELLS;
  if (distance > out[at]!) out[at] = distance;
  if (west && distance > out[at - 1]!) out[at - 1] = distance;
  if (south && distance > out[at - SUBPATCHES]!) out[at - SUBPATCHES] = distance;
  if (west && south && distance > out[at - SUBPATCHES - 1]!) out[at - SUBPATCHES - 1] = distance;
}
