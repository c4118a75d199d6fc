/**
 * Drops of rain that run down the receivers, gather where much runs and come to rest in lakes and the sea. They are a picture of
 * the flow and change nothing; positions are smooth curves through the middles between samples.
 */

import type { Water } from "./water.ts";

/** A drop that is to be seen: its place in cells, its height, how far it is shown and how far above the ground it still is (0..1). */
export type See = (x: number, y: number, z: number, shown: number, falling: number) => void;

/** Where rain falls: the whole grid, or a disc, in cells. */
export interface Cloud {
  readonly x: number;
  readonly y: number;
  readonly radius: number;
}

/** Floats a drop: the sample it left, way to the next 0..1, seconds it has lived, seconds it has left once it rests. */
const FIELDS = 4;
const FALL_S = 0.45;
const REST_S = 5;
const FADE_S = 0.8;
/** A drop that has run so long is taken up again. */
const MOST_S = 60;
/** Cells a second on level ground, more by the root of the slope, more where much water runs. */
const SLOW = 1.1;
const BY_SLOPE = 5;
const BY_AREA = 0.55;
/** On a lake it drifts. */
const DRIFT = 0.35;

export class Rain {
  readonly count: number;
  #water: Water;
  readonly #random: () => number;
  readonly #drops: Float64Array;
  #cloud: Cloud | null;

  constructor(water: Water, count: number, cloud: Cloud | null, random: () => number) {
    this.#water = water;
    this.count = count;
    this.#cloud = cloud;
    this.#random = random;
    this.#drops = new Float64Array(FIELDS * count);
    // They do not all fall at once.
    for (let k = 0; k < count; k += 1) this.#fall(k, -8 * random());
  }

  /** Rain falls elsewhere from now on. */
  move(cloud: Cloud | null): void {
    this.#cloud = cloud;
  }

  /** Drops go on where they are over other ground of the same size. */
  runOver(water: Water): void {
    if (water.z.length === this.#water.z.length) this.#water = water;
  }

  step(seconds: number): void {
    const drops = this.#drops;
    for (let k = 0; k < this.count; k += 1) {
      const at = FIELDS * k;
      drops[at + 2]! += seconds;
      const age = drops[at + 2]!;
      if (age < FALL_S) continue;
      if (drops[at + 3]! > 0) {
        drops[at + 3]! -= seconds;
        if (drops[at + 3]! <= 0) this.#fall(k, 0);
      } else if (age > MOST_S) drops[at + 3] = FADE_S;
      if (drops[at + 3]! === 0 || drops[at + 3]! > FADE_S) this.#run(at, seconds);
    }
  }

  /** Calls `see` with each drop that is to be seen. `heightOf`: of a sample, in the unit in which it is to be told. */
  each(heightOf: (sample: number) => number, see: See): void {
    const { receiver, cols } = this.#water;
    const drops = this.#drops;
    for (let k = 0; k < this.count; k += 1) {
      const at = FIELDS * k;
      const age = drops[at + 2]!;
      if (age < 0) continue;
      const [from, share, rests] = [drops[at]!, drops[at + 1]!, drops[at + 3]!];
      const to = receiver[from]! < 0 ? from : receiver[from]!;
      const after = receiver[to]! < 0 ? to : receiver[to]!;
      // From the middle of one way past the sample to the middle of the next.
      const [a, c] = [(1 - share) ** 2 / 2, share ** 2 / 2];
      const b = a + 2 * share * (1 - share) + c;
      const shown = Math.min(1, age / FALL_S + 0.2) * (rests > 0 ? Math.min(1, rests / FADE_S) : 1);
      see(
        a * (from % cols) + b * (to % cols) + c * (after % cols),
        a * Math.floor(from / cols) + b * Math.floor(to / cols) + c * Math.floor(after / cols),
        a * heightOf(from) + b * heightOf(to) + c * heightOf(after),
        shown,
        Math.max(0, 1 - age / FALL_S),
      );
    }
  }

  #run(at: number, seconds: number): void {
    const { receiver, z, filled, area } = this.#water;
    const drops = this.#drops;
    let left = seconds;
    for (let hops = 0; hops < 8 && left > 0; hops += 1) {
      const from = drops[at]!;
      const to = receiver[from]!;
      if (to < 0) {
        if (drops[at + 3] === 0) drops[at + 3] = FADE_S;
        return;
      }
      const stands = filled[from]! > z[from]!;
      if (stands && drops[at + 3] === 0) drops[at + 3] = REST_S;
      const slope = Math.max(0, z[from]! - z[to]!) / 256;
      const fast = stands ? DRIFT : (SLOW + BY_SLOPE * Math.sqrt(slope)) * (1 + BY_AREA * Math.log2(area[from]!) * 0.1);
      const need = (1 - drops[at + 1]!) / fast;
      if (need > left) {
        drops[at + 1]! += left * fast;
        return;
      }
      left -= need;
      drops[at] = to;
      drops[at + 1] = 0;
    }
  }

  #fall(k: number, age: number): void {
    const { rows, cols } = this.#water;
    const random = this.#random;
    let [x, y] = [random() * (cols - 1), random() * (rows - 1)];
    if (this.#cloud !== null) {
      const [turn, away] = [2 * Math.PI * random(), this.#cloud.radius * Math.sqrt(random())];
      x = this.#cloud.x + away * Math.cos(turn);
      y = this.#cloud.y + away * Math.sin(turn);
    }
    const clamp = (v: number, most: number): number => Math.min(most, Math.max(0, Math.round(v)));
    this.#drops.set([clamp(y, rows - 1) * cols + clamp(x, cols - 1), random(), age, 0], FIELDS * k);
  }
}
