/**
 * How water runs over ground of whole heights (twin of `backend/esker/flow/water.py`; both read tests/vectors/flow.json,
 * docs/water.md is the mathematics).
 */

import { QUANTA_PER_CELL } from "../../generated/contract.ts";
import { gather, label, spillOf, turnRound } from "./basins.ts";
import { acrossFlats, steepest, type WholeGrid } from "./receivers.ts";

/** A sea below all ground. */
export const NO_SEA = -(2 ** 40);
const MOST_QUANTA = 2 ** 31 - 1;
const INSIDE = 1;
const OUTSIDE = 2;

/** Running water on a grid. */
export interface Water extends WholeGrid {
  /** The index of the sample that each runs to; OUT at the border and in the sea. */
  readonly receiver: Int32Array;
  /** How high water or ground stands. */
  readonly filled: Int32Array;
  /** Samples that run through each. */
  readonly area: Int32Array;
  /** 0 where water runs out without a lake, else the number of a basin. */
  readonly basin: Int32Array;
  /** The lowest sample of each basin, by its number; and at which height it runs over. */
  readonly pits: Int32Array;
  readonly spill: Float64Array;
  /** Every sample after all that run through it. */
  readonly order: Int32Array;
}

/** Heights in whole steps of `cellM` / 256, halves to even; null where some are not finite or too large. */
export function quanta(heights: ArrayLike<number>, cellM: number): Int32Array | null {
  const out = new Int32Array(heights.length);
  const scale = QUANTA_PER_CELL / cellM;
  for (let i = 0; i < out.length; i += 1) {
    const step = heights[i]! * scale;
    if (!(Math.abs(step) <= MOST_QUANTA)) return null;
    const whole = Math.round(step);
    out[i] = whole - step === 0.5 && whole % 2 !== 0 ? whole - 1 : whole;
  }
  return out;
}

/** The highest whole step that the sea covers; NO_SEA without a sea. */
export function seaQuanta(seaM: number | null, cellM: number): number {
  if (seaM === null) return NO_SEA;
  return Math.max(NO_SEA, Math.min(Math.floor(seaM * (QUANTA_PER_CELL / cellM)), MOST_QUANTA));
}

/** Where the water of each sample runs to, where it stands, and how much of it passes. The border is open. */
export function findWater(grid: WholeGrid, sea: number): Water {
  const { z } = grid;
  const receiver = steepest(grid, sea);
  acrossFlats(grid, receiver);
  const { basin, pits } = label(receiver, gather(receiver).order);
  const spill = spillOf(grid, basin, pits.length - 1);
  turnRound(receiver, spill);
  const { area, order } = gather(receiver);
  const filled = Int32Array.from(z, (height, i) => Math.max(height, spill.height[basin[i]!]!));
  return { ...grid, receiver, filled, area, basin, pits, spill: spill.height, order };
}

/** 1 on the samples that run through one, itself among them; else 0. */
export function watershed({ receiver }: Water, index: number): Uint8Array {
  const inside = new Uint8Array(receiver.length);
  inside[index] = INSIDE;
  for (let i = 0; i < receiver.length; i += 1) {
    let at = i;
    let found = inside[at]!;
    while (found === 0) {
      at = receiver[at]!;
      found = at < 0 ? OUTSIDE : inside[at]!;
    }
    for (at = i; at >= 0 && inside[at] === 0; at = receiver[at]!) inside[at] = found;
  }
  for (let i = 0; i < inside.length; i += 1) if (inside[i] !== INSIDE) inside[i] = 0;
  return inside;
}

/** The samples that a drop passes that falls on one, down to the border or the sea. */
export function raindrop({ receiver }: Water, index: number): number[] {
  const way = [];
  for (let at = index; at >= 0; at = receiver[at]!) way.push(at);
  return way;
}

/** The last sample of the lake that a sample runs into, over which it runs out; -1 where water finds no lake from there. */
export function brim({ receiver, filled, basin, spill }: Water, index: number): number {
  if (basin[index] === 0) return -1;
  const level = spill[basin[index]!]!;
  let last = -1;
  for (let at = index; at >= 0 && filled[at]! >= level; at = receiver[at]!) last = at;
  return last;
}
