/**
 * Rule `landscape`: multi-channel fractals (paper 1, section 4), the default (docs/synthesis.md, "Landscape"). Twin of
 * `backend/esker/synthesis/rules/landscape.py`.
 */

import {
  BASE_ROUGHNESS,
  SYNTH_AMPLITUDE_SLOPE_FROM,
  SYNTH_AMPLITUDE_SLOPE_TO,
  SYNTH_CHANNEL_NOISE,
  SYNTH_CHANNEL_NOISE_DECAY,
  SYNTH_CHANNEL_NOISE_PURE,
  SYNTH_FLAT_SHARE,
  SYNTH_H_RANGE_FROM,
  SYNTH_H_RANGE_TO,
  SYNTH_ROUGHNESS_TO_H,
  SYNTH_SMOOTHNESS_MAX,
  SYNTH_SMOOTHNESS_MIN,
  SYNTH_SMOOTHNESS_NOISE,
  SYNTH_SMOOTHNESS_NOISE_DECAY,
  SYNTH_SNOW_TO_H,
} from "../../generated/contract.ts";
import { gullies, wear } from "./gullies.ts";
import { clamp, type Sample, type Site, smoothstep } from "./rule.ts";
import { blended, painted, targets, tie } from "./targets.ts";

/** Values that depend on the level alone. */
interface Octave {
  readonly tied: number;
  readonly grain: number;
  readonly strength: number;
}

const octaves: Octave[] = [];

function octave(level: number): Octave {
  octaves[level] ??= {
    tied: tie(level),
    grain: SYNTH_SMOOTHNESS_NOISE * 2 ** (-SYNTH_SMOOTHNESS_NOISE_DECAY * level),
    strength: SYNTH_CHANNEL_NOISE * 2 ** (-SYNTH_CHANNEL_NOISE_DECAY * level),
  };
  return octaves[level];
}

/** A, metres: more on steep ground, and what strokes add (or take away). */
export function amplitude(site: Site, guideSlope: number, channel: number): number {
  const steep = smoothstep(SYNTH_AMPLITUDE_SLOPE_FROM, SYNTH_AMPLITUDE_SLOPE_TO, guideSlope);
  return Math.max(0, site.amplitudeM * (SYNTH_FLAT_SHARE + (1 - SYNTH_FLAT_SHARE) * steep) + channel);
}

/** Share of the detail of a level that may be heard: none down to the spacing of the data, then all of it. */
export function audible(level: number, survey: number): number {
  return clamp(level - survey, 0, 1);
}

/** Each channel is the parent's, drawn to its target, plus noise; d gets noise of amplitude A 2^(-level H). */
export function landscape(site: Site, at: Sample, relief: boolean): void {
  const { tied, grain, strength } = octave(at.level);
  const wanted = targets(site, at, relief);
  at.h = clamp(blended(at.h + grain * at.noiseH, wanted.h, tied), SYNTH_SMOOTHNESS_MIN, SYNTH_SMOOTHNESS_MAX);
  at.snow = painted(mixed(at.snow, wanted.snow, strength * at.noiseSnow, tied), at.snowBias);
  if (!relief) {
    at.wet = painted(mixed(at.wet, wanted.wet, strength * at.noiseWet, tied), at.wetBias);
    at.grass = painted(mixed(at.grass, wanted.grass, strength * at.noiseGrass, tied), at.grassBias);
    at.forest = painted(mixed(at.forest, wanted.forest, strength * at.noiseForest, tied), at.forestBias);
    at.foam = mixed(at.foam, wanted.foam, strength * at.noiseFoam, tied);
  }
  const exponent = at.h + SYNTH_ROUGHNESS_TO_H * (BASE_ROUGHNESS - at.roughness) + SYNTH_SNOW_TO_H * at.snow;
  at.exponent = clamp(exponent, SYNTH_H_RANGE_FROM, SYNTH_H_RANGE_TO);
  const size = amplitude(site, at.guideSlope, at.amplitude);
  at.sigma = size === 0 ? 0 : size * 2 ** (-at.level * at.exponent);
  const heard = audible(at.level, at.survey);
  if (!at.eroded) {
    at.d += at.sigma * heard * at.noiseD;
    at.gully = 0;
    return;
  }
  const { calm, depth, most } = wear(site, at);
  at.gully = most;
  at.d += at.sigma * heard * calm * at.noiseD;
  if (depth * heard !== 0) at.d += depth * heard * gullies(site, at);
}

/** Noise is strongest where the target is undecided, so that the border of a forest frays and its inside is whole. */
function mixed(x: number, target: number, noise: number, tied: number): number {
  const undecided = SYNTH_CHANNEL_NOISE_PURE + 4 * (1 - SYNTH_CHANNEL_NOISE_PURE) * target * (1 - target);
  return clamp(blended(x + noise * undecided, target, tied), 0, 1);
}
