/**
 * Gullies: one octave a level of waves whose lines run down the slope (docs/synthesis.md, "Gullies"). Twin of
 * `backend/esker/synthesis/rules/gullies.py`. Polynomials stand for sine and arc tangent, so that all twins agree.
 */

import {
  MAX_EROSION,
  SYNTH_GULLY_AGREEMENT,
  SYNTH_GULLY_AGREEMENT_LEAST,
  SYNTH_GULLY_ARC_1,
  SYNTH_GULLY_ARC_3,
  SYNTH_GULLY_ARC_5,
  SYNTH_GULLY_ARC_7,
  SYNTH_GULLY_ARC_9,
  SYNTH_GULLY_ARC_11,
  SYNTH_GULLY_BED,
  SYNTH_GULLY_CALM,
  SYNTH_GULLY_CALM_GAIN,
  SYNTH_GULLY_CALM_LEVELS_FROM,
  SYNTH_GULLY_CALM_LEVELS_TO,
  SYNTH_GULLY_CELL,
  SYNTH_GULLY_CREST_FROM,
  SYNTH_GULLY_CREST_TO,
  SYNTH_GULLY_DEPTH,
  SYNTH_GULLY_FLAT_FROM,
  SYNTH_GULLY_FLAT_TO,
  SYNTH_GULLY_FOOT_FROM,
  SYNTH_GULLY_FOOT_SHARE,
  SYNTH_GULLY_FOOT_TO,
  SYNTH_GULLY_GAIN,
  SYNTH_GULLY_HOLD_FROM,
  SYNTH_GULLY_HOLD_TO,
  SYNTH_GULLY_JITTER,
  SYNTH_GULLY_MIDDLE,
  SYNTH_GULLY_MOST,
  SYNTH_GULLY_QUIET_LEVELS_FROM,
  SYNTH_GULLY_QUIET_LEVELS_TO,
  SYNTH_GULLY_RIDGE,
  SYNTH_GULLY_SINE_1,
  SYNTH_GULLY_SINE_3,
  SYNTH_GULLY_SINE_5,
  SYNTH_GULLY_SINE_7,
  SYNTH_GULLY_SINE_9,
  SYNTH_GULLY_STEEP,
  SYNTH_GULLY_STEEPER,
  SYNTH_GULLY_TURN,
  TILE_CELLS,
} from "../../generated/contract.ts";
import { hashAt, high, low, rowStart } from "../detail/noise.ts";
import { type Sample, type Site, smoothstep } from "./rule.ts";

/** Wavelength of the octave of a level, metres. */
export function waveM(site: Pick<Site, "sizeM" | "gullySide">, level: number): number {
  return ((site.gullySide / SYNTH_GULLY_CELL) * site.sizeM) / (TILE_CELLS * 2 ** level);
}

/** Depth of the octave of a level on a slope of 1, metres, at strength 1. */
export function depthM(site: Pick<Site, "sizeM" | "gullySide">, level: number): number {
  return SYNTH_GULLY_DEPTH * SYNTH_GULLY_GAIN ** (level - 1) * waveM(site, level);
}

/** What gullies are at a sample. */
export interface Wear {
  /** Share of the noise of d that is left. */
  calm: number;
  /** Depth of the octave, metres. */
  depth: number;
  /** The most that the octave may move the ground where nothing holds it, metres. */
  most: number;
}

const worn: Wear = { calm: 1, depth: 0, most: 0 };

/** By the slope of the drawn ground. */
function steepness(slope: number): number {
  return smoothstep(SYNTH_GULLY_FLAT_FROM, SYNTH_GULLY_FLAT_TO, slope) * Math.min(slope, SYNTH_GULLY_STEEP);
}

