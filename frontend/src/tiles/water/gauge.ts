/**
 * A gauge: how much water passes a sample while rain falls on all above it, by the time-area method. Rain that falls at a sample
 * passes after the time of its way, so at t passes what fell on the ground whose water needs between t less the rain's duration and t.
 */

import type { Water } from "./water.ts";

/** How fast water runs, metres a second: a hillside's at one hectare, more where more has gathered (decision 63). */
const SPEED_AT_HECTARE = 0.3;
const SPEED_POWER = 0.25;
const SLOWEST = 0.1;
const FASTEST = 2;
const HECTARE_M2 = 1e4;
const POINTS = 96;

export interface Gauge {
  /** Evenly spaced, from 0 to when the last of the rain has passed: seconds, and cubic metres a second. */
  readonly seconds: Float64Array;
  readonly flow: Float64Array;
  readonly peak: { readonly seconds: number; readonly flow: number };
  /** Flow once rain has fallen long enough: rain times area. */
  readonly endless: number;
  readonly areaM2: number;
}

export interface Rainfall {
  readonly mmPerHour: number;
  readonly hours: number;
}

/** The gauge at a sample. `inside`: its watershed. */
export function gaugeAt(water: Water, inside: Uint8Array, cellM: number, { mmPerHour, hours }: Rainfall): Gauge {
  const times = travelTimes(water, inside, cellM);
  const metresPerSecond = mmPerHour / 3.6e6;
  const cellM2 = cellM * cellM;
  const lasts = 3600 * hours;
  const end = Math.max(lasts + (times.at(-1) ?? 0), 1);
  const seconds = Float64Array.from({ length: POINTS + 1 }, (_, k) => (k * end) / POINTS);
  const flow = seconds.map((t) => metresPerSecond * cellM2 * (arrived(times, t) - arrived(times, t - lasts)));
  let top = 0;
  flow.forEach((q, k) => {
    if (q > flow[top]!) top = k;
  });
  const areaM2 = times.length * cellM2;
  return {
    seconds,
    flow,
    peak: { seconds: seconds[top]!, flow: flow[top]! },
    endless: metresPerSecond * areaM2,
    areaM2,
  };
}

/** How long water is on its way from each sample of a watershed, rising. */
function travelTimes({ receiver, area, order, cols }: Water, inside: Uint8Array, cellM: number): Float64Array {
  const time = new Float64Array(receiver.length);
  const found = [];
  for (let t = order.length - 1; t >= 0; t -= 1) {
    const i = order[t]!;
    if (inside[i] !== 1) continue;
    const j = receiver[i]!;
    if (j >= 0 && inside[j] === 1) {
      const step = Math.abs(i - j);
      const length = step === 1 || step === cols ? cellM : Math.SQRT2 * cellM;
      time[i] = time[j]! + length / speed(area[i]! * cellM * cellM);
    }
    found.push(time[i]!);
  }
  return Float64Array.from(found).sort();
}

function speed(areaM2: number): number {
  return Math.min(FASTEST, Math.max(SLOWEST, SPEED_AT_HECTARE * (areaM2 / HECTARE_M2) ** SPEED_POWER));
}

/** How many of the rising times are at most t, those between two counted in part. */
function arrived(times: Float64Array, t: number): number {
  if (t < 0) return 0;
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle]! <= t) low = middle + 1;
    else high = middle;
  }
  return low;
}
