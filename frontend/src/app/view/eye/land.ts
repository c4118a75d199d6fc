/** How high the land lies, for the view of the whole of it. Pure. */

import type { Land } from "../../../core/camera/state.ts";
import type { TileView, Vec3 } from "../../../core/types.ts";
import { TILE_SAMPLES } from "../../../generated/contract.ts";

/** Heights are told in steps of this share of the side, so that a view at home does not tremble while the ground arrives. */
const STEPS = 128;
/** Blocks along a side: of each the highest place counts as a summit. */
const BLOCKS = 4;

/** From the coarsest tile, `samples` heights along a side of `sizeM` metres, row 0 in the south. */
export function landOf(heights: ArrayLike<number>, samples: number, sizeM: number): Land {
  const step = sizeM / STEPS;
  const all = Array.from(heights);
  const groundM = step * Math.round(all.reduce((sum, h) => sum + h, 0) / all.length / step);
  const lowM = step * Math.round(Math.min(...all) / step);
  const summits = new Map<number, Vec3>();
  all.forEach((h, k) => {
    const [col, row] = [k % samples, Math.floor(k / samples)];
    const of = (v: number): number => Math.min(BLOCKS - 1, Math.floor((v / (samples - 1)) * BLOCKS));
    const block = BLOCKS * of(row) + of(col);
    const spacing = sizeM / (samples - 1);
    if (h > (summits.get(block)?.[2] ?? groundM))
      summits.set(block, [col * spacing, row * spacing, step * Math.ceil(h / step)]);
  });
  return { groundM, lowM, peaks: [...summits.values()] };
}

/** How the land of tiles lies now; null before it has come. */
export function landOfTiles(tiles: Pick<TileView, "sizeM" | "tile">): Land | null {
  const heights = tiles.tile(0, 0, 0)?.heights;
  return heights === undefined ? null : landOf(heights, TILE_SAMPLES, tiles.sizeM);
}
