/**
 * How far a ground is from a target, as one number a place: 0 far too low, 0.5 as asked, 1 far too high. Pure.
 *
 * What lies within the tolerance is as asked. `overlay/difference.wgsl` has the same colours.
 */

import { TOLERANCES_OFF } from "../generated/contract.ts";
import type { ChannelGrid } from "./types.ts";

/** Samples a side: a cell is a 128th of the domain. */
export const DIFFERENCE_SIDE = 129;

/** A square of heights in metres, row 0 south. */
export interface Heights {
  readonly side: number;
  readonly data: Float32Array;
}

type Rgb = readonly [number, number, number];

/** As the colours look on lit ground. */
export const TOO_LOW: Rgb = [0x2f, 0x6f, 0xc9];
export const TOO_HIGH: Rgb = [0xd2, 0x3f, 0x36];

/** Height of a target at a place, metres; beyond its border the height there. */
export function targetAt({ side, data }: Heights, sizeM: number, x: number, y: number): number {
  const at = (v: number): number => Math.min(Math.max((v / sizeM) * (side - 1), 0), side - 1);
  const [px, py] = [at(x), at(y)];
  const [col, row] = [Math.min(Math.floor(px), side - 2), Math.min(Math.floor(py), side - 2)];
  const [u, v, i] = [px - col, py - row, row * side + col];
  const south = data[i]! * (1 - u) + data[i + 1]! * u;
  const north = data[i + side]! * (1 - u) + data[i + side + 1]! * u;
  return south * (1 - v) + north * v;
}

/** The number for metres above (or, negative, below) what is asked. */
export function differenceShare(offM: number, toleranceM: number): number {
  if (Math.abs(offM) <= toleranceM) return 0.5;
  return 0.5 + 0.5 * Math.min(1, Math.max(-1, offM / (TOLERANCES_OFF * toleranceM)));
}

/** The numbers over the whole domain. */
export function differenceGrid(
  heightAt: (x: number, y: number) => number,
  target: Heights,
  sizeM: number,
  toleranceM: number,
): ChannelGrid {
  const values = new Float32Array(DIFFERENCE_SIDE * DIFFERENCE_SIDE);
  const step = sizeM / (DIFFERENCE_SIDE - 1);
  for (let row = 0, i = 0; row < DIFFERENCE_SIDE; row += 1)
    for (let col = 0; col < DIFFERENCE_SIDE; col += 1, i += 1) {
      const [x, y] = [col * step, row * step];
      values[i] = differenceShare(heightAt(x, y) - targetAt(target, sizeM, x, y), toleranceM);
    }
  return { side: DIFFERENCE_SIDE, values };
}

/** Colour and strength of a number, on a map. */
export function differenceColour(share: number): readonly [number, number, number, number] {
  const far = Math.abs(2 * share - 1);
  const t = Math.min(1, Math.max(0, (far - 0.02) / 0.73));
  const [r, g, b] = share > 0.5 ? TOO_HIGH : TOO_LOW;
  return [r, g, b, 0.88 * t * t * (3 - 2 * t)];
}
