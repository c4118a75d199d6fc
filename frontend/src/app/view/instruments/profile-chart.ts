/** A profile as a drawing: where its lines, ticks and words stand, in pixels from the top left. Pure; the panel and the SVG share it. */

import { plain } from "../../../core/language.ts";
import type { Profile } from "../../../core/measure/profile.ts";
import { roundBelow } from "../../words/words.ts";

export interface Tick {
  readonly at: number;
  readonly text: string;
}

export interface Chart {
  readonly width: number;
  readonly height: number;
  /** The plot's box. */
  readonly left: number;
  readonly right: number;
  readonly top: number;
  readonly bottom: number;
  /** Path data: the ground, the area under it, and the ground of another moment. */
  readonly line: string;
  readonly area: string;
  readonly before: string;
  /** What a task asks for, and the areas where the ground is higher and lower than that; empty without a task. */
  readonly asked: string;
  readonly tooHigh: string;
  readonly tooLow: string;
  readonly distances: readonly Tick[];
  readonly heights: readonly Tick[];
  /** Words of the axes. */
  readonly distanceUnit: string;
  /** How many times heights are drawn larger than distances. */
  readonly exaggeration: number;
  /** Pixels of the corners of the line along the distance. */
  readonly corners: readonly number[];
  xOf(distanceM: number): number;
  yOf(heightM: number): number;
  distanceAt(x: number): number;
}

export interface ChartOptions {
  readonly width: number;
  readonly height: number;
  /** Size of letters, pixels. */
  readonly em?: number;
  /** 0: as much as fills the plot. */
  readonly exaggeration?: number;
  readonly before?: ArrayLike<number> | null;
  /** Heights that a task asks for at the samples. */
  readonly asked?: ArrayLike<number> | null;
}

/** Exaggerations of a section that a person may choose; 0 fills the plot. */
export const SECTION_EXAGGERATIONS = [0, 1, 2, 5, 10, 20] as const;
const HEADROOM = 0.08;
/** Relief that a plot shows at least, as a share of its length: flat ground is a flat line. */
const LEAST_RELIEF = 1 / 400;

/** The drawing of a profile. */
export function chartOf(profile: Profile, options: ChartOptions): Chart {
  const { width, height, em = 11, exaggeration = 0, before = null, asked = null } = options;
  const [left, top, bottom] = [4.6 * em, 0.9 * em, height - 2.7 * em];
  const free = Math.max(10, width - 1.6 * em - left);
  const tall = Math.max(10, bottom - top);
  const { low, span } = rangeOf(profile, before, asked);
  const length = profile.lengthM;
  // Pixels a metre, along and up. A factor that does not fit makes the section shorter, never wrong.
  const filled = tall / span;
  const along = exaggeration === 0 ? free / length : Math.min(free / length, filled / exaggeration);
  const up = exaggeration === 0 ? filled : along * exaggeration;
  const right = left + along * length;
  const xOf = (d: number): number => left + along * d;
  const yOf = (z: number): number => bottom - up * (z - low);
  const path = (z: ArrayLike<number>): string =>
    Array.from(z, (v, i) => `${i ? "L" : "M"}${xOf(profile.distance[i]!).toFixed(1)} ${yOf(v).toFixed(1)}`).join("");
  const line = path(profile.height);
  const unit = length >= 4000 ? 1000 : 1;
  return {
    width,
    height,
    left,
    right,
    top,
    bottom,
    line,
    area: `${line}L${right.toFixed(1)} ${bottom.toFixed(1)}L${left.toFixed(1)} ${bottom.toFixed(1)}Z`,
    before: before === null ? "" : path(before),
    asked: asked === null ? "" : path(asked),
    tooHigh: between(profile, asked, 1, xOf, yOf),
    tooLow: between(profile, asked, -1, xOf, yOf),
    distances: ticks(0, length, (right - left) / (6 * em), unit).map((v) => ({
      at: xOf(v),
      text: numberWords(v / unit),
    })),
    heights: ticks(low, low + tall / up, tall / (2.4 * em), 1).map((v) => ({ at: yOf(v), text: numberWords(v) })),
    distanceUnit: unit === 1 ? "m" : "km",
    exaggeration: up / along,
    corners: profile.corners.map(xOf),
    xOf,
    yOf,
    distanceAt: (x) => Math.min(length, Math.max(0, (x - left) / along)),
  };
}

/** The areas where the ground is above (`sign` 1) or below what is asked, as path data. */
function between(
  { distance, height }: Profile,
  asked: ArrayLike<number> | null,
  sign: 1 | -1,
  xOf: (d: number) => number,
  yOf: (z: number) => number,
): string {
  let out = "";
  const at = (d: number, z: number): string => `${xOf(d).toFixed(1)} ${yOf(z).toFixed(1)}`;
  for (let i = 0; asked !== null && i + 1 < distance.length; i += 1) {
    const [a, b] = [sign * (height[i]! - asked[i]!), sign * (height[i + 1]! - asked[i + 1]!)];
    if (a <= 0 && b <= 0) continue;
    // Where the two cross the area has a corner.
    const [from, to] = [a < 0 ? a / (a - b) : 0, b < 0 ? a / (a - b) : 1];
    const [d, g, t] = [distance, height, asked].map((v) => (u: number) => v[i]! + (v[i + 1]! - v[i]!) * u) as [
      (u: number) => number,
      (u: number) => number,
      (u: number) => number,
    ];
    out += `M${at(d(from), g(from))}L${at(d(to), g(to))}L${at(d(to), t(to))}L${at(d(from), t(from))}Z`;
  }
  return out;
}

function rangeOf(
  profile: Profile,
  before: ArrayLike<number> | null,
  asked: ArrayLike<number> | null,
): { readonly low: number; readonly span: number } {
  let [low, high] = [profile.min.m, profile.max.m];
  for (const other of [before, asked])
    for (let i = 0; i < (other?.length ?? 0); i++) {
      low = Math.min(low, other![i]!);
      high = Math.max(high, other![i]!);
    }
  const least = profile.lengthM * LEAST_RELIEF;
  const grow = Math.max(0, (least - (high - low)) / 2);
  const span = (high - low + 2 * grow) * (1 + 2 * HEADROOM);
  return { low: (low + high) / 2 - span / 2, span };
}

/** Round values in a range, at most about `most` of them. */
export function ticks(low: number, high: number, most: number, unit: number): number[] {
  const raw = (high - low) / unit / Math.max(1, most);
  if (!(raw > 0) || !Number.isFinite(raw)) return [];
  const below = roundBelow(raw);
  const step =
    (below >= raw * (1 - 1e-9) ? below : [2, 2.5, 5, 10].map((k) => k * leading(raw)).find((s) => s >= raw)!) * unit;
  const out: number[] = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push(k * step + 0);
  return out;
}

const leading = (x: number): number => 10 ** Math.floor(Math.log10(x));

/** A number with a true minus and no digits that say nothing. */
export function numberWords(v: number): string {
  return plain(Number(v.toFixed(3)) + 0).replace("-", "−");
}
