/** Detail that is made where somebody looks, level by level, without a fixed end (DESIGN 10): what the selection needs to know. */

import type { ChannelView, TerrainSettings } from "../../core/types.ts";
import { SYNTH_ALPHA, TILE_CELLS } from "../../generated/contract.ts";
import type { Expectation } from "../patches/figures.ts";

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
  }
  return { amplitudeM: most, ratio: RATIOS[settings.rule] };
}