/** What settings, paint and distance make of gullies at a sample. The same object every time: read it at once. */
export function wear(site: Site, at: Sample): Readonly<Wear> {
  const asked = site.erosion * (1 + Math.min(at.erosionBias, 0)) + Math.max(at.erosionBias, 0);
  const strength = Math.min(asked, MAX_EROSION);
  const shallow = Math.min(strength, 1);
  const steep = steepness(at.guideSlope);
  const away = at.farM / waveM(site, at.level);
  const held = site.hold * (1 - smoothstep(SYNTH_GULLY_HOLD_FROM, SYNTH_GULLY_HOLD_TO, away));
  const loud = smoothstep(SYNTH_GULLY_CALM_LEVELS_FROM, SYNTH_GULLY_CALM_LEVELS_TO, at.level);
  const less = ((SYNTH_GULLY_CALM - SYNTH_GULLY_CALM_GAIN * loud) / SYNTH_GULLY_STEEP) * shallow * steep;
  const fine = smoothstep(SYNTH_GULLY_QUIET_LEVELS_FROM, SYNTH_GULLY_QUIET_LEVELS_TO, at.level);
  worn.calm = (1 - less) * (1 - (1 - fine) * shallow * held);
  const crest = 1 - site.hold * smoothstep(SYNTH_GULLY_CREST_FROM, SYNTH_GULLY_CREST_TO, -at.concavity);
  const foot = 1 - SYNTH_GULLY_FOOT_SHARE * smoothstep(SYNTH_GULLY_FOOT_FROM, SYNTH_GULLY_FOOT_TO, at.concavity);
  const deepest = depthM(site, at.level) * strength;
  worn.depth = at.level === 0 ? 0 : deepest * steep * crest * foot * (1 - held);
  worn.most = SYNTH_GULLY_MOST * deepest * steepness(SYNTH_GULLY_STEEPER * at.guideSlope);
  return worn;
}

/** The octave of the sample's level for a depth of 1: -0.55 in beds to 0.45 on ridges. */
export function gullies(site: Site, at: Sample): number {
  const side = site.gullySide;
  const ci = Math.floor(at.col / side);
  const cj = Math.floor(at.row / side);
  const u = (at.col - ci * side) / side;
  const v = (at.row - cj * side) / side;
  const turn = 1 / Math.sqrt(at.slopeX ** 2 + at.slopeY ** 2 + SYNTH_GULLY_TURN ** 2);
  const nx = -at.slopeY * turn;
  const ny = at.slopeX * turn;
  let [c, s, weights] = [0, 0, 0];
  for (let dj = -1; dj <= 1; dj += 1) {
    const row = rowStart(at.gullyKey, cj + dj);
    for (let di = -1; di <= 1; di += 1) {
      const word = hashAt(row, ci + di);
      const qx = u - (di + 0.5 + SYNTH_GULLY_JITTER * low(word));
      const qy = v - (dj + 0.5 + SYNTH_GULLY_JITTER * high(word));
      const w = 1 - (qx * qx + qy * qy);
      if (w <= 0) continue;
      const turns = SYNTH_GULLY_CELL * (qx * nx + qy * ny);
      const t = turns - Math.floor(turns + 0.5);
      c += w * w * sine(0.25 - Math.abs(t));
      s += w * w * sine(Math.abs(t) <= 0.25 ? t : (t < 0 ? -0.5 : 0.5) - t);
      weights += w * w;
    }
  }
  const length = Math.sqrt(c * c + s * s);
  const agree = Math.min(1, length / (SYNTH_GULLY_AGREEMENT * weights + SYNTH_GULLY_AGREEMENT_LEAST));
  return agree * agree * (3 - 2 * agree) * profile(halfTurns(s, c));
}

/** Sine of a phase in turns, on a quarter of a turn. */
function sine(a: number): number {
  const p = a * a;
  const inner = SYNTH_GULLY_SINE_5 + p * (SYNTH_GULLY_SINE_7 + p * SYNTH_GULLY_SINE_9);
  return a * (SYNTH_GULLY_SINE_1 + p * (SYNTH_GULLY_SINE_3 + p * inner));
}

/** |atan2(s, c)| / pi. */
function halfTurns(s: number, c: number): number {
  const x = Math.min(Math.abs(s), Math.abs(c)) / Math.max(Math.abs(s), Math.abs(c), 1e-20);
  const p = x * x;
  const inner = SYNTH_GULLY_ARC_7 + p * (SYNTH_GULLY_ARC_9 + p * SYNTH_GULLY_ARC_11);
  const first = x * (SYNTH_GULLY_ARC_1 + p * (SYNTH_GULLY_ARC_3 + p * (SYNTH_GULLY_ARC_5 + p * inner)));
  const quarter = Math.abs(s) > Math.abs(c) ? 0.5 - first : first;
  return c < 0 ? 1 - quarter : quarter;
}

/** Height across a gully of depth 1, at `t` from its ridge, 0, to its bed, 1: hyperbolas at both ends. */
function profile(t: number): number {
  const below = rounded(t, SYNTH_GULLY_RIDGE);
  const above = 1 - rounded(1 - t, SYNTH_GULLY_BED);
  return SYNTH_GULLY_MIDDLE - (below * (1 - t) + above * t);
}

function rounded(t: number, radius: number): number {
  return (Math.sqrt(t * t + radius * radius) - radius) / (Math.sqrt(1 + radius * radius) - radius);
}
