/**
 * The water of the ground as it is shown, found in this page: on the samples of one level with its detail, a few rows at a time
 * beside frames, anew while the ground changes and somebody looks (docs/water.md).
 */

import { effect, type ReadonlySignal, signal } from "@preact/signals-core";
import { LAKE_LEVEL, QUANTA_PER_CELL } from "../../../generated/contract.ts";
import type { DetailField } from "../../../tiles/detail/detail.ts";
import { LevelHeights } from "../../../tiles/water/levelheights.ts";
import { findWater, quanta, seaQuanta, type Water } from "../../../tiles/water/water.ts";

/** Water on a square grid over the domain. */
export interface WaterField {
  readonly water: Water;
  readonly side: number;
  readonly cellM: number;
  /** Metres of one whole step of height. */
  readonly stepM: number;
  /** Metres, as they were before they were made whole. */
  readonly heights: Float32Array;
}

/** What the water is that of. */
export interface WaterSource {
  readonly sizeM: number;
  /** Whether somebody looks. */
  readonly wanted: () => boolean;
  /** The ground's detail, another object once anything changes. */
  readonly ground: () => DetailField | null;
  readonly seaM: () => number | null;
}

interface Making {
  readonly of: LevelHeights;
  readonly ground: DetailField;
  readonly seaM: number | null;
}

/** A search takes so much of a frame at a time, and the next one begins so long after the last. */
const SLICE_MS = 8;
const REST_MS = 300;

export class FoundWater {
  readonly #found = signal<WaterField | null>(null);
  readonly #source: WaterSource;
  readonly #now: () => number;
  readonly #stop: () => void;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #made: { readonly ground: DetailField; readonly seaM: number | null } | null = null;
  #making: Making | null = null;
  #began = Number.NEGATIVE_INFINITY;

  constructor(source: WaterSource, now: () => number = () => performance.now()) {
    this.#source = source;
    this.#now = now;
    this.#stop = effect(() => {
      if (source.wanted() && source.ground() !== null) {
        source.seaM();
        this.#request();
      }
    });
  }

  /** Null before it was found. */
  get found(): ReadonlySignal<WaterField | null> {
    return this.#found;
  }

  dispose(): void {
    this.#stop();
    clearTimeout(this.#timer);
  }

  #request(): void {
    if (this.#timer !== undefined) return;
    const wait = this.#making === null ? Math.max(0, this.#began + REST_MS - this.#now()) : 0;
    this.#timer = setTimeout(() => this.#go(), wait);
  }

  #go(): void {
    this.#timer = undefined;
    const began = this.#now();
    this.#making ??= this.#begin();
    if (this.#making === null) return;
    const { of, ground, seaM } = this.#making;
    if (!of.advance(() => this.#now() - began > SLICE_MS)) {
      this.#making = null;
      return;
    }
    if (of.done) {
      this.#making = null;
      this.#made = { ground, seaM };
      const field = fieldOf(of.heights, of.side, this.#source.sizeM, seaM);
      if (field !== null) this.#found.value = field;
    }
    if (this.#making !== null || this.#isStale()) this.#request();
  }

  #begin(): Making | null {
    const ground = this.#source.ground();
    if (ground === null || !this.#source.wanted() || !this.#isStale()) return null;
    this.#began = this.#now();
    return { of: new LevelHeights(ground, LAKE_LEVEL), ground, seaM: this.#source.seaM() };
  }

  #isStale(): boolean {
    const { ground, seaM, wanted } = this.#source;
    return wanted() && (this.#made === null || this.#made.ground !== ground() || this.#made.seaM !== seaM());
  }
}

/** The water of heights in metres; null where there is no ground that water could run over. */
export function fieldOf(heights: Float32Array, side: number, sizeM: number, seaM: number | null): WaterField | null {
  const cellM = sizeM / (side - 1);
  const z = quanta(heights, cellM);
  if (z === null) return null;
  const water = findWater({ rows: side, cols: side, z }, seaQuanta(seaM, cellM));
  return { water, side, cellM, stepM: cellM / QUANTA_PER_CELL, heights };
}
