/**
 * What a rule of the synthesis is given and gives for one sample (docs/synthesis.md). Twin of
 * `backend/esker/synthesis/site.py`. One object serves all samples of a window: rules run some thousand times for one
 * picked point, and objects made for each would cost more than the rule.
 */

import type { Place, TerrainSettings } from "../../generated/contract.ts";
import {
  BASE_SURVEY,
  DEFAULT_EROSION,
  DEFAULT_EROSION_SCALE,
  DEFAULT_HOLD,
  SYNTH_ALPHA,
  SYNTH_GULLY_CELL,
  SYNTH_LEAST_SNOW_LINE_M,
  SYNTH_LOOKS,
  SYNTH_SHORE_M,
  SYNTH_SNOW_LINE_M,
  SYNTH_SNOW_SHARE,
  TILE_CELLS,
} from "../../generated/contract.ts";

/** One terrain as its rule sees it. */
export interface Site {
  readonly sizeM: number;
  /** Elevations are shares of this height, metres. */
  readonly reliefM: number;
  /** The elevation of wet shores is a share of this height, metres. */
  readonly shoreM: number;
  readonly seed: number;
  /** Amplitude of the coarsest octave on steep ground, metres. */
  readonly amplitudeM: number;
  readonly seaLevelM: number | null;
  /** Where elevations count from, metres. */
  readonly zeroM: number;
  readonly snowLine: number;
  readonly treeLine: number;
  readonly plants: number;
  /** Strength of the gullies, 0..2. */
  readonly erosion: number;
  /** Side of a cell of the lattice of gullies, in samples of any level. */
  readonly gullySide: number;
  /** How strictly what strokes fix keeps its height, 0..1. */
  readonly hold: number;
}

/** Strength, wavelength in cells and hold of gullies, as settings have them. */
export interface ErosionSettings {
  readonly erosion: number;
  readonly erosion_scale: number;
  readonly hold: number;
}

export type RuleSettings = Pick<TerrainSettings, "size_m" | "seed" | "sea_level_m" | "look" | "detail" | "rule"> &
  Partial<Pick<TerrainSettings, "place">> &
  Partial<ErosionSettings> & { readonly ground?: GroundSpan | null };

/** Lowest and highest sample of the elevation layers that are shown, metres. */
export type GroundSpan = readonly [number, number];

/**
 * Where elevations count from, metres: the sea; without one the lowest sample of elevation layers on a terrain without a
 * place on Earth, else 0.
 */
export function zeroM(settings: Pick<RuleSettings, "sea_level_m" | "place" | "ground">): number {
  const { sea_level_m, place, ground } = settings;
  return sea_level_m ?? (place == null ? (ground?.[0] ?? 0) : 0);
}

/**
 * Returns the height that elevations are shares of, metres. Without data it is the domain's side, so that a sketch of
 * any size has its own climate. Where the terrain has a place on Earth, it is chosen so that the natural look's snow
 * line is the real one's height there. Ground of elevation layers without a place has the snow line at a share of its
 * relief at least.
 */
export function reliefM(settings: Pick<RuleSettings, "size_m" | "sea_level_m" | "place" | "ground">): number {
  const { size_m, place, ground } = settings;
  if (place == null) {
    const above = ground == null ? 0 : ground[1] - zeroM(settings);
    return Math.max(size_m, (SYNTH_SNOW_SHARE * above) / SYNTH_LOOKS.natural.snowLine);
  }
  const line = SYNTH_SNOW_LINE_M * Math.cos((place.lat_deg * Math.PI) / 180) ** 2;
  return Math.max(SYNTH_LEAST_SNOW_LINE_M, line) / SYNTH_LOOKS.natural.snowLine;
}

/** Returns the height that the elevation of wet shores is a share of, metres. */
export function shoreM(sizeM: number, place: Place | null | undefined): number {
  return place == null ? sizeM : SYNTH_SHORE_M;
}

