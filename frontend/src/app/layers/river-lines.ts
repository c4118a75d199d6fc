/** Rivers as lines on the ground, wider where more water runs (DESIGN 21, docs/water.md). Pure apart from a cache. */

import type { FootprintVisual, Ground, Rgba, RiverLine, RiverSet } from "../../core/types.ts";
import { TILE_CELLS } from "../../generated/contract.ts";
import { drape } from "../../input/picking.ts";

/** Water under an open sky. */
const WATER: Rgba = [0.2, 0.42, 0.58, 0.92];
/** A line follows the ground in steps of this share of the domain. */
const STEP = 1 / 512;
/** Bankfull width of a river by the area that drains through it (Bieger et al. 2015): metres, km². */
const WIDTH_M = 2.7;
const WIDTH_POWER = 0.352;
/** Half the width on the screen: never thinner than a pixel and a half, wider by the logarithm of the water. */
const LEAST_HALF_PX = 0.75;
const MORE_PX = 0.3;
const MOST_HALF_PX = 2.4;

/** The line of one river on one ground. */
const lines = new WeakMap<RiverLine, { readonly ground: Ground; readonly line: FootprintVisual }>();

/** All rivers of a set as lines on the ground; `wetness`: times the water of their areas. */
export function riverLines(set: RiverSet, wetness: number, ground: Ground): FootprintVisual[] {
  const cellM = ground.sizeM / (TILE_CELLS << set.level);
  return set.rivers.map((river, k) => {
    const known = lines.get(river);
    const halfWidthPx = halfWidth(river, wetness);
    if (known?.ground === ground && known.line.halfWidthPx === halfWidthPx) return known.line;
    const flat = new Float64Array((3 * river.cells.length) / 2);
    for (let i = 0; 2 * i < river.cells.length; i++) {
      flat[3 * i] = cellM * river.cells[2 * i]!;
      flat[3 * i + 1] = cellM * river.cells[2 * i + 1]!;
    }
    const points = new Float32Array(drape(flat, ground.sizeM * STEP, (x, y) => ground.heightAt(x, y)));
    const line = { id: `river-${k}`, points, colour: WATER, strong: false, halfWidthPx };
    lines.set(river, { ground, line });
    return line;
  });
}

function halfWidth({ areasM2: [head, end] }: RiverLine, wetness: number): number {
  const widthM = WIDTH_M * ((wetness * Math.sqrt(head * end)) / 1e6) ** WIDTH_POWER;
  return Math.min(MOST_HALF_PX, LEAST_HALF_PX + MORE_PX * Math.max(0, Math.log2(widthM)));
}
