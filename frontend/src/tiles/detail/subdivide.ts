/**
 * One step of the synthesis: the samples of an area from those of its parent (docs/synthesis.md). Twin of
 * `backend/esker/synthesis/subdivide.py` in float64; `tests/vectors/synthesis.json` holds what both must give.
 */

import type { Rule as RuleName } from "../../generated/contract.ts";
import {
  SYNTH_CONCAVITY_SCALE,
  SYNTH_GULLY_STREAM,
  SYNTH_H_RANGE_TO,
  SYNTH_SMOOTHNESS,
  TILE_CELLS,
} from "../../generated/contract.ts";
import { landscape } from "../rules/landscape.ts";
import { plain } from "../rules/plain.ts";
import { clamp, newSample, type Rule, type Sample, type Site } from "../rules/rule.ts";
import { smooth } from "../rules/smooth.ts";
import { targets } from "../rules/targets.ts";
import type { Biases } from "./biases.ts";
import { full, hashAt, high, low, rowStart, streamStart } from "./noise.ts";

export const RULES: Readonly<Record<RuleName, Rule>> = { landscape, smooth, plain };

/** Samples that a tile carries beyond each of its edges: 2k for k = 1 (paper 1, section 3.1). */
export const BORDER = 2;

/** A rectangle of samples of a level: rows r0..r1, columns c0..c1, half open, global indices, maybe outside the domain. */
export interface Area {
  readonly level: number;
  readonly r0: number;
  readonly r1: number;
  readonly c0: number;
  readonly c1: number;
}

/** The samples of the next coarser level from which the rule makes an area: p - 1 .. p + 2. */
export function parentArea({ level, r0, r1, c0, c1 }: Area): Area {
  return {
    level: level - 1,
    r0: (r0 >> 1) - 1,
    r1: ((r1 - 1) >> 1) + 3,
    c0: (c0 >> 1) - 1,
    c1: ((c1 - 1) >> 1) + 3,
  };
}

/**
 * Guide heights (metres, float32 values) and state of an area, `[row, col]`, row 0 south. `d`: metres; `h`: smoothness
 * exponent 0..2; the rest 0..1, as stored in 16 bits. The last four are empty where only the relief was asked for.
 */
export interface Samples {
  readonly area: Area;
  readonly guide: Float64Array;
  readonly d: Float64Array;
  readonly h: Float64Array;
  readonly snow: Float64Array;
  readonly wet: Float64Array;
  readonly grass: Float64Array;
  readonly forest: Float64Array;
  readonly foam: Float64Array;
  /**
   * The most that this level could add to or take from the detail if no data held it back, metres; the least exponent by
   * which that falls.
   */
  readonly sigma: number;
  readonly exponent: number;
  /** The most that this level's gullies could move the ground if nothing held them, metres. */
  readonly gully: number;
}

/** Sources of a terrain's synthesis besides the parent. */
export interface Recipe {
  readonly site: Site;
  readonly rule: Rule;
  readonly biases: Biases;
  /** Writes guide heights of an area of a level that was solved; false where that level is not held, or was not solved. */
  readonly guide: (area: Area, out: Float64Array) => boolean;
}

const NONE = new Float64Array(0);
const UNORM = 65535;
/** h is stored as a share of this. */
const H_SCALE = 2;

/** A share 0..1 as 16 bits hold it. */
export const unorm16 = (x: number): number => Math.floor(0.5 + UNORM * clamp(x, 0, 1)) / UNORM;

const rowsOf = (w: Area): number => w.r1 - w.r0;
const colsOf = (w: Area): number => w.c1 - w.c0;

function emptySamples(area: Area, relief: boolean): Out {
  const n = rowsOf(area) * colsOf(area);
  const made = (wanted: boolean): Float64Array => (wanted ? new Float64Array(n) : NONE);
  return {
    area,
    guide: made(true),
    d: made(true),
    h: made(true),
    snow: made(true),
    wet: made(!relief),
    grass: made(!relief),
    forest: made(!relief),
    foam: made(!relief),
    sigma: 0,
    exponent: SYNTH_H_RANGE_TO,
    gully: 0,
  };
}

/** Weights of p - 1 .. p + 1 at even and of p - 1 .. p + 2 at odd children. */
interface Taps {
  readonly even: readonly [number, number, number];
  readonly odd: readonly [number, number, number, number];
}

