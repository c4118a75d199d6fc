/**
 * The section of the ground along a line. Heights are asked for at most `stepM` apart and at every point of the line; between
 * samples the ground counts as straight, so on a surface of bilinear cells of that size heights are exact at the samples, and
 * gain, loss and the extremes are off by what a cell bends.
 */

import { msg } from "@lit/localize";
import { type Impossible, lengthM, type Place } from "./places.ts";

/** A place on a profile: metres along the line, and what is there. */
export interface Spot {
  readonly at: number;
  readonly m: number;
}

export interface Profile {
  /** Metres along the line on the map, rising; heights and places of the same samples. */
  readonly distance: Float64Array;
  readonly height: Float64Array;
  readonly x: Float64Array;
  readonly y: Float64Array;
  readonly lengthM: number;
  /** Along the ground. */
  readonly surfaceM: number;
  readonly min: Spot;
  readonly max: Spot;
  /** Metres that one climbs and descends, both positive. */
  readonly gainM: number;
  readonly lossM: number;
  /** Rise over run: of the steepest part (its sign says up or down), and from the first point straight to the last. */
  readonly steepest: Spot;
  readonly overall: number;
  /** Distances at which the points of the line lie. */
  readonly corners: readonly number[];
}

const MOST_SAMPLES = 2000;

export const ONE_POINT = msg("A line needs two points. Click on the land once more, or draw a line.");
export const NO_LENGTH = msg("All points of this line lie at one place. Move one of them.");
export const NO_PLACE = msg("A point of this line has no place.");
export const NO_HEIGHT = msg("The ground under this line has not come yet.");

/** The profile along a line, or why there is none. */
export function profileOf(
  points: readonly Place[],
  heightAt: (x: number, y: number) => number,
  stepM: number,
): Profile | Impossible {
  if (points.some((p) => !p.every(Number.isFinite))) return { problem: NO_PLACE };
  if (points.length < 2) return { problem: ONE_POINT };
  const length = lengthM(points);
  if (!(length > 0)) return { problem: NO_LENGTH };
  const { distance, x, y, corners } = placesAlong(points, Math.max(stepM, length / MOST_SAMPLES));
  const height = Float64Array.from(x, (px, i) => heightAt(px, y[i]!));
  if (!height.every(Number.isFinite)) return { problem: NO_HEIGHT };
  return { distance, height, x, y, lengthM: length, corners, ...figures(distance, height) };
}

function placesAlong(points: readonly Place[], stepM: number): Pick<Profile, "distance" | "x" | "y" | "corners"> {
  const [distance, x, y, corners]: number[][] = [[0], [points[0]![0]], [points[0]![1]], [0]];
  let from = 0;
  for (let i = 1; i < points.length; i++) {
    const [[ax, ay], [bx, by]] = [points[i - 1]!, points[i]!];
    const leg = Math.hypot(bx - ax, by - ay);
    if (leg === 0) continue;
    const parts = Math.max(1, Math.ceil(leg / stepM));
    for (let k = 1; k <= parts; k++) {
      const t = k / parts;
      distance!.push(from + t * leg);
      x!.push(ax + t * (bx - ax));
      y!.push(ay + t * (by - ay));
    }
    from += leg;
    corners!.push(from);
  }
  return {
    distance: Float64Array.from(distance!),
    x: Float64Array.from(x!),
    y: Float64Array.from(y!),
    corners: corners!,
  };
}

type Figures = Omit<Profile, "distance" | "height" | "x" | "y" | "lengthM" | "corners">;

function figures(distance: Float64Array, height: Float64Array): Figures {
  let [low, high, gainM, lossM, surfaceM] = [0, 0, 0, 0, 0];
  let steepest: Spot = { at: 0, m: 0 };
  for (let i = 1; i < height.length; i++) {
    if (height[i]! < height[low]!) low = i;
    if (height[i]! > height[high]!) high = i;
    const run = distance[i]! - distance[i - 1]!;
    const rise = height[i]! - height[i - 1]!;
    if (rise > 0) gainM += rise;
    else lossM -= rise;
    surfaceM += Math.hypot(run, rise);
    const slope = rise / run;
    if (Math.abs(slope) > Math.abs(steepest.m)) steepest = { at: distance[i]! - run / 2, m: slope };
  }
  const last = height.length - 1;
  return {
    min: { at: distance[low]!, m: height[low]! },
    max: { at: distance[high]!, m: height[high]! },
    gainM,
    lossM,
    surfaceM,
    steepest,
    overall: (height[last]! - height[0]!) / distance[last]!,
  };
}

/** Height and place at a distance of a profile, between its samples on the straight line. */
export function profileAt(
  profile: Profile,
  at: number,
): { readonly m: number; readonly x: number; readonly y: number } {
  const { distance, height, x, y } = profile;
  let [low, high] = [0, distance.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (distance[middle]! <= at) low = middle;
    else high = middle;
  }
  const t = Math.min(1, Math.max(0, (at - distance[low]!) / (distance[high]! - distance[low]!)));
  const mix = (v: Float64Array): number => v[low]! + t * (v[high]! - v[low]!);
  return { m: mix(height), x: mix(x), y: mix(y) };
}
