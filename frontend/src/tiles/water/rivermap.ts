/**
 * Rivers as shaders read them (shaders/wgsl/rivers.wgsl): for each cell of a lattice over the domain the pieces of rivers that reach
 * into it, all in the texels of one texture (twin of `backend/esker/render/rivers.py`).
 */

import type { RiverLine, RiverMap } from "../../core/types.ts";
import { TILE_CELLS } from "../../generated/contract.ts";

/** Cells of the lattice along a side, and texels in a row: RIVER_CELLS and RIVER_COLUMNS of rivers.wgsl. */
export const RIVER_CELLS = 128;
export const RIVER_COLUMNS = 256;
const TEXEL = 4;
/** Bankfull width of a river by the area that drains through it (Bieger et al. 2015): metres, km². */
const WIDTH_M = 2.7;
const WIDTH_POWER = 0.352;
/** Banks reach so far beyond the water: metres, and widths. Half a cell more has the rivers that are drawn wider than they are. */
const BANK_M = 4;
const BANK_WIDTHS = 3;
/** Pieces that one cell holds at most, and all cells together. */
const MOST_IN_CELL = 96;
export const MOST_PIECES = 40_000;

/** A river of one level that is shown so far, 0..1. */
export interface ShownRiver {
  readonly line: RiverLine;
  readonly level: number;
  readonly share: number;
}

/** Half the width of a river, metres. */
export function halfWidthM(areaM2: number, wetness: number): number {
  return 0.5 * WIDTH_M * ((wetness * areaM2) / 1e6) ** WIDTH_POWER;
}

/** The map of rivers; null without any. */
export function riverMap(rivers: readonly ShownRiver[], sizeM: number, wetness: number): RiverMap | null {
  const cells: number[][] = Array.from({ length: RIVER_CELLS * RIVER_CELLS }, () => []);
  let pieces = 0;
  for (const river of rivers) {
    if (river.share <= 0) continue;
    for (const piece of piecesOf(river, sizeM, wetness)) {
      for (const cell of cellsOf(piece, sizeM)) {
        const list = cells[cell]!;
        if (list.length >= 2 * TEXEL * MOST_IN_CELL || pieces >= MOST_PIECES) continue;
        list.push(...piece);
        pieces += 1;
      }
    }
  }
  if (pieces === 0) return null;
  const first = cells.length;
  const rows = Math.ceil((first + 2 * pieces) / RIVER_COLUMNS);
  const texels = new Float32Array(TEXEL * rows * RIVER_COLUMNS);
  let at = first;
  cells.forEach((list, k) => {
    texels[TEXEL * k] = at;
    texels[TEXEL * k + 1] = list.length / (2 * TEXEL);
    texels.set(list, TEXEL * at);
    at += list.length / TEXEL;
  });
  return { texels, rows };
}

/** Eight numbers each: both ends in metres; half the width at both, metres down the river, share. */
function piecesOf({ line, level, share }: ShownRiver, sizeM: number, wetness: number): number[][] {
  const cellM = sizeM / (TILE_CELLS << level);
  const points = rounded(line.cells);
  const n = points.length / 2;
  const along = new Float64Array(n);
  for (let i = 1; i < n; i += 1)
    along[i] =
      along[i - 1]! + cellM * Math.hypot(points[2 * i]! - points[2 * i - 2]!, points[2 * i + 1]! - points[2 * i - 1]!);
  const length = Math.max(along[n - 1]!, 1e-6);
  const [head, end] = line.areasM2.map(Math.log) as [number, number];
  const half = (i: number): number => halfWidthM(Math.exp(head + ((end - head) * along[i]!) / length), wetness);
  const out = [];
  for (let i = 1; i < n; i += 1) {
    const [ax, ay, bx, by] = [points[2 * i - 2]!, points[2 * i - 1]!, points[2 * i]!, points[2 * i + 1]!];
    out.push([cellM * ax, cellM * ay, cellM * bx, cellM * by, half(i - 1), half(i), along[i - 1]!, share]);
  }
  return out;
}

/** Corners cut once (Chaikin 1974), ends kept. */
function rounded(cells: Float32Array): Float64Array {
  const n = cells.length / 2;
  if (n < 3) return Float64Array.from(cells);
  const out = [cells[0]!, cells[1]!];
  for (let i = 1; i + 1 < n; i += 1)
    for (const beside of [i - 1, i + 1])
      for (const axis of [0, 1]) out.push(0.25 * cells[2 * beside + axis]! + 0.75 * cells[2 * i + axis]!);
  out.push(cells[2 * n - 2]!, cells[2 * n - 1]!);
  return Float64Array.from(out);
}

/** The cells of the lattice that a piece with its banks may reach. */
function cellsOf([ax, ay, bx, by, ha, hb]: readonly number[], sizeM: number): number[] {
  const cellM = sizeM / RIVER_CELLS;
  const half = Math.max(ha!, hb!);
  const reach = half + BANK_M + 2 * BANK_WIDTHS * half + 0.25 * cellM;
  const at = (v: number): number => Math.min(RIVER_CELLS - 1, Math.max(0, Math.floor(v / cellM)));
  const out = [];
  for (let y = at(Math.min(ay!, by!) - reach); y <= at(Math.max(ay!, by!) + reach); y += 1)
    for (let x = at(Math.min(ax!, bx!) - reach); x <= at(Math.max(ax!, bx!) + reach); x += 1)
      if (isNear([ax!, ay!, bx!, by!], (x + 0.5) * cellM, (y + 0.5) * cellM, reach + Math.SQRT1_2 * cellM))
        out.push(y * RIVER_CELLS + x);
  return out;
}

function isNear(
  [ax, ay, bx, by]: readonly [number, number, number, number],
  x: number,
  y: number,
  reach: number,
): boolean {
  const [dx, dy] = [bx - ax, by - ay];
  const t = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / Math.max(dx * dx + dy * dy, 1e-12)));
  return Math.hypot(x - ax - t * dx, y - ay - t * dy) <= reach;
}
