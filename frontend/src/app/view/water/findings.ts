/** What is to be known of the water at a place: its way, its watershed, how it floods. Pure. */

import type { Place } from "../../../core/measure/places.ts";
import type { FootprintVisual, Ground, Rgba } from "../../../core/types.ts";
import { drape } from "../../../input/picking.ts";
import { outlineOf } from "../../../tiles/water/outline.ts";
import { pour } from "../../../tiles/water/pour.ts";
import { brim, raindrop, watershed } from "../../../tiles/water/water.ts";
import type { WaterField } from "./field.ts";

/** The way of a drop. */
export interface Way {
  /** On the map, smooth. */
  readonly points: readonly Place[];
  /** Where it ends: in the sea, or at the border. */
  readonly ends: "sea" | "border";
  /** Lakes that it passes through. */
  readonly lakes: number;
}

export interface Shed {
  readonly inside: Uint8Array;
  readonly areaM2: number;
  /** How many samples of ground it has. */
  readonly samples: number;
}

export interface FloodedLake {
  readonly levelM: number;
  readonly volumeM3: number;
  readonly areaM2: number;
  readonly depthM: number;
  readonly samples: Int32Array;
}

export interface Flood {
  /** The deepest first. */
  readonly lakes: readonly FloodedLake[];
  readonly pouredM3: number;
  readonly runsOffM3: number;
  /** What drains through the brim of the lake; through the place itself where there is none. */
  readonly shedM2: number;
}

/** How much water is poured out: millimetres of rain on the lake's watershed, or cubic metres. */
export interface Amount {
  readonly by: "rain" | "volume";
  readonly mm: number;
  readonly m3: number;
}

const WAY: Rgba = [0.24, 0.62, 0.95, 1];
const SHED: Rgba = [0.16, 0.42, 0.68, 0.95];
const SMOOTHED = 2;
const STEP = 1 / 512;
/** Rings of a watershed that are drawn: the outline, and islands worth a line. */
const MOST_RINGS = 8;

/** The sample that is nearest to a place. */
export function sampleAt({ side, cellM }: WaterField, [x, y]: Place): number {
  const at = (v: number): number => Math.min(side - 1, Math.max(0, Math.round(v / cellM)));
  return at(y) * side + at(x);
}

export function wayFrom({ water, side, cellM }: WaterField, index: number): Way {
  const samples = raindrop(water, index);
  let lakes = 0;
  samples.forEach((i, k) => {
    const before = samples[k - 1];
    const isWet = water.filled[i]! > water.z[i]!;
    if (isWet && (before === undefined || water.filled[before] === water.z[before])) lakes += 1;
  });
  const last = samples.at(-1)!;
  const [row, col] = [Math.floor(last / side), last % side];
  const atBorder = row === 0 || col === 0 || row === side - 1 || col === side - 1;
  return { points: smooth(samples, side, cellM), ends: atBorder ? "border" : "sea", lakes };
}

function smooth(samples: readonly number[], side: number, cellM: number): Place[] {
  let line: Place[] = samples.map((i) => [(i % side) * cellM, Math.floor(i / side) * cellM]);
  for (let pass = 0; pass < SMOOTHED; pass += 1) {
    const old = line;
    line = old.map((p, k) => {
      const [a, b] = [old[k - 1], old[k + 1]];
      return a === undefined || b === undefined ? p : [(a[0] + 2 * p[0] + b[0]) / 4, (a[1] + 2 * p[1] + b[1]) / 4];
    });
  }
  return line;
}

export function shedOf({ water, cellM }: WaterField, index: number): Shed {
  const samples = water.area[index]!;
  return { inside: watershed(water, index), areaM2: samples * cellM * cellM, samples };
}

/** Where so much water stands that is poured out at a sample. Hollows are empty at first. */
export function floodOf({ water, cellM, stepM }: WaterField, index: number, amount: Amount): Flood {
  const out = brim(water, index);
  const cellM2 = cellM * cellM;
  const shedM2 = water.area[out < 0 ? index : out]! * cellM2;
  const pouredM3 = amount.by === "volume" ? amount.m3 : (amount.mm / 1000) * shedM2;
  const stepM3 = stepM * cellM2;
  const { pools, left } = pour(water, index, pouredM3 / stepM3);
  const lakes = pools
    .filter((pool) => pool.samples.length > 0)
    .map(({ level, samples, volume }) => {
      let low = level;
      for (const i of samples) low = Math.min(low, water.z[i]!);
      return {
        levelM: level * stepM,
        volumeM3: volume * stepM3,
        areaM2: samples.length * cellM2,
        depthM: (level - low) * stepM,
        samples,
      };
    });
  return {
    lakes: lakes.sort((a, b) => b.volumeM3 - a.volumeM3),
    pouredM3,
    runsOffM3: left * stepM3,
    shedM2,
  };
}

/** A drop's way as a line on the ground. */
export function wayLine({ points }: Way, ground: Ground, colour: Rgba = WAY): FootprintVisual[] {
  if (points.length < 2) return [];
  return [
    {
      id: "water-way",
      points: onGround(
        points.flatMap(([x, y]) => [x, y, 0]),
        ground,
      ),
      colour,
      strong: true,
    },
  ];
}

/** A watershed's outline as lines on the ground. */
export function shedLines({ inside, samples }: Shed, { side, cellM }: WaterField, ground: Ground): FootprintVisual[] {
  if (samples < 4) return [];
  return outlineOf(inside, side)
    .slice(0, MOST_RINGS)
    .map((ring, k) => {
      const flat: number[] = [];
      for (let i = 0; i < ring.length; i += 2) {
        const at = (v: number): number => Math.min(ground.sizeM, Math.max(0, v * cellM));
        flat.push(at(ring[i]!), at(ring[i + 1]!), 0);
      }
      return { id: `water-shed-${k}`, points: onGround(flat, ground), colour: SHED, strong: false };
    });
}

function onGround(flat: readonly number[], ground: Ground): Float32Array {
  return new Float32Array(drape(flat, ground.sizeM * STEP, (x, y) => ground.heightAt(x, y)));
}
