/** Rivers as lines of the map, wider where more water runs (DESIGN 21, docs/water.md). Pure apart from a cache. */

import type { FootprintVisual, Rgba, RiverLine, RiverSet } from "../../core/types.ts";
import { TILE_CELLS } from "../../generated/contract.ts";

/** Water under an open sky. */
const WATER: Rgba = [0.2, 0.42, 0.58, 0.92];
/** Bankfull width of a river by the area that drains through it (Bieger et al. 2015): metres, km². */
const WIDTH_M = 2.7;
const WIDTH_POWER = 0.352;
/** Half the width on the screen: never thinner than a pixel and a half, wider by the logarithm of the water. */
const LEAST_HALF_PX = 0.75;
const MORE_PX = 0.3;
const MOST_HALF_PX = 2.4;

/** The last line that was made of a river. */
const lines = new WeakMap<RiverLine, FootprintVisual>();

/**
 * All rivers of a set as lines; `wetness`: times the water of their areas. Their height is 0: the map is seen from straight
 * above, and the height of all their points on the ground with its detail is dearer than all else that a map does.
 */
export function riverLines(set: RiverSet, wetness: number, sizeM: number): FootprintVisual[] {
  const cellM = sizeM / (TILE_CELLS << set.level);
  return set.rivers.map((river, k) => {
    const known = lines.get(river);
    const halfWidthPx = halfWidth(river, wetness);
    if (known?.halfWidthPx === halfWidthPx) return known;
    const points = new Float32Array((3 * river.cells.length) / 2);
    for (let i = 0; 2 * i < river.cells.length; i++) {
      points[3 * i] = cellM * river.cells[2 * i]!;
      points[3 * i + 1] = cellM * river.cells[2 * i + 1]!;
    }
    const line = { id: `river-${k}`, points, colour: WATER, strong: false, halfWidthPx };
    lines.set(river, line);
    return line;
  });
}

function halfWidth({ areasM2: [head, end] }: RiverLine, wetness: number): number {
  const widthM = WIDTH_M * ((wetness * Math.sqrt(head * end)) / 1e6) ** WIDTH_POWER;
  return Math.min(MOST_HALF_PX, LEAST_HALF_PX + MORE_PX * Math.max(0, Math.log2(widthM)));
}
