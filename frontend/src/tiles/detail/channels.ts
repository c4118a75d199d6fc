/**
 * Noise amplitude and roughness as the strokes ask for them, and what is painted (DESIGN 5.4): smooth, so whole coarse
 * levels come, and they are shown at the finest level that is complete.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import { isUnderAny, keyLevel, keyX, keyY, tileKey } from "../../core/tilekey.ts";
import type { ChannelGrid, ChannelView, DecodedFrame } from "../../core/types.ts";
import {
  AMPLITUDE_QUANTA_PER_M,
  BASE_AMPLITUDE_M,
  BASE_BIAS,
  BASE_FAR,
  BASE_ROUGHNESS,
  BASE_SURVEY,
  BIAS_QUANTA,
  Channel,
  FAR_QUANTA,
  type PaintChannel,
  ROUGHNESS_QUANTA,
  SURVEY_QUANTA,
  TILE_CELLS,
  TILE_SAMPLES,
} from "../../generated/contract.ts";

interface Stream {
  readonly tiles: Map<number, Int32Array>;
  readonly quanta: number;
  readonly base: number;
  /** The finest complete level, -1 for none: what is shown. */
  level: number;
  /** The grid that is shown, until it changes. */
  grid: ChannelGrid | null;
}

const stream = (quanta: number, base: number): Stream => ({ tiles: new Map(), quanta, base, level: -1, grid: null });

const BIASES: readonly number[] = [Channel.SNOW, Channel.GRASS, Channel.FOREST, Channel.WETNESS, Channel.EROSION];

export class ChannelStore implements ChannelView {
  readonly sizeM: number;
  /** Rises when what is shown of a channel changes. Those that did not change keep their grids. */
  readonly revision: ReadonlySignal<number>;
  readonly #rev = signal(0);
  readonly #streams: ReadonlyMap<number, Stream> = new Map([
    [Channel.AMPLITUDE, stream(AMPLITUDE_QUANTA_PER_M, BASE_AMPLITUDE_M)],
    [Channel.ROUGHNESS, stream(ROUGHNESS_QUANTA, BASE_ROUGHNESS)],
    [Channel.SURVEY, stream(SURVEY_QUANTA, BASE_SURVEY)],
    [Channel.FAR, stream(FAR_QUANTA, BASE_FAR)],
    ...BIASES.map((channel) => [channel, stream(BIAS_QUANTA, BASE_BIAS)] as const),
  ]);
  /** The next frame of a new connection replaces everything. */
  #stale = false;

  constructor(sizeM: number) {
    this.sizeM = sizeM;
    this.revision = this.#rev;
  }

  get stamp(): number {
    return this.#rev.peek();
  }

  get amplitude(): ChannelGrid {
    return this.#grid(Channel.AMPLITUDE);
  }

  get roughness(): ChannelGrid {
    return this.#grid(Channel.ROUGHNESS);
  }

  get snow(): ChannelGrid {
    return this.#grid(Channel.SNOW);
  }

  get grass(): ChannelGrid {
    return this.#grid(Channel.GRASS);
  }

  get forest(): ChannelGrid {
    return this.#grid(Channel.FOREST);
  }

  get wetness(): ChannelGrid {
    return this.#grid(Channel.WETNESS);
  }

  get erosion(): ChannelGrid {
    return this.#grid(Channel.EROSION);
  }

  get far(): ChannelGrid {
    return this.#grid(Channel.FAR);
  }

  get survey(): ChannelGrid {
    return this.#grid(Channel.SURVEY);
  }

  /** Noise amplitude in metres at a place; outside the domain that of the nearest border. */
  amplitudeAt(x: number, y: number): number {
    return sampleGrid(this.amplitude, x / this.sizeM, y / this.sizeM);
  }

  /** Returns what strokes ask of any channel at a place: metres of amplitude, roughness 0..1, biases -1..1. */
  valueAt(channel: PaintChannel, x: number, y: number): number {
    return sampleGrid(this[channel], x / this.sizeM, y / this.sizeM);
  }

  /** Roughness 0..1 at a place; outside the domain that of the nearest border. */
  roughnessAt(x: number, y: number): number {
    return sampleGrid(this.roughness, x / this.sizeM, y / this.sizeM);
  }

  /** A new connection begins: what is held goes when its first frame comes. */
  restart(): void {
    this.#stale = true;
  }

  /**
   * The ground of the new connection is here. What was held goes now if no frame of a channel came with it: a channel
   * of which nobody asks anything any more is not sent.
   */
  renewed(): void {
    if (!this.#stale) return;
    this.#stale = false;
    for (const stream of this.#streams.values()) {
      if (stream.tiles.size === 0) continue;
      stream.tiles.clear();
      this.#show(stream, -1);
    }
  }

  /** Applies a frame of one of the channels; heights are none of its business. */
  apply(frame: DecodedFrame): void {
    const into = this.#streams.get(frame.channel);
    if (into === undefined) return;
    this.renewed();
    const gone = new Set(frame.drops.map((d) => tileKey(frame.level, d.x, d.y)));
    if (gone.size > 0)
      for (const key of into.tiles.keys()) if (isUnderAny(key, gone, frame.level)) into.tiles.delete(key);
    for (const tile of frame.tiles) into.tiles.set(tileKey(frame.level, tile.x, tile.y), tile.samples);
    const level = finestComplete(into.tiles);
    if (level !== into.level || (level === frame.level && frame.tiles.length > 0)) this.#show(into, level);
  }

  #show(stream: Stream, level: number): void {
    stream.level = level;
    stream.grid = null;
    this.#rev.value += 1;
  }

  #grid(channel: number): ChannelGrid {
    const stream = this.#streams.get(channel)!;
    stream.grid ??= compose(stream);
    return stream.grid;
  }
}

function finestComplete(tiles: ReadonlyMap<number, unknown>): number {
  const counts: number[] = [];
  for (const key of tiles.keys()) counts[keyLevel(key)] = (counts[keyLevel(key)] ?? 0) + 1;
  let level = -1;
  while (counts[level + 1] === 4 ** (level + 1)) level += 1;
  return level;
}

/** The finest complete level as one grid; a single cell of the base value while there is none. */
function compose({ tiles, quanta, base, level }: Stream): ChannelGrid {
  if (level < 0) return { side: 2, values: new Float32Array(4).fill(base) };
  const side = (TILE_CELLS << level) + 1;
  const values = new Float32Array(side * side);
  for (const [key, samples] of tiles) {
    if (keyLevel(key) !== level) continue;
    const origin = keyY(key) * TILE_CELLS * side + keyX(key) * TILE_CELLS;
    for (let row = 0; row < TILE_SAMPLES; row += 1)
      for (let col = 0; col < TILE_SAMPLES; col += 1)
        values[origin + row * side + col] = samples[row * TILE_SAMPLES + col]! / quanta + base;
  }
  return { side, values };
}

/** Bilinear value at (u, v), fractions of the domain. */
function sampleGrid({ side, values }: ChannelGrid, u: number, v: number): number {
  const cells = side - 1;
  const x = Math.min(Math.max(u, 0), 1) * cells;
  const y = Math.min(Math.max(v, 0), 1) * cells;
  const col = Math.min(Math.floor(x), cells - 1);
  const row = Math.min(Math.floor(y), cells - 1);
  const at = row * side + col;
  const south = values[at]! * (1 - x + col) + values[at + 1]! * (x - col);
  const north = values[at + side]! * (1 - x + col) + values[at + side + 1]! * (x - col);
  return south * (1 - y + row) + north * (y - row);
}
