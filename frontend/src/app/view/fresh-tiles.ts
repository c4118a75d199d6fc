/**
 * Changing to the tiles of a new connection without a flash of empty land.
 *
 * After a reconnect the server knows nothing of what this page holds and sends every level again, coarse before fine.
 * What it sends is kept aside until the coarse levels are complete, or for a short while; then the old tiles go and
 * the new ones come in one step.
 */

import { batch } from "@preact/signals-core";
import type { DecodedFrame } from "../../core/types.ts";
import { Channel, FrameKind } from "../../generated/contract.ts";

/** Levels 0 to 2 cover the whole terrain for every view. */
const COARSE = 2;
const PATIENCE_MS = 700;

/** The part of the tile store that is needed. */
export interface TileSink {
  /** Finest level that is solved everywhere. */
  readonly solved: number;
  clear(): void;
  apply(frame: DecodedFrame): void;
}

export class FreshTiles {
  readonly #tiles: TileSink;
  readonly #done: () => void;
  readonly #frames: DecodedFrame[] = [];
  #timer: ReturnType<typeof setTimeout> | undefined;

  /** `done` is called once, when the new tiles are shown; frames go straight to the store from then on. */
  constructor(tiles: TileSink, done: () => void) {
    this.#tiles = tiles;
    this.#done = done;
  }

  apply(frame: DecodedFrame): void {
    this.#frames.push(frame);
    this.#timer ??= setTimeout(() => this.#show(), PATIENCE_MS);
    const coarse = Math.min(COARSE, this.#tiles.solved);
    // The base of a level comes before what lies on it.
    const height = frame.channel === Channel.HEIGHT;
    if (height && frame.kind === FrameKind.LEVEL && frame.level >= coarse) this.#show();
  }

  stop(): void {
    clearTimeout(this.#timer);
  }

  #show(): void {
    this.stop();
    batch(() => {
      this.#tiles.clear();
      for (const frame of this.#frames) this.#tiles.apply(frame);
    });
    this.#done();
  }
}
