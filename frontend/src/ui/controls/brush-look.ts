/** The pattern that fills the ring of the brush. It looks like what the brush paints. */

import { svg, type TemplateResult } from "lit";
import { SUBSTANCES } from "../../app/words/paints.ts";
import type { PaintChannel } from "../../generated/contract.ts";

/** Marks of a tile of 18 by 18 CSS pixels: flakes, trees, blades, ripples, rubble, hills, gullies that join. */
const MARKS: Readonly<Record<PaintChannel, { readonly path: string; readonly filled: boolean }>> = {
  snow: { path: "M3 4h.01M12 2h.01M8 9h.01M15 11h.01M4 14h.01M11 16h.01", filled: false },
  forest: { path: "M5 1 8 8H2ZM14 9 17 16H11Z", filled: true },
  grass: { path: "M3 8q0-4 2-6M5 8q1-3 3-4M11 17q0-4 2-6M13 17q1-3 3-4", filled: false },
  wetness: { path: "M1 5q2-3 4 0t4 0M9 14q2-3 4 0t4 0", filled: false },
  roughness: { path: "M1 7 4 3 6 6 8 4M9 15 12 11 14 14 17 10", filled: false },
  amplitude: { path: "M1 8Q4 0 8 8M9 17Q13 9 17 17", filled: false },
  erosion: { path: "M4 1Q4 6 9 9M14 2Q13 6 9 9M9 9Q10 13 8 17M2 12Q5 13 8 16", filled: false },
};

/** The pattern of a substance, to be put into an `svg` once and named by `url(#brush-…)`. */
export function brushPattern(channel: PaintChannel): TemplateResult {
  const { path, filled } = MARKS[channel];
  const { colour } = SUBSTANCES[channel];
  return svg`
    <pattern id="brush-${channel}" width="18" height="18" patternUnits="userSpaceOnUse">
      <rect width="18" height="18" fill=${colour} opacity="0.22"></rect>
      <path d=${path} fill=${filled ? colour : "none"} stroke=${colour} stroke-width=${channel === "snow" ? 2.6 : 1.4} stroke-linecap="round" opacity="0.9"></path>
    </pattern>
  ` as unknown as TemplateResult;
}
