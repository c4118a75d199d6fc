/** The ground as it is scored: the exact samples of the level of tasks, from the tiles that the page holds. Pure. */

import { msg } from "@lit/localize";
import type { Heights } from "../../../core/difference.ts";
import { TASK_LEVEL, TILE_CELLS, TILE_SAMPLES } from "../../../generated/contract.ts";
import type { TileGround } from "../../../tiles/ground.ts";

export const NOT_YET = msg("The ground is still on its way. Try again in a moment.");

/** The heights of the finest level up to that of tasks; throws an Error with a sentence while tiles of it are missing. */
export function scoredGround(ground: TileGround, solved: number): Heights {
  const level = Math.min(TASK_LEVEL, solved);
  const tiles = 2 ** level;
  const side = tiles * TILE_CELLS + 1;
  const data = new Float32Array(side * side);
  for (let ty = 0; ty < tiles; ty += 1)
    for (let tx = 0; tx < tiles; tx += 1) {
      const tile = ground.tile(level, tx, ty);
      if (tile === undefined) throw new Error(NOT_YET);
      for (let row = 0; row < TILE_SAMPLES; row += 1)
        data.set(
          tile.heights.subarray(row * TILE_SAMPLES, (row + 1) * TILE_SAMPLES),
          (ty * TILE_CELLS + row) * side + tx * TILE_CELLS,
        );
    }
  return { side, data };
}
