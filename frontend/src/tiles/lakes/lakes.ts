/**
 * Lakes in the basins of the ground: how high water stands that cannot run off (twin of backend/esker/synthesis/lakes.py).
 *
 * Basins are found by priority flood (Barnes, Lehman & Mulla, "Priority-flood: An optimal depression-filling and
 * watershed-labeling algorithm for digital elevation models", Computers & Geosciences 62, 2014) on the samples of one
 * level. Samples are joined as the drawn triangles join them: to the four beside them and along the diagonals from
 * south-east to north-west. On such ground the flood is exact: water leaves a basin over a vertex.
 */

import type { TileView } from "../../core/types.ts";
import {
  LAKE_FREEBOARD_CELLS,
  LAKE_FREEBOARD_SHARE,
  LAKE_LEAST_SAMPLES,
  LAKE_LEVEL,
  LAKE_SHORE_SAMPLES,
  NO_LAKE,
  PATCH_CELLS,
  SUBPATCHES,
  TILE_CELLS,
  TILE_SAMPLES,
} from "../../generated/contract.ts";
import { Heap } from "../patches/heap.ts";

/** Samples a side of the ground that is flooded. */
export const LAKE_SIDE = (TILE_CELLS << LAKE_LEVEL) + 1;

/** Lakes on ground of `side` x `side` samples, row 0 south. */
export interface Lakes {
  readonly side: number;
  /** The ground that was flooded, metres. */
  readonly heights: Float32Array;
  /** Level of the lake that covers a sample (where the ground lies below it) or whose shore it is; NO_LAKE elsewhere. */
  readonly levels: Float32Array;
  /** How many samples lie under each lake, by level. */
  readonly samples: ReadonlyMap<number, number>;
}

/** Rules by which basins become lakes. */
export interface LakeRule {
  /** Metres between samples. */
  readonly cellM: number;
  /** A basin is at least so deep, metres. */
  readonly leastM: number;
  /** Ground below this height is the sea's. */
  readonly seaM: number | null;
}

/** The lakes of `heights`, metres. What reaches the border runs off. */
export function findLakes(heights: Float32Array, side: number, { cellM, leastM, seaM }: LakeRule): Lakes {
  const sea = seaM === null ? Number.NEGATIVE_INFINITY : Math.fround(seaM);
  const ground = heights.slice();
  if (seaM !== null) for (let i = 0; i < ground.length; i += 1) ground[i] = Math.max(ground[i]!, sea);
  const filled = flooded(ground, side);
  const left = new Uint8Array(heights.length);
  for (let i = 0; i < left.length; i += 1) left[i] = filled[i]! > ground[i]! ? 1 : 0;
  let levels = new Float32Array(heights.length).fill(NO_LAKE);
  const samples = new Map<number, number>();
  for (let start = 0; start < left.length; start += 1) {
    if (left[start] === 0) continue;
    const basin = takeBasin(left, side, start);
    const top = filled[start]!;
    let bottom = top;
    for (const i of basin) bottom = Math.min(bottom, ground[i]!);
    const depth = top - bottom;
    if (basin.length < LAKE_LEAST_SAMPLES || depth < leastM) continue;
    const level = Math.fround(top - Math.min(LAKE_FREEBOARD_CELLS * cellM, LAKE_FREEBOARD_SHARE * depth));
    let count = 0;
    for (const i of basin) {
      if (ground[i]! >= level) continue;
      levels[i] = level;
      count += 1;
    }
    if (count > 0) samples.set(level, (samples.get(level) ?? 0) + count);
  }
  if (samples.size > 0) levels = widenedShores(levels, heights, side);
  return { side, heights, levels, samples };
}

/** Steps to the samples that drawn edges join to one, in a grid of rows of `side`. */
function meshSteps(side: number): readonly number[] {
  return [1, -1, side, -side, side - 1, 1 - side];
}

/** How high water stands on ground whose border is open: at least the ground, metres. */
export function flooded(ground: Float32Array, side: number): Float32Array {
  const out = new Float32Array(ground.length).fill(Number.POSITIVE_INFINITY);
  const heap = new Heap(ground.length);
  const last = side - 1;
  // Samples of a basin come in any order: they are all as high as its outlet.
  const pit = new Int32Array(ground.length);
  let [first, end] = [0, 0];
  const reach = (i: number, level: number): void => {
    if (out[i] !== Number.POSITIVE_INFINITY) return;
    const z = ground[i]!;
    if (z <= level) {
      out[i] = level;
      pit[end++] = i;
    } else {
      out[i] = z;
      heap.push(z, i);
    }
  };
  for (let k = 0; k < side; k += 1) {
    for (const i of [k, last * side + k, k * side, k * side + last]) reach(i, Number.NEGATIVE_INFINITY);
  }
  const [a, b, c, d, e, f] = meshSteps(side) as [number, number, number, number, number, number];
  const area = ground.length;
  while (first < end || heap.size > 0) {
    if (first === end) first = end = 0;
    const at = first < end ? pit[first++]! : heap.pop();
    const level = out[at]!;
    // Beyond the border steps lead nowhere or to the other side of the border, whose samples are all done.
    if (at + a < area) reach(at + a, level);
    if (at + b >= 0) reach(at + b, level);
    if (at + c < area) reach(at + c, level);
    if (at + d >= 0) reach(at + d, level);
    if (at + e < area) reach(at + e, level);
    if (at + f >= 0) reach(at + f, level);
  }
  return out;
}