/** Cubic B-spline subdivision (paper 1, section 4: smooth surfaces). */
const B_SPLINE: Taps = { even: [1 / 8, 6 / 8, 1 / 8], odd: [0, 1 / 2, 1 / 2, 0] };
/** First derivative, times the parent's spacing. */
const DERIVATIVE: Taps = { even: [-1 / 2, 0, 1 / 2], odd: [0, -1, 1, 0] };
/** Second derivative, times the square of the parent's spacing. */
const SECOND: Taps = { even: [1, -2, 1], odd: [1 / 2, -1 / 2, -1 / 2, 1 / 2] };
/** Interpolating subdivision (Deslauriers and Dubuc): it keeps the parent's samples. */
const FOUR_POINT: Taps = { even: [0, 1, 0], odd: [-1 / 16, 9 / 16, 9 / 16, -1 / 16] };

/** A parent's area and its child's, as the passes read them. */
interface Step {
  readonly rows: number;
  readonly cols: number;
  /** Column of the child's first sample's p in the parent's array, and whether that sample is odd. Rows likewise. */
  readonly firstCol: number;
  readonly firstRow: number;
  readonly oddCol: number;
  readonly oddRow: number;
  readonly parentRows: number;
  readonly parentCols: number;
}

function stepOf(parent: Area, child: Area): Step {
  return {
    rows: rowsOf(child),
    cols: colsOf(child),
    firstCol: (child.c0 >> 1) - parent.c0,
    firstRow: (child.r0 >> 1) - parent.r0,
    oddCol: child.c0 & 1,
    oddRow: child.r0 & 1,
    parentRows: rowsOf(parent),
    parentCols: colsOf(parent),
  };
}

/** Values of the parent's rows at the child's columns. */
function alongX(z: Float64Array, { even, odd }: Taps, step: Step, out: Float64Array): Float64Array {
  const { cols, parentCols, parentRows, firstCol, oddCol } = step;
  const [e0, e1, e2] = even;
  const [o0, o1, o2, o3] = odd;
  for (let row = 0; row < parentRows; row += 1) {
    const to = row * cols;
    let at = row * parentCols + firstCol;
    for (let col = oddCol; col < cols; col += 2, at += 1)
      out[to + col] = e0 * z[at + oddCol - 1]! + e1 * z[at + oddCol]! + e2 * z[at + oddCol + 1]!;
    at = row * parentCols + firstCol;
    for (let col = 1 - oddCol; col < cols; col += 2, at += 1)
      out[to + col] = o0 * z[at - 1]! + o1 * z[at]! + o2 * z[at + 1]! + o3 * z[at + 2]!;
  }
  return out;
}

/** Values of the child's rows, of an array with the parent's rows and the child's columns. */
function alongY(z: Float64Array, { even, odd }: Taps, step: Step, out: Float64Array): Float64Array {
  const { rows, cols, firstRow, oddRow } = step;
  const [e0, e1, e2] = even;
  const [o0, o1, o2, o3] = odd;
  for (let row = 0; row < rows; row += 1) {
    let at = (firstRow + ((row + oddRow) >> 1)) * cols;
    const to = row * cols;
    if ((row + oddRow) & 1)
      for (let k = to; k < to + cols; k += 1, at += 1)
        out[k] = o0 * z[at - cols]! + o1 * z[at]! + o2 * z[at + cols]! + o3 * z[at + 2 * cols]!;
    else
      for (let k = to; k < to + cols; k += 1, at += 1) out[k] = e0 * z[at - cols]! + e1 * z[at]! + e2 * z[at + cols]!;
  }
  return out;
}

/** Arrays for one step, made anew only when a greater one comes. */
class Scratch {
  #arrays: Float64Array[] = [];
  #length = 0;

  get(k: number, length: number): Float64Array {
    if (length > this.#length) {
      this.#arrays = [];
      this.#length = length;
    }
    this.#arrays[k] ??= new Float64Array(this.#length);
    return this.#arrays[k];
  }
}

const scratch = new Scratch();
const sample: Sample = newSample();

/** Values of a parent at its child's samples by the same stencil along both axes, in `out`. */
function upsampled(z: Float64Array, taps: Taps, step: Step, out: Float64Array): Float64Array {
  return alongY(alongX(z, taps, step, scratch.get(0, step.parentRows * step.cols)), taps, step, out);
}

/**
 * Heights that were not solved, rounded to float32 along each axis: 4-point, or cubic B-spline for the base of rule
 * `smooth`.
 */
