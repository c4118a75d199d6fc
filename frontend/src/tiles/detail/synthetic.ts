/** Detail that is made where somebody looks, level by level, without a fixed end (DESIGN 10): what the selection needs to know. */

import type { ChannelView, TerrainSettings } from "../../core/types.ts";
import {
  MAX_EROSION,
  SYNTH_ALPHA,
  SYNTH_GULLY_CELL,
  SYNTH_GULLY_MOST,
  SYNTH_GULLY_STEEP,
  TILE_CELLS,
} from "../../generated/contract.ts";
import { type Expectation, FALL } from "../patches/figures.ts";
import { depthM } from "../rules/gullies.ts";

/**
 * Error of a level from that of the one above it, until it is measured. `landscape` falls by 2^-H, H from 0.45 to 1.8: the
 * middle, or each level that waits for its figures would ask for one too many. Smooth ground's error falls by four.
 */
const RATIOS = { landscape: 0.5, smooth: 0.25, plain: 0.25 } as const;

/** Detail to expect of levels that have not been made. */
export function expectation(sizeM: number, settings: TerrainSettings, channels: ChannelView): Expectation {
  let most = 0;
  if (settings.rule === "landscape") {
    for (const asked of channels.amplitude.values) if (asked > most) most = asked;
    most += (settings.detail * SYNTH_ALPHA * sizeM) / TILE_CELLS;
    most += gulliesM(sizeM, settings, channels);
  }
  return { amplitudeM: most, ratio: RATIOS[settings.rule] };
}

/** The most that gullies of level 0 would move the ground if it had any, metres: those of level 1 are a part of it. */
function gulliesM(sizeM: number, settings: TerrainSettings, channels: ChannelView): number {
  let painted = 0;
  for (const asked of channels.erosion.values) if (asked > painted) painted = asked;
  const gullySide = Math.floor(SYNTH_GULLY_CELL * settings.erosion_scale + 0.5);
  const strength = Math.min(settings.erosion + painted, MAX_EROSION);
  return (SYNTH_GULLY_MOST * SYNTH_GULLY_STEEP * strength * depthM({ sizeM, gullySide }, 1)) / FALL;
}
