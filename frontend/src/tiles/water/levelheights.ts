/** The heights of a whole level with the detail of that level, as water runs over them: made a few rows at a time. */

import { TILE_CELLS } from "../../generated/contract.ts";
import type { DetailField } from "../detail/detail.ts";
import { detailOf } from "../detail/subdivide.ts";

/** Rows that are made at a time. */
const BAND = 8;

export class LevelHeights {
  readonly side: number;
  readonly level: number;
  /** Metres, row 0 south; zero where they are not made yet. */
  readonly heights: Float32Array;
  readonly #field: DetailField;
  #rows = 0;

  constructor(field: DetailField, level: number) {
    this.level = level;
    this.side = TILE_CELLS * 2 ** level + 1;
    this.heights = new Float32Array(this.side * this.side);
    this.#field = field;
  }

  get done(): boolean {
    return this.#rows === this.side;
  }

  /** Makes rows until `isLate` says so; false when no ground is held. */
  advance(isLate: () => boolean): boolean {
    const { side, level } = this;
    do {
      const r1 = Math.min(this.#rows + BAND, side);
      const made = detailOf({ level, r0: this.#rows, r1, c0: 0, c1: side }, this.#field.recipe, true);
      if (made === null) return false;
      const from = this.#rows * side;
      for (let k = 0; k < made.d.length; k += 1)
        this.heights[from + k] = Math.fround(Math.fround(made.guide[k]!) + made.d[k]!);
      this.#rows = r1;
    } while (!this.done && !isLate());
    return true;
  }
}