export function interpolated(z: Float64Array, parent: Area, child: Area, spline = false): Float64Array {
  const step = stepOf(parent, child);
  const taps = spline ? B_SPLINE : FOUR_POINT;
  const columns = rounded(alongX(z, taps, step, scratch.get(0, step.parentRows * step.cols)));
  return rounded(alongY(columns, taps, step, new Float64Array(step.rows * step.cols)));
}

function rounded(z: Float64Array): Float64Array {
  for (let k = 0; k < z.length; k += 1) z[k] = Math.fround(z[k]!);
  return z;
}

/** The parent's ground at the child's samples. The arrays are scratch: the next step writes over them. */
interface GroundArrays {
  readonly height: Float64Array;
  readonly slopeX: Float64Array;
  readonly slopeY: Float64Array;
  readonly second: Float64Array;
  readonly guideX: Float64Array;
  readonly guideY: Float64Array;
}

function groundOf(parent: Samples, step: Step): GroundArrays {
  const n = step.parentRows * step.parentCols;
  const half = step.parentRows * step.cols;
  const m = step.rows * step.cols;
  const z = scratch.get(1, n);
  for (let k = 0; k < n; k += 1) z[k] = parent.guide[k]! + parent.d[k]!;
  const smoothX = alongX(z, B_SPLINE, step, scratch.get(2, half));
  const height = alongY(smoothX, B_SPLINE, step, scratch.get(3, m));
  const slopeY = alongY(smoothX, DERIVATIVE, step, scratch.get(4, m));
  const secondY = alongY(smoothX, SECOND, step, scratch.get(5, m));
  const slopeX = alongY(alongX(z, DERIVATIVE, step, scratch.get(2, half)), B_SPLINE, step, scratch.get(6, m));
  const second = alongY(alongX(z, SECOND, step, scratch.get(2, half)), B_SPLINE, step, scratch.get(7, m));
  for (let k = 0; k < m; k += 1) second[k]! += secondY[k]!;
  const guideX = alongY(alongX(parent.guide, DERIVATIVE, step, scratch.get(2, half)), B_SPLINE, step, secondY);
  const guideB = alongX(parent.guide, B_SPLINE, step, scratch.get(2, half));
  const guideY = alongY(guideB, DERIVATIVE, step, scratch.get(8, m));
  return { height, slopeX, slopeY, second, guideX, guideY };
}

/**
 * The samples of an area of the next level. `parent` must hold `parentArea(area)` as far as stencils reach;
 * `relief` leaves the channels out that no height depends on.
 */
export function subdivide(parent: Samples, area: Area, recipe: Recipe, relief: boolean): Samples {
  const step = stepOf(parent.area, area);
  const out = emptySamples(area, relief);
  if (!recipe.guide(area, out.guide)) out.guide = interpolated(parent.guide, parent.area, area);
  for (const name of ["d", "h", "snow", "wet", "grass", "forest", "foam"] as const)
    if (parent[name].length > 0 && out[name].length > 0) upsampled(parent[name], B_SPLINE, step, out[name]);
  const ground = groundOf(parent, step);
  const spacing = recipe.site.sizeM / (TILE_CELLS * 2 ** parent.area.level);
  applyRule(recipe, area, relief, out, (k) => {
    sample.height = ground.height[k]!;
    sample.slopeX = ground.slopeX[k]! / spacing;
    sample.slopeY = ground.slopeY[k]! / spacing;
    sample.concavity = clamp((SYNTH_CONCAVITY_SCALE * ground.second[k]!) / spacing, -1, 1);
    sample.guideSlope = Math.sqrt((ground.guideX[k]! / spacing) ** 2 + (ground.guideY[k]! / spacing) ** 2);
  });
  return out;
}

/**
 * Level 0: the rule on the guide itself, whose missing parent is replaced by constants and targets. Derivatives end at
 * the domain's border, where indices are clamped. Null while level 0 is not held.
 */