/** The site that settings describe. */
export function siteOf(settings: RuleSettings): Site {
  const look = SYNTH_LOOKS[settings.look];
  return {
    sizeM: settings.size_m,
    reliefM: reliefM(settings),
    shoreM: shoreM(settings.size_m, settings.place),
    seed: settings.seed,
    amplitudeM: (settings.detail * SYNTH_ALPHA * settings.size_m) / TILE_CELLS,
    seaLevelM: settings.sea_level_m,
    zeroM: zeroM(settings),
    snowLine: look.snowLine,
    treeLine: look.treeLine,
    plants: look.plants,
    erosion: settings.erosion ?? DEFAULT_EROSION,
    gullySide: Math.floor(SYNTH_GULLY_CELL * (settings.erosion_scale ?? DEFAULT_EROSION_SCALE) + 0.5),
    hold: settings.hold ?? DEFAULT_HOLD,
  };
}

/** A sample between its parent and its rule. The rule reads all and overwrites `d` to `gully`. */
export interface Sample {
  level: number;
  /** The parent's ground with its detail, metres, its slopes, its concavity -1..1, and the slope of the guide alone. */
  height: number;
  slopeX: number;
  slopeY: number;
  concavity: number;
  guideSlope: number;
  /** Channels that strokes ask for: metres, 0..1, and biases -1..1. */
  amplitude: number;
  roughness: number;
  snowBias: number;
  grassBias: number;
  forestBias: number;
  wetBias: number;
  /** The level whose spacing is that of the finest elevation data here: detail begins below it. */
  survey: number;
  /** Paint of gullies, -1..1; distance from what strokes fix, metres. */
  erosionBias: number;
  farM: number;
  /** Gullies are asked for somewhere on the terrain. */
  eroded: boolean;
  /** Global row and column, and what the hash of the pivots of gullies starts from on this level. */
  row: number;
  col: number;
  gullyKey: number;
  /** Uniform in -1..1, one for each of the six values below. */
  noiseD: number;
  noiseH: number;
  noiseSnow: number;
  noiseWet: number;
  noiseGrass: number;
  noiseForest: number;
  noiseFoam: number;
  /** The parent's state here, then this level's: detail in metres, smoothness exponent, and shares 0..1. */
  d: number;
  h: number;
  snow: number;
  wet: number;
  grass: number;
  forest: number;
  foam: number;
  /**
   * The most that this level could add to or take from the detail, metres, if no data held it back, and how fast that
   * falls: 2^-exponent a level.
   */
  sigma: number;
  exponent: number;
  /** The most that this level's gullies could move the ground if nothing held them, metres. */
  gully: number;
}

export function newSample(): Sample {
  return {
    level: 0,
    height: 0,
    slopeX: 0,
    slopeY: 0,
    concavity: 0,
    guideSlope: 0,
    amplitude: 0,
    roughness: 0.5,
    snowBias: 0,
    grassBias: 0,
    forestBias: 0,
    wetBias: 0,
    survey: BASE_SURVEY,
    erosionBias: 0,
    farM: 0,
    eroded: false,
    row: 0,
    col: 0,
    gullyKey: 0,
    noiseD: 0,
    noiseH: 0,
    noiseSnow: 0,
    noiseWet: 0,
    noiseGrass: 0,
    noiseForest: 0,
    noiseFoam: 0,
    d: 0,
    h: 0,
    snow: 0,
    wet: 0,
    grass: 0,
    forest: 0,
    foam: 0,
    sigma: 0,
    exponent: 1,
    gully: 0,
  };
}

/**
 * Makes a sample of its parent, in place. `relief` asks for the detail and what it depends on only (d, h, snow): the
 * other channels then stay as they were.
 */
export type Rule = (site: Site, sample: Sample, relief: boolean) => void;

/** 0 below a, 1 above b, smooth between. */
export function smoothstep(a: number, b: number, x: number): number {
  const t = x <= a ? 0 : x >= b ? 1 : (x - a) / (b - a);
  return t * t * (3 - 2 * t);
}

export const clamp = (x: number, low: number, high: number): number => Math.min(Math.max(x, low), high);
