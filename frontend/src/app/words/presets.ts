/** Cross-sections by name (DESIGN 12): starting points for the flanks of any stroke. */

import { msg } from "@lit/localize";
import type { Flank } from "../../generated/contract.ts";

export interface SectionFields {
  readonly left: Flank | null;
  readonly right: Flank | null;
  readonly plateau_radius_m: number;
}

export interface Preset {
  readonly id: string;
  readonly title: string;
  /** The kind of ground that a preset is meant for, rising or sinking; the inspector offers the fitting ones first. */
  readonly sense: "up" | "down";
  section(sizeM: number): SectionFields;
}

const flank = (slope_deg: number, extent_m: number, shape: Flank["shape"]): Flank => ({ slope_deg, extent_m, shape });

function both(slope: number, share: number, shape: Flank["shape"], plateauShare = 0): (sizeM: number) => SectionFields {
  return (sizeM) => ({
    left: flank(slope, extent(sizeM, share), shape),
    right: flank(slope, extent(sizeM, share), shape),
    plateau_radius_m: round(sizeM * plateauShare),
  });
}

/** Lengths to three significant digits: 4096 / 10 reads "410 m", not "409.6 m". */
function round(m: number): number {
  return Number(m.toPrecision(3));
}

/** Half the terrain is the most that the inspector offers. */
function extent(sizeM: number, share: number): number {
  return Math.min(round(sizeM * share), sizeM / 2);
}

export const PRESETS: readonly Preset[] = [
  { id: "ridge", title: msg("Ridge"), sense: "up", section: both(38, 1 / 2, "concave") },
  { id: "hill", title: msg("Hill"), sense: "up", section: both(18, 1 / 3, "convex", 1 / 128) },
  {
    id: "cliff",
    title: msg("Cliff"),
    sense: "up",
    section: (sizeM) => ({
      left: flank(76, extent(sizeM, 1 / 4), "straight"),
      right: flank(9, extent(sizeM, 1 / 2), "concave"),
      plateau_radius_m: 0,
    }),
  },
  { id: "plateau", title: msg("Plateau"), sense: "up", section: both(42, 1 / 4, "concave", 1 / 32) },
  { id: "valley", title: msg("Valley"), sense: "down", section: both(24, 1 / 3, "concave", 1 / 128) },
  { id: "canyon", title: msg("Canyon"), sense: "down", section: both(70, 1 / 6, "straight", 1 / 96) },
  { id: "riverbed", title: msg("Riverbed"), sense: "down", section: both(14, 1 / 24, "convex", 1 / 256) },
  { id: "crack", title: msg("Crack"), sense: "down", section: both(80, 1 / 24, "straight") },
];

/** The presets with those that suit the stroke first. */
export function presetsFor(sense: Preset["sense"]): readonly Preset[] {
  return [...PRESETS].sort((a, b) => Number(b.sense === sense) - Number(a.sense === sense));
}
