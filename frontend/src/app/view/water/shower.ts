/** Rain that falls and runs on the ground as it is shown: drops as they are drawn (tiles/water/rain.ts moves them). */

import { type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import type { Place } from "../../../core/measure/places.ts";
import type { DropsVisual, Ground } from "../../../core/types.ts";
import { type Cloud, Rain } from "../../../tiles/water/rain.ts";
import type { WaterField } from "./field.ts";

/** How many drops there are at once. */
const DROPS = 5000;
const FLOATS = 4;
/** A drop begins to fall so high above the ground, a share of the domain. */
const HIGH = 1 / 48;
/** New heights of drawn ground that are asked for in one frame. */
const LOOKED_UP = 600;
/** Seconds of rain before a picture in which nothing may move. */
const CALM_S = 14;
const CALM_STEP_S = 0.1;
const LONGEST_STEP_S = 0.1;

export class Shower {
  /** Rain falls everywhere, else around the place. */
  readonly everywhere: Signal<boolean> = signal(true);
  /** How far around the place it falls, metres. */
  readonly radiusM: Signal<number>;
  readonly #raining = signal(false);
  readonly #data = new Float32Array(FLOATS * DROPS);
  readonly #sizeM: number;
  readonly #shown: () => Ground;
  readonly #calm: () => boolean;
  #rain: Rain | null = null;
  #field: WaterField | null = null;
  /** Heights of the drawn ground at the samples, NaN where nobody asked; and of which they are those of the ground now. */
  #heights = new Float32Array(0);
  #fresh = new Uint8Array(0);
  #ground: Ground | null = null;
  #stamp = 0;
  #count = 0;
  /** Seconds for which it has rained where nothing may move. */
  #calmS = 0;

  constructor(sizeM: number, shown: () => Ground, calm: () => boolean) {
    this.#sizeM = sizeM;
    this.#shown = shown;
    this.#calm = calm;
    this.radiusM = signal(sizeM / 10);
  }

  /** Whether drops are on their way. */
  get raining(): ReadonlySignal<boolean> {
    return this.#raining;
  }

  /** How many drops are on the ground or over it. */
  get drops(): number {
    return this.#raining.peek() ? this.#count : 0;
  }

  /** Rains on other water from now on; null: no longer. */
  follow(field: WaterField | null, place: Place | null): void {
    const cloud = field === null ? null : this.#cloud(field, place);
    this.#raining.value = field !== null;
    if (field === null) {
      this.#rain = null;
      this.#field = null;
      return;
    }
    if (this.#rain === null) {
      this.#calmS = 0;
      this.#rain = new Rain(field.water, DROPS, cloud, Math.random);
    } else if (field !== this.#field) this.#rain.runOver(field.water);
    this.#rain.move(cloud);
    this.#field = field;
  }

  /** Lets the drops run on; what is to be drawn, null while it does not rain. */
  step(seconds: number): DropsVisual | null {
    const [rain, field] = [this.#rain, this.#field];
    if (rain === null || field === null) return null;
    if (this.#calm()) {
      if (this.#calmS >= CALM_S) return this.#visual();
      for (; this.#calmS < CALM_S; this.#calmS += CALM_STEP_S) rain.step(CALM_STEP_S);
    } else rain.step(Math.min(seconds, LONGEST_STEP_S));
    this.#write(rain, field);
    return this.#visual();
  }

  #visual(): DropsVisual {
    return { data: this.#data, count: this.#count, stamp: this.#stamp };
  }

  #cloud({ cellM }: WaterField, place: Place | null): Cloud | null {
    const radius = this.radiusM.value / cellM;
    if (this.everywhere.value || place === null) return null;
    return { x: place[0] / cellM, y: place[1] / cellM, radius };
  }

  #write(rain: Rain, field: WaterField): void {
    const { cellM, side, stepM, water } = field;
    const ground = this.#shown();
    if (this.#heights.length !== water.z.length) this.#heights = new Float32Array(water.z.length).fill(Number.NaN);
    if (ground !== this.#ground) this.#fresh = new Uint8Array(water.z.length);
    this.#ground = ground;
    let budget = this.#calm() ? Number.POSITIVE_INFINITY : LOOKED_UP;
    const heights = this.#heights;
    const heightOf = (i: number): number => {
      if (this.#fresh[i] === 0 && budget > 0) {
        budget -= 1;
        this.#fresh[i] = 1;
        heights[i] = ground.heightAt((i % side) * cellM, Math.floor(i / side) * cellM, cellM / 4);
      }
      const stands = water.filled[i]! > water.z[i]! ? water.filled[i]! * stepM : Number.NEGATIVE_INFINITY;
      const own = Number.isNaN(heights[i]) ? water.z[i]! * stepM : heights[i]!;
      return Math.max(own, stands);
    };
    let at = 0;
    rain.each(heightOf, (x, y, z, shown, falling) => {
      this.#data[at] = x * cellM;
      this.#data[at + 1] = y * cellM;
      this.#data[at + 2] = z + falling * HIGH * this.#sizeM;
      this.#data[at + 3] = shown + (falling > 0 ? 2 : 0);
      at += FLOATS;
    });
    this.#count = at / FLOATS;
    this.#stamp += 1;
  }
}
