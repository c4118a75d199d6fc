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
  for (let sub = 0; sub < SUBPATCHES * SUBPATCHES; sub++) {
    const r0 = PATCH_CELLS * Math.floor(sub / SUBPATCHES);
    const c0 = PATCH_CELLS * (sub % SUBPATCHES);
    let worst = 0;
    for (let r = r0; r <= r0 + PATCH_CELLS; r++) {
      const row = r * N + c0;
      const south = origin + (r >> 1) * N + (c0 >> 1);
      const found = rowDistance(samples, row, parent, south, south + (r & 1) * N, half);
      if (found > worst) worst = found;
    }
    out[sub] = worst;
  }
}

/** Twice the largest distance along 17 samples, whose even ones lie between parent samples `south` and `north`. */
function rowDistance(
  samples: Samples,
  row: number,
  parent: Samples,
  south: number,
  north: number,
  half: number,
): number {
  let worst = 0;
  let west = half * (parent[south]! + parent[north]!);
  let d = Math.abs(2 * samples[row]! - 2 * west);
  if (d > worst) worst = d;
  for (let i = 1; i <= PATCH_CELLS / 2; i++) {
    const east = half * (parent[south + i]! + parent[north + i]!);
    d = Math.abs(2 * samples[row + 2 * i - 1]! - west - east);
    if (d > worst) worst = d;
    d = Math.abs(2 * samples[row + 2 * i]! - 2 * east);
    if (d > worst) worst = d;
    west = east;
  }
  return worst;
}