/** The samples connected with `start`, taken out of `left`. None lies on the border. */
function takeBasin(left: Uint8Array, side: number, start: number): number[] {
  left[start] = 0;
  const basin = [start];
  const steps = meshSteps(side);
  for (let k = 0; k < basin.length; k += 1) {
    for (const step of steps) {
      const i = basin[k]! + step;
      if (left[i] === 0) continue;
      left[i] = 0;
      basin.push(i);
    }
  }
  return basin;
}

/** Levels with their shores: the samples around a lake have its level too. */
export function widenedShores(
  levels: Float32Array<ArrayBuffer>,
  heights: Float32Array,
  side: number,
): Float32Array<ArrayBuffer> {
  let out = levels;
  for (let k = 0; k < LAKE_SHORE_SAMPLES; k += 1) out = widened(out, heights, side);
  return out;
}

/** Levels carried one sample further, over ground that is not below them; where lakes meet the lowest. */
function widened(levels: Float32Array, heights: Float32Array, side: number): Float32Array<ArrayBuffer> {
  const out = levels.slice();
  const last = side - 1;
  for (let r = 0; r <= last; r += 1) {
    for (let c = 0; c <= last; c += 1) {
      const level = levels[r * side + c]!;
      if (level === NO_LAKE) continue;
      for (let y = Math.max(r - 1, 0); y <= Math.min(r + 1, last); y += 1) {
        for (let x = Math.max(c - 1, 0); x <= Math.min(c + 1, last); x += 1) {
          const i = y * side + x;
          if (levels[i] !== NO_LAKE || heights[i]! < level) continue;
          if (out[i] === NO_LAKE || level < out[i]!) out[i] = level;
        }
      }
    }
  }
  return out;
}

/** The ground of LAKE_LEVEL as it is held, coarser where it is not; null while nothing is. */
export function lakeGround(view: TileView): Float32Array | null {
  const root = view.tile(0, 0, 0);
  if (root === undefined) return null;
  const out = new Float32Array(LAKE_SIDE * LAKE_SIDE);
  const n = 1 << LAKE_LEVEL;
  for (let y = 0; y < n; y += 1) {
    for (let x = 0; x < n; x += 1) {
      let up = 0;
      while (up < LAKE_LEVEL && view.tile(LAKE_LEVEL - up, x >> up, y >> up) === undefined) up += 1;
      const tile = view.tile(LAKE_LEVEL - up, x >> up, y >> up) ?? root;
      spread(tile.heights, up, (x - (tile.x << up)) * TILE_CELLS, (y - (tile.y << up)) * TILE_CELLS, out, x, y);
    }
  }
  return out;
}

/** Fills the samples of tile (x, y) from a tile `up` levels above, of which it begins at (left, low) of its own cells. */
function spread(
  from: Float32Array,
  up: number,
  left: number,
  low: number,
  out: Float32Array,
  x: number,
  y: number,
): void {
  if (up === 0) {
    for (let r = 0; r < TILE_SAMPLES; r += 1) {
      const row = from.subarray(r * TILE_SAMPLES, (r + 1) * TILE_SAMPLES);
      out.set(row, (y * TILE_CELLS + r) * LAKE_SIDE + x * TILE_CELLS);
    }
    return;
  }
  const scale = 1 / (1 << up);
  for (let r = 0; r < TILE_SAMPLES; r += 1) {
    const v = (low + r) * scale;
    const j = Math.min(Math.floor(v), TILE_CELLS - 1);
    for (let c = 0; c < TILE_SAMPLES; c += 1) {
      const u = (left + c) * scale;
      const i = Math.min(Math.floor(u), TILE_CELLS - 1);
      const k = j * TILE_SAMPLES + i;
      const south = from[k]! + (from[k + 1]! - from[k]!) * (u - i);
      const north = from[k + TILE_SAMPLES]! + (from[k + TILE_SAMPLES + 1]! - from[k + TILE_SAMPLES]!) * (u - i);
      out[(y * TILE_CELLS + r) * LAKE_SIDE + x * TILE_CELLS + c] = south + (north - south) * (v - j);
    }
  }
}

