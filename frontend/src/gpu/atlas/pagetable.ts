/**
 * Slot of a tile, for shaders that walk over the ground: a hash table with open addressing, so that its size follows the
 * atlas and not the number of tiles that a level could have. `page` in shaders/wgsl/tiles/pages.wgsl reads it.
 *
 * An entry is two words: column | level << 17, and row | slot << 17.
 */

import { MAX_SYNTHESIS_LEVEL } from "../../generated/contract.ts";

export const NO_SLOT = 0xffffffff;
/** Four places a slot: a look-up meets 1.1 entries on average. */
const PLACE_BITS = 12;
export const PLACES = 1 << PLACE_BITS;
const INDEX_BITS = MAX_SYNTHESIS_LEVEL;
const INDEX_MASK = (1 << INDEX_BITS) - 1;

interface Paged {
  readonly level: number;
  readonly x: number;
  readonly y: number;
  readonly slot: number;
}

function firstPlace(column: number, row: number): number {
  return ((Math.imul(column, 0x9e3779b1) ^ Math.imul(row, 0x85ebca77)) >>> 0) >>> (32 - PLACE_BITS);
}

export class PageTable {
  /** Pairs of words; `NO_SLOT` where empty. */
  readonly words: Uint32Array<ArrayBuffer> = new Uint32Array(2 * PLACES).fill(NO_SLOT);

  /** Holds exactly these tiles. Throws RangeError when there are more than the table was made for. */
  fill(residents: Iterable<Paged>): void {
    this.words.fill(NO_SLOT);
    let left = PLACES / 4;
    for (const { level, x, y, slot } of residents) {
      left -= 1;
      if (left < 0) throw new RangeError(`the page table is made for ${PLACES / 4} tiles`);
      const column = x | (level << INDEX_BITS);
      let place = firstPlace(column, y);
      while (this.words[2 * place] !== NO_SLOT) place = (place + 1) & (PLACES - 1);
      this.words[2 * place] = column;
      this.words[2 * place + 1] = (y | (slot << INDEX_BITS)) >>> 0;
    }
  }

  /** The slot of a tile or `NO_SLOT`: the shader's look-up, for tests. */
  slot(level: number, x: number, y: number): number {
    const column = x | (level << INDEX_BITS);
    let place = firstPlace(column, y);
    for (;;) {
      const found = this.words[2 * place]!;
      if (found === NO_SLOT) return NO_SLOT;
      const second = this.words[2 * place + 1]!;
      if (found === column && (second & INDEX_MASK) === y) return second >>> INDEX_BITS;
      place = (place + 1) & (PLACES - 1);
    }
  }
}
