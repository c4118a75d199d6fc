/**
 * Biases that strokes give the synthesis at its samples, and the data level that holds it back. Channels are read at
 * exact fractions, so both sides of a seam agree.
 */

import type { ChannelGrid, ChannelView } from "../../core/types.ts";
import { TILE_CELLS } from "../../generated/contract.ts";
import type { Sample } from "../rules/rule.ts";

/** One channel, bilinear over the whole domain. A place outside gets the value of the nearest border. */
class Channel {
  readonly #grid: ChannelGrid;
  /** The value everywhere, where it is the same everywhere; else null. */
  readonly #same: number | null;

  constructor(grid: ChannelGrid) {
    this.#grid = grid;
    const first = grid.values[0]!;
    this.#same = grid.values.every((v) => v === first) ? first : null;
  }

  at(level: number, j: number, i: number): number {
    if (this.#same !== null) return this.#same;
    const { side, values } = this.#grid;
    const cells = side - 1;
    const n = TILE_CELLS * 2 ** level;
    const x = Math.min(Math.max(i, 0), n) * cells;
    const y = Math.min(Math.max(j, 0), n) * cells;
    const col = Math.min(Math.floor(x / n), cells - 1);
    const row = Math.min(Math.floor(y / n), cells - 1);
    const u = (x - col * n) / n;
    const v = (y - row * n) / n;
    const k = row * side + col;
    const south = values[k]! * (1 - u) + values[k + 1]! * u;
    const north = values[k + side]! * (1 - u) + values[k + side + 1]! * u;
    return south * (1 - v) + north * v;
  }
}

/** The channels as they are at this moment: grids are immutable. */
export class Biases {
  readonly #amplitude: Channel;
  readonly #roughness: Channel;
  readonly #snow: Channel;
  readonly #grass: Channel;
  readonly #forest: Channel;
  readonly #wetness: Channel;
  readonly #survey: Channel;

  constructor(channels: Omit<ChannelView, "stamp">) {
    this.#amplitude = new Channel(channels.amplitude);
    this.#roughness = new Channel(channels.roughness);
    this.#snow = new Channel(channels.snow);
    this.#grass = new Channel(channels.grass);
    this.#forest = new Channel(channels.forest);
    this.#wetness = new Channel(channels.wetness);
    this.#survey = new Channel(channels.survey);
  }

  /** Fills in the biases of the sample in row j and column i of a level; with `relief`, those that heights depend on. */
  at(level: number, j: number, i: number, relief: boolean, into: Sample): void {
    into.amplitude = this.#amplitude.at(level, j, i);
    into.roughness = this.#roughness.at(level, j, i);
    into.snowBias = this.#snow.at(level, j, i);
    into.survey = this.#survey.at(level, j, i);
    if (relief) return;
    into.grassBias = this.#grass.at(level, j, i);
    into.forestBias = this.#forest.at(level, j, i);
    into.wetBias = this.#wetness.at(level, j, i);
  }
}
