/**
 * Targets that the ground sets for the channels (docs/synthesis.md, "Targets"), and the ways to follow them. Twin of
 * `backend/esker/synthesis/rules/targets.py`.
 */

import {
  SYNTH_FOAM,
  SYNTH_FOREST,
  SYNTH_FOREST_SLOPE_FROM,
  SYNTH_FOREST_SLOPE_TO,
  SYNTH_FOREST_THINS,
  SYNTH_FOREST_VALLEY,
  SYNTH_GRASS_ABOVE_TREES,
  SYNTH_GRASS_SLOPE_FROM,
  SYNTH_GRASS_SLOPE_TO,
  SYNTH_SMOOTHNESS,
  SYNTH_SMOOTHNESS_FLAT,
  SYNTH_SMOOTHNESS_FLAT_SLOPE_FROM,
  SYNTH_SMOOTHNESS_FLAT_SLOPE_TO,
  SYNTH_SMOOTHNESS_LOW,
  SYNTH_SMOOTHNESS_LOW_ELEVATION_FROM,
  SYNTH_SMOOTHNESS_LOW_ELEVATION_TO,
  SYNTH_SMOOTHNESS_STEEP,
  SYNTH_SMOOTHNESS_STEEP_SLOPE_FROM,
  SYNTH_SMOOTHNESS_STEEP_SLOPE_TO,
  SYNTH_SMOOTHNESS_VALLEY,
  SYNTH_SMOOTHNESS_VALLEY_CONCAVITY_FROM,
  SYNTH_SMOOTHNESS_VALLEY_CONCAVITY_TO,
  SYNTH_SNOW_EDGE_FROM,
  SYNTH_SNOW_EDGE_TO,
  SYNTH_SNOW_NORTH,
  SYNTH_SNOW_SLOPE_FROM,
  SYNTH_SNOW_SLOPE_TO,
  SYNTH_SNOW_VALLEY,
  SYNTH_TIE,
  SYNTH_TIE_DECAY,
  SYNTH_TIE_MIN,
  SYNTH_WET_CONCAVITY_FROM,
  SYNTH_WET_CONCAVITY_TO,
  SYNTH_WET_SHORE_FROM,
  SYNTH_WET_SHORE_TO,
  SYNTH_WET_SLOPE_FROM,
  SYNTH_WET_SLOPE_TO,
  SYNTH_WET_VALLEY,
} from "../../generated/contract.ts";
import { type Sample, type Site, smoothstep } from "./rule.ts";

/** h*, snow*, wet*, grass*, forest*, foam* of one sample. */
export interface Targets {
  h: number;
  snow: number;
  wet: number;
  grass: number;
  forest: number;
  foam: number;
}

const found: Targets = { h: 0, snow: 0, wet: 0, grass: 0, forest: 0, foam: SYNTH_FOAM };

/** The targets of a sample; with `relief` only h* and snow* are made. The same object every time: read it at once. */
export function targets(site: Site, at: Sample, relief: boolean): Readonly<Targets> {
  const aboveSea = at.height - site.zeroM;
  const e = aboveSea / site.reliefM;
  const t2 = at.slopeX * at.slopeX + at.slopeY * at.slopeY;
  const t = Math.sqrt(t2);
  const v = at.concavity;
  const north = -at.slopeY / Math.sqrt(1 + t2);
  found.h =
    SYNTH_SMOOTHNESS +
    SYNTH_SMOOTHNESS_FLAT * (1 - smoothstep(SYNTH_SMOOTHNESS_FLAT_SLOPE_FROM, SYNTH_SMOOTHNESS_FLAT_SLOPE_TO, t)) -
    SYNTH_SMOOTHNESS_STEEP * smoothstep(SYNTH_SMOOTHNESS_STEEP_SLOPE_FROM, SYNTH_SMOOTHNESS_STEEP_SLOPE_TO, t) +
    SYNTH_SMOOTHNESS_VALLEY *
      smoothstep(SYNTH_SMOOTHNESS_VALLEY_CONCAVITY_FROM, SYNTH_SMOOTHNESS_VALLEY_CONCAVITY_TO, v) +
    SYNTH_SMOOTHNESS_LOW * (1 - smoothstep(SYNTH_SMOOTHNESS_LOW_ELEVATION_FROM, SYNTH_SMOOTHNESS_LOW_ELEVATION_TO, e));
  const line = site.snowLine - SYNTH_SNOW_NORTH * north - SYNTH_SNOW_VALLEY * v;
  found.snow =
    smoothstep(SYNTH_SNOW_EDGE_FROM, SYNTH_SNOW_EDGE_TO, e - line) *
    (1 - smoothstep(SYNTH_SNOW_SLOPE_FROM, SYNTH_SNOW_SLOPE_TO, t));
  if (!relief) plantsAndWater(site, e, aboveSea / site.shoreM, t, v);
  return found;
}

function plantsAndWater(site: Site, e: number, shoreE: number, t: number, v: number): void {
  const tree = site.treeLine;
  const bare = 1 - found.snow;
  found.grass =
    site.plants *
    (1 - smoothstep(SYNTH_GRASS_SLOPE_FROM, SYNTH_GRASS_SLOPE_TO, t)) *
    (1 - smoothstep(tree, SYNTH_GRASS_ABOVE_TREES * tree, e)) *
    bare;
  found.forest =
    site.plants *
    (SYNTH_FOREST + SYNTH_FOREST_VALLEY * v) *
    (1 - smoothstep(SYNTH_FOREST_SLOPE_FROM, SYNTH_FOREST_SLOPE_TO, t)) *
    (1 - smoothstep(SYNTH_FOREST_THINS * tree, tree, e)) *
    bare;
  const valley =
    SYNTH_WET_VALLEY *
    smoothstep(SYNTH_WET_CONCAVITY_FROM, SYNTH_WET_CONCAVITY_TO, v) *
    (1 - smoothstep(SYNTH_WET_SLOPE_FROM, SYNTH_WET_SLOPE_TO, t));
  const shore = site.seaLevelM === null ? 0 : 1 - smoothstep(SYNTH_WET_SHORE_FROM, SYNTH_WET_SHORE_TO, shoreE);
  found.wet = Math.max(valley, shore);
}

/** How strictly a level's channels follow their targets: strictly on coarse levels, loosely on fine ones. */
export function tie(level: number): number {
  return Math.max(SYNTH_TIE_MIN, SYNTH_TIE * 2 ** (-SYNTH_TIE_DECAY * level));
}

/** A channel on its way to its target. */
export function blended(before: number, target: number, tied: number): number {
  return before * (1 - tied) + target * tied;
}

/** A channel 0..1 under a stroke's bias: +1 makes it 1, -1 makes it 0. */
export function painted(x: number, bias: number): number {
  const strength = Math.abs(bias);
  return x * (1 - strength) + (bias > 0 ? strength : 0);
}
