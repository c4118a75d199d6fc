/** Reads `tests/vectors/synthesis.json`, which the Python and shader tests read too. */

import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import type { ChannelGrid, ChannelView } from "../../src/core/types.ts";
import type { Look, Place, Rule } from "../../src/generated/contract.ts";
import { QUANTA_PER_CELL, TILE_CELLS } from "../../src/generated/contract.ts";
import { Biases } from "../../src/tiles/detail/biases.ts";
import { type Area, type Recipe, RULES, type Samples } from "../../src/tiles/detail/subdivide.ts";
import { fillArea } from "../../src/tiles/patches/guide.ts";
import { siteOf } from "../../src/tiles/rules/rule.ts";

export interface SiteVector {
  readonly name: string;
  readonly size_m: number;
  readonly seed: number;
  readonly detail: number;
  readonly erosion: number;
  readonly erosion_scale: number;
  readonly hold: number;
  readonly rule: Rule;
  readonly look: Look;
  readonly sea_level_m: number | null;
  readonly place: Place | null;
  readonly ground: readonly [number, number] | null;
  readonly cyclic: boolean;
  readonly solved: number;
  readonly channels: Readonly<Partial<Record<keyof Omit<ChannelView, "stamp">, readonly (readonly number[])[]>>>;
  readonly quanta: readonly (readonly number[])[];
}

type Corners = readonly [number, number, number, number];

export interface PlaceVector {
  readonly site: string;
  readonly level: number;
  readonly window: Corners;
  readonly guide: readonly number[];
  readonly base: readonly number[];
  readonly state: readonly number[];
}

export interface StepVector extends Omit<PlaceVector, "base"> {
  readonly parent: { readonly window: Corners; readonly guide: readonly number[]; readonly state: readonly number[] };
}

interface Vectors {
  readonly metres: number;
  readonly unorm: number;
  readonly hashes: readonly { seed: number; level: number; stream: number; i: number; j: number; hash: number }[];
  readonly sites: readonly SiteVector[];
  readonly steps: readonly StepVector[];
  readonly places: readonly PlaceVector[];
}

const path = resolve(import.meta.dirname, "../../../tests/vectors/synthesis.json");
export const vectors = JSON.parse(readFileSync(path, "utf8")) as Vectors;

const BASES = {
  amplitude: 0,
  roughness: 0.5,
  snow: 0,
  grass: 0,
  forest: 0,
  wetness: 0,
  survey: -1,
  erosion: 0,
  far: 1,
};

/** Channels of which some are given; the others are their base everywhere. */
export function channelsOf(given: SiteVector["channels"] = {}): ChannelView {
  const grid = (name: keyof typeof BASES): ChannelGrid => {
    const values = given[name];
    if (values === undefined) return { side: 2, values: new Float32Array(4).fill(BASES[name]) };
    return { side: values.length, values: new Float32Array(values.flat()) };
  };
  return {
    stamp: 1,
    amplitude: grid("amplitude"),
    roughness: grid("roughness"),
    snow: grid("snow"),
    grass: grid("grass"),
    forest: grid("forest"),
    wetness: grid("wetness"),
    survey: grid("survey"),
    erosion: grid("erosion"),
    far: grid("far"),
  };
}

export function recipeOf(site: SiteVector): Recipe {
  const quantum = (level: number): number => site.size_m / (TILE_CELLS * 2 ** level) / QUANTA_PER_CELL;
  const heights = site.quanta.map((q, level) => Float32Array.from(q, (v) => v * quantum(level)));
  return {
    site: siteOf(site),
    rule: RULES[site.rule],
    biases: new Biases(channelsOf(site.channels), siteOf(site)),
    guide: (area, out) => fillArea((level, j, i) => heights[level]?.[j * (TILE_CELLS * 2 ** level + 1) + i], area, out),
  };
}

export function areaOf(level: number, [r0, r1, c0, c1]: Corners): Area {
  return { level, r0, r1, c0, c1 };
}

const word = new DataView(new ArrayBuffer(4));

function float(bits: number): number {
  word.setUint32(0, bits);
  return word.getFloat32(0);
}

/** The state that four words a sample hold. */
export function unpacked(
  words: readonly number[],
): Record<"d" | "h" | "snow" | "wet" | "grass" | "forest" | "foam", Float64Array> {
  const n = words.length / 4;
  const made = (value: (k: number) => number): Float64Array => Float64Array.from({ length: n }, (_, k) => value(k));
  const low = (k: number, w: number): number => (words[4 * k + w]! & 0xffff) / 65535;
  const high = (k: number, w: number): number => (words[4 * k + w]! >>> 16) / 65535;
  return {
    d: made((k) => float(words[4 * k]!)),
    h: made((k) => 2 * low(k, 1)),
    snow: made((k) => high(k, 1)),
    wet: made((k) => low(k, 2)),
    grass: made((k) => high(k, 2)),
    forest: made((k) => low(k, 3)),
    foam: made((k) => high(k, 3)),
  };
}

/** The samples that a parent's vector gives. */
export function samplesOf(level: number, given: StepVector["parent"]): Samples {
  return {
    area: areaOf(level, given.window),
    guide: Float64Array.from(given.guide, Math.fround),
    ...unpacked(given.state),
    sigma: 0,
    exponent: 1,
    gully: 0,
  };
}
