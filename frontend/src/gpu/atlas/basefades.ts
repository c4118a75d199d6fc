/**
 * Ground that blends over where a refined tile comes to a place that was interpolated, or leaves it (DESIGN 5.6): heights on
 * their way from the one to the other.
 *
 * A tile that blends counts as held: its neighbours take shared samples from it, all that lies below is made from it, so no
 * crack can open at any moment.
 */

import { predictMetres } from "../../core/predict.ts";
import { tileKey } from "../../core/tilekey.ts";
import { TILE_SAMPLES } from "../../generated/contract.ts";

const AREA = TILE_SAMPLES * TILE_SAMPLES;

interface Fade {
  readonly from: Float32Array;
  /** null: to the store's own heights, whatever they are by then. */
  readonly to: Float32Array | null;
  /** Share of the way that lies behind. */
  gone: number;
  heights: Float32Array;
}

export class BaseFades {
  readonly #fades = new Map<number, Fade>();

  get any(): boolean {
    return this.#fades.size > 0;
  }

  /** Heights at this moment of a tile that blends. */
  heights(level: number, x: number, y: number): Float32Array | undefined {
    return this.#fades.get(tileKey(level, x, y))?.heights;
  }

  /** True while a tile blends towards what the store holds. */
  arrives(level: number, x: number, y: number): boolean {
    return this.#fades.get(tileKey(level, x, y))?.to === null;
  }

  /** A tile has come to where its parent was interpolated. */
  arrive(level: number, x: number, y: number, parent: Float32Array): void {
    const from = this.heights(level, x, y) ?? interpolated(parent, x, y);
    this.#fades.set(tileKey(level, x, y), { from, to: null, gone: 0, heights: from });
  }

  /** A tile with these heights has gone; its parent will be interpolated. */
  leave(level: number, x: number, y: number, heights: Float32Array, parent: Float32Array): void {
    this.#fades.set(tileKey(level, x, y), { from: heights, to: interpolated(parent, x, y), gone: 0, heights });
  }

  /** Nobody draws the tile any more: it is there with the next `advance`, for those who share samples with it. */
  finish(level: number, x: number, y: number): void {
    const fade = this.#fades.get(tileKey(level, x, y));
    if (fade !== undefined) fade.gone = 1;
  }

  /** Goes on by this share of the way. Returns the keys of the tiles whose ground moved. */
  advance(share: number, stored: (key: number) => Float32Array | undefined): Set<number> {
    const moved = new Set<number>();
    for (const [key, fade] of this.#fades) {
      moved.add(key);
      fade.gone += share;
      const to = fade.to ?? stored(key);
      if (fade.gone >= 1 || to === undefined) this.#fades.delete(key);
      else fade.heights = between(fade.from, to, fade.gone * fade.gone * (3 - 2 * fade.gone));
    }
    return moved;
  }
}

function interpolated(parent: Float32Array, x: number, y: number): Float32Array {
  const out = new Float32Array(AREA);
  predictMetres(parent, x, y, out);
  return out;
}

function between(a: Float32Array, b: Float32Array, t: number): Float32Array {
  const out = new Float32Array(AREA);
  for (let i = 0; i < AREA; i += 1) out[i] = a[i]! + (b[i]! - a[i]!) * t;
  return out;
}