export function root(area: Area, recipe: Recipe, relief: boolean): Samples | null {
  const inside = (i: number): number => clamp(i, -BORDER, TILE_CELLS + BORDER);
  const near: Area = {
    level: 0,
    r0: inside(area.r0 - 1),
    r1: inside(area.r1) + 1,
    c0: inside(area.c0 - 1),
    c1: inside(area.c1) + 1,
  };
  const width = colsOf(near);
  const z = new Float64Array(rowsOf(near) * width);
  if (!recipe.guide(near, z)) return null;
  const at = (j: number, i: number): number => z[(inside(j) - near.r0) * width + inside(i) - near.c0]!;
  const spacing = recipe.site.sizeM / TILE_CELLS;
  const out = emptySamples(area, relief);
  const cols = colsOf(area);
  applyRule(recipe, area, relief, out, (k) => {
    const j = area.r0 + Math.floor(k / cols);
    const i = area.c0 + (k % cols);
    const here = at(j, i);
    out.guide[k] = here;
    sample.height = here;
    sample.slopeX = (at(j, i + 1) - at(j, i - 1)) / (2 * spacing);
    sample.slopeY = (at(j + 1, i) - at(j - 1, i)) / (2 * spacing);
    const across = (at(j, i - 1) - 2 * here + at(j, i + 1)) / spacing;
    const upward = (at(j - 1, i) - 2 * here + at(j + 1, i)) / spacing;
    sample.concavity = clamp(SYNTH_CONCAVITY_SCALE * (across + upward), -1, 1);
    sample.guideSlope = Math.sqrt(sample.slopeX ** 2 + sample.slopeY ** 2);
    const wanted = targets(recipe.site, sample, relief);
    sample.d = 0;
    sample.h = SYNTH_SMOOTHNESS;
    Object.assign(sample, {
      snow: wanted.snow,
      wet: wanted.wet,
      grass: wanted.grass,
      forest: wanted.forest,
      foam: wanted.foam,
    });
  });
  return out;
}

type Out = { -readonly [K in keyof Samples]: Samples[K] };

/**
 * Runs the rule on each sample of an area: `out` holds the parent's state there and then the new one as stored, `place`
 * fills in the ground (and at the root the state).
 */
function applyRule(recipe: Recipe, area: Area, relief: boolean, out: Out, place: (k: number) => void): void {
  const { site, rule, biases } = recipe;
  const streams = [0, 1, 2, 3].map((stream) => streamStart(site.seed, area.level, stream));
  const cols = colsOf(area);
  sample.level = area.level;
  sample.gullyKey = streamStart(site.seed, area.level, SYNTH_GULLY_STREAM);
  for (let j = area.r0, k = 0; j < area.r1; j += 1) {
    const starts = streams.map((stream) => rowStart(stream, j));
    for (let i = area.c0; i < area.c0 + cols; i += 1, k += 1) {
      load(out, k, relief);
      place(k);
      biases.at(area.level, j, i, relief, sample);
      noiseAt(starts, i, relief);
      sample.row = j;
      sample.col = i;
      rule(site, sample, relief);
      store(out, k, relief);
      out.sigma = Math.max(out.sigma, sample.sigma);
      out.exponent = Math.min(out.exponent, sample.exponent);
      out.gully = Math.max(out.gully, sample.gully);
    }
  }
}

function noiseAt(starts: readonly number[], i: number, relief: boolean): void {
  sample.noiseD = full(hashAt(starts[0]!, i));
  const b = hashAt(starts[1]!, i);
  sample.noiseH = low(b);
  sample.noiseSnow = high(b);
  if (relief) return;
  const c = hashAt(starts[2]!, i);
  sample.noiseWet = low(c);
  sample.noiseGrass = high(c);
  const d = hashAt(starts[3]!, i);
  sample.noiseForest = low(d);
  sample.noiseFoam = high(d);
}

function load(from: Out, k: number, relief: boolean): void {
  sample.d = from.d[k]!;
  sample.h = from.h[k]!;
  sample.snow = from.snow[k]!;
  if (relief) return;
  sample.wet = from.wet[k]!;
  sample.grass = from.grass[k]!;
  sample.forest = from.forest[k]!;
  sample.foam = from.foam[k]!;
}

function store(to: Out, k: number, relief: boolean): void {
  to.d[k] = Math.fround(sample.d);
  to.h[k] = H_SCALE * unorm16(sample.h / H_SCALE);
  to.snow[k] = unorm16(sample.snow);
  if (relief) return;
  to.wet[k] = unorm16(sample.wet);
  to.grass[k] = unorm16(sample.grass);
  to.forest[k] = unorm16(sample.forest);
  to.foam[k] = unorm16(sample.foam);
}

/** The samples of an area of any level, through windows of all levels above it, at what the area costs. */
export function detailOf(area: Area, recipe: Recipe, relief: boolean): Samples | null {
  const chain = [area];
  while (chain[0]!.level > 0) chain.unshift(parentArea(chain[0]!));
  let samples = root(chain[0]!, recipe, relief);
  for (const next of chain.slice(1)) if (samples !== null) samples = subdivide(samples, next, recipe, relief);
  return samples;
}