/**
 * Level of the lake that covers a place if the ground there lies below it, else NO_LAKE; `u` from west to east and `v` from
 * south to north, 0..1. A lake ends where the ground outside its basin falls below it (water/lakes.wgsl, inside_lake).
 */
export function lakeOver({ side, heights, levels }: Lakes, u: number, v: number): number {
  const [x, y] = [u * (side - 1), v * (side - 1)];
  const i = Math.min(side - 2, Math.max(0, Math.floor(x)));
  const j = Math.min(side - 2, Math.max(0, Math.floor(y)));
  const at = j * side + i;
  const lake = Math.max(levels[at]!, levels[at + 1]!, levels[at + side]!, levels[at + side + 1]!);
  if (lake === NO_LAKE) return NO_LAKE;
  const inside = (k: number): number => {
    const z = heights[k]!;
    return levels[k] === lake && z < lake ? lake - z : z - lake;
  };
  const under = (k: number): boolean => levels[k] === lake && heights[k]! < lake;
  const shore = (k: number): boolean => levels[k] === lake;
  const around = [at, at + 1, at + side, at + side + 1];
  if (!around.every(shore) && !around.some(under)) return NO_LAKE;
  const [s, t] = [x - i, y - j];
  const south = inside(at) * (1 - s) + inside(at + 1) * s;
  const north = inside(at + side) * (1 - s) + inside(at + side + 1) * s;
  return south * (1 - t) + north * t > 0 ? lake : NO_LAKE;
}

/** How high water may stand on the patches of any level. */
export class Surfaces {
  /** Per level, highest lake of each patch; on finer levels that of the patch they lie in. */
  readonly #tops: Float32Array[] = [];

  /** `lakes`: of LAKE_LEVEL. */
  constructor(
    lakes: Lakes | null,
    readonly seaM: number,
  ) {
    if (lakes === null || lakes.samples.size === 0) return;
    const finest = LAKE_LEVEL + 2;
    const across = SUBPATCHES << finest;
    const cells = (lakes.side - 1) / across;
    const made = new Float32Array(across * across).fill(Number.NEGATIVE_INFINITY);
    for (let i = 0; i < lakes.levels.length; i += 1) {
      const level = lakes.levels[i]!;
      if (level === NO_LAKE) continue;
      const [r, c] = [Math.floor(i / lakes.side), i % lakes.side];
      // A sample on an edge belongs to the patches on both sides.
      for (let y = Math.max(Math.ceil(r / cells) - 1, 0); y <= Math.min(Math.floor(r / cells), across - 1); y += 1) {
        for (let x = Math.max(Math.ceil(c / cells) - 1, 0); x <= Math.min(Math.floor(c / cells), across - 1); x += 1) {
          made[y * across + x] = Math.max(made[y * across + x]!, level);
        }
      }
    }
    this.#tops[finest] = made;
    for (let level = finest - 1; level >= 0; level -= 1) this.#tops[level] = quartered(this.#tops[level + 1]!);
  }

  /** Metres, -Infinity where no water can be. */
  highest(level: number, px: number, py: number): number {
    const held = Math.min(level, this.#tops.length - 1);
    if (held < 0) return this.seaM;
    const up = level - held;
    return Math.max(this.seaM, this.#tops[held]![(py >> up) * (SUBPATCHES << held) + (px >> up)]!);
  }

  /** Says whether there is a lake. */
  get lakes(): boolean {
    return this.#tops.length > 0;
  }
}

function quartered(of: Float32Array): Float32Array {
  const n = Math.sqrt(of.length) / 2;
  const out = new Float32Array(n * n);
  for (let y = 0; y < n; y += 1) {
    for (let x = 0; x < n; x += 1) {
      const i = 4 * n * y + 2 * x;
      out[y * n + x] = Math.max(of[i]!, of[i + 1]!, of[i + 2 * n]!, of[i + 2 * n + 1]!);
    }
  }
  return out;
}

/** Levels of the lakes, rising, that may be seen on a patch, or on a square of `across` x `across` of them. */
export function levelsOn({ side, levels }: Lakes, level: number, px: number, py: number, across = 1): number[] {
  const cell = 1 << Math.max(level - LAKE_LEVEL, 0);
  const span = PATCH_CELLS << Math.max(LAKE_LEVEL - level, 0);
  const found = new Set<number>();
  const [x1, y1] = [Math.ceil(((px + across) * span) / cell), Math.ceil(((py + across) * span) / cell)];
  for (let y = Math.floor((py * span) / cell); y <= y1; y += 1) {
    for (let x = Math.floor((px * span) / cell); x <= x1; x += 1) {
      const at = levels[y * side + x]!;
      if (at !== NO_LAKE) found.add(at);
    }
  }
  return [...found].sort((a, b) => a - b);
}
