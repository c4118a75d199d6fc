/** Lakes that were poured out, in place of those that their hollows hold otherwise. */

import type { FloodVisual } from "../../core/types.ts";
import { NO_LAKE } from "../../generated/contract.ts";
import { type Lakes, widenedShores } from "./lakes.ts";

/** `found` with the lakes of a flood; both are of the same level. */
export function withFlood(found: Lakes, { heights: ground, lakes }: FloodVisual): Lakes {
  if (ground.length !== found.heights.length) return found;
  const emptied = new Set<number>();
  for (const { samples } of lakes)
    for (const i of samples) if (found.levels[i] !== NO_LAKE) emptied.add(found.levels[i]!);
  const levels = found.levels.map((level) => (emptied.has(level) ? NO_LAKE : level));
  const heights = found.heights.slice();
  const samples = new Map([...found.samples].filter(([level]) => !emptied.has(level)));
  const poured = new Float32Array(levels.length).fill(NO_LAKE);
  for (const lake of lakes) {
    const level = Math.fround(lake.levelM);
    for (const i of lake.samples) if (ground[i]! < level) poured[i] = level;
    samples.set(level, lake.samples.length);
  }
  const wide = widenedShores(poured, ground, found.side);
  for (let i = 0; i < levels.length; i += 1) {
    if (wide[i] === NO_LAKE) continue;
    levels[i] = wide[i]!;
    heights[i] = ground[i]!;
  }
  return { side: found.side, heights, levels, samples };
}
