/**
 * Slot of a tile, for shaders that walk over the ground: a hash table with open addressing, so that its size follows the
 * atlas and not the number of tiles that a level could have. `page` in shaders/wgsl/compute_sun.wgsl reads it.
 */

import { tileKey } from "../core/tilekey.ts";
import type { Resident } from "./atlas.ts";

export const NO_SLOT = 0xffffffff;
/** Four places a slot: a look-up meets 1.1 entries on average. */
const PLACE_BITS = 12;
export const PLACES = 1 << PLACE_BITS;
const MULTIPLIER = 0x9e3779b1;

export class PageTable {
  /** Pairs of tile key and slot; `NO_SLOT` where empty. */
  readonly words: Uint32Array<ArrayBuffer> = new Uint32Array(2 * PLACES).fill(NO_SLOT);

  /** Holds exactly these tiles. Throws RangeError when there are more than the table was made for. */
  fill(residents: Iterable<Resident>): void {
    this.words.fill(NO_SLOT);
    let left = PLACES / 4;
    for (const { level, x, y, slot } of residents) {
      left -= 1;
      if (left < 0) throw new RangeError(`the page table is made for ${PLACES / 4} tiles`);
      const key = tileKey(level, x, y);
      let place = Math.imul(key, MULTIPLIER) >>> (32 - PLACE_BITS);
      while (this.words[2 * place] !== NO_SLOT) place = (place + 1) & (PLACES - 1);
      this.words[2 * place] = key;
      this.words[2 * place + 1] = slot;
    }
  }

  /** The slot of a tile or `NO_SLOT`: the shader's look-up, for tests. */
  slot(level: number, x: number, y: number): number {
    const key = tileKey(level, x, y);
    let place = Math.imul(key, MULTIPLIER) >>> (32 - PLACE_BITS);
    for (;;) {
      const found = this.words[2 * place]!;
      if (found === key) return this.words[2 * place + 1]!;
      if (found === NO_SLOT) return NO_SLOT;
      place = (place + 1) & (PLACES - 1);
    }
  }
}
