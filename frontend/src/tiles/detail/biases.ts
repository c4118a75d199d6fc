/**
 * Biases that strokes give the synthesis at its samples, and the data level that holds it back. Channels are read at
 * exact fractions, so both sides of a seam agree.
 */

import type { ChannelGrid, ChannelView } from "../../core/types.ts";
import { SYNTH_FAR_SHARE, TILE_CELLS } from "../../generated/contract.ts";
import type { Sample, Site } from "../rules/rule.ts";

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

/** What is taken off a distance, metres: half a cell of its grid, as bilinear values on a line are up to that. */
export function farMarginM(far: ChannelGrid, sizeM: number): number {
  return sizeM / (2 * Math.max(TILE_CELLS, far.side - 1));
}

/** Whether settings or paint ask for gullies anywhere. */
export function isEroded(erosion: ChannelGrid, strength: number): boolean {
  return strength > 0 || erosion.values.some((v) => v > 0);
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
  readonly #erosion: Channel;
  readonly #far: Channel;
  /** Metres of which `far` is a share, and what is taken off a distance: half a cell of its grid (Site.far_margin_m). */
  readonly #farM: number;
  readonly #farMarginM: number;
  /** Gullies are asked for anywhere. */
  readonly eroded: boolean;

  /** `site`: of the terrain whose channels these are. */
  constructor(channels: Omit<ChannelView, "stamp">, site: Pick<Site, "sizeM" | "erosion">) {
    this.#amplitude = new Channel(channels.amplitude);
    this.#roughness = new Channel(channels.roughness);
    this.#snow = new Channel(channels.snow);
    this.#grass = new Channel(channels.grass);
    this.#forest = new Channel(channels.forest);
    this.#wetness = new Channel(channels.wetness);
    this.#survey = new Channel(channels.survey);
    this.#erosion = new Channel(channels.erosion);
    this.#far = new Channel(channels.far);
    this.#farM = SYNTH_FAR_SHARE * site.sizeM;
    this.#farMarginM = farMarginM(channels.far, site.sizeM);
    this.eroded = isEroded(channels.erosion, site.erosion);
  }

  /** Fills in the biases of the sample in row j and column i of a level; with `relief`, those that heights depend on. */
  at(level: number, j: number, i: number, relief: boolean, into: Sample): void {
    into.amplitude = this.#amplitude.at(level, j, i);
    into.roughness = this.#roughness.at(level, j, i);
    into.snowBias = this.#snow.at(level, j, i);
    into.survey = this.#survey.at(level, j, i);
    into.eroded = this.eroded;
    if (this.eroded) {
      into.erosionBias = this.#erosion.at(level, j, i);
      into.farM = Math.max(0, this.#farM * this.#far.at(level, j, i) - this.#farMarginM);
    }
    if (relief) return;
    into.grassBias = this.#grass.at(level, j, i);
    into.forestBias = this.#forest.at(level, j, i);
    into.wetBias = this.#wetness.at(level, j, i);
  }
}
