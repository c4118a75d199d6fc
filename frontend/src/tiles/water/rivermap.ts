/**
 * Rivers as shaders read them (shaders/wgsl/water/rivers.wgsl): for each cell of lattices over the domain the pieces of rivers that reach
 * into it, all in the texels of one texture (twin of `backend/esker/render/rivers.py`). Coarser lattices are for what is far away:
 * their pieces are longer, and reach further beyond their banks.
 */

import type { RiverLine, RiverMap } from "../../core/types.ts";
import { TILE_CELLS } from "../../generated/contract.ts";

/** Cells of the finest lattice along a side, each further one has half as many; and texels in a row: as in water/rivers.wgsl. */
export const RIVER_CELLS = 128;
export const RIVER_LATTICES = 5;
export const RIVER_COLUMNS = 256;
const TEXEL = 4;
/** Bankfull width of a river by the area that drains through it (Bieger et al. 2015): metres, km². */
const WIDTH_M = 2.7;
const WIDTH_POWER = 0.352;
/** Banks reach so far beyond the water: metres, and widths. So many cells more have the rivers that are drawn wider than they are. */
const BANK_M = 4;
const BANK_WIDTHS = 3;
const REACH_CELLS = 0.25;
/** Pieces of all lattices but the finest are at least so many cells long. */
const LEAST_CELLS = 1 / 12;
/** Pieces that one cell holds at most, and all cells of the finest lattice together; each further one has half as many. */
const MOST_IN_CELL = 96;
const MOST_PIECES = 40_000;
const ALL_CELLS = Array.from({ length: RIVER_LATTICES }, (_, k) => (RIVER_CELLS >> k) ** 2).reduce((sum, n) => sum + n);

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
  const shown = rivers.filter((river) => river.share > 0).map((river) => placed(river, sizeM, wetness));
  const counts = new Int32Array(ALL_CELLS);
  let pieces = 0;
  eachPiece(shown, counts, () => {
    pieces += 1;
  });
  if (pieces === 0) return null;
  const rows = Math.ceil((ALL_CELLS + 2 * pieces) / RIVER_COLUMNS);
  const texels = new Float32Array(TEXEL * rows * RIVER_COLUMNS);
  let at = ALL_CELLS;
  counts.forEach((count, k) => {
    texels[TEXEL * k] = at;
    texels[TEXEL * k + 1] = count;
    at += 2 * count;
  });
  eachPiece(shown, new Int32Array(ALL_CELLS), (piece, share, cell, k) => {
    const to = TEXEL * (texels[TEXEL * cell]! + 2 * k);
    texels.set(piece, to);
    texels[to + piece.length] = share;
  });
  return { texels, rows };
}

/** Calls `take` for each piece in each cell that has room for it, with how many that cell has already; `counts` begins with zeros. */
function eachPiece(
  rivers: readonly Placed[],
  counts: Int32Array,
  take: (piece: Piece, share: number, cell: number, k: number) => void,
): void {
  let first = 0;
  for (let lattice = 0; lattice < RIVER_LATTICES; lattice += 1) {
    let left = MOST_PIECES >> lattice;
    for (const { lattices, share } of rivers) {
      for (const [piece, cells] of lattices[lattice]!) {
        for (const cell of cells) {
          const k = counts[first + cell]!;
          if (k === MOST_IN_CELL || left === 0) continue;
          take(piece, share, first + cell, k);
          counts[first + cell] = k + 1;
          left -= 1;
        }
      }
    }
    first += (RIVER_CELLS >> lattice) ** 2;
  }
}

/** Both ends in metres; half the width at both, metres down the river. */
type Piece = readonly [number, number, number, number, number, number, number];

/** A river's pieces in each lattice, with the cells that they reach; and how far it is shown. */
interface Placed {
  readonly lattices: readonly (readonly (readonly [Piece, readonly number[]])[])[];
  readonly share: number;
}

/** Where rivers lie, by their line: while one fades only its share changes. */
const places = new WeakMap<RiverLine, { readonly key: string; readonly lattices: Placed["lattices"] }>();

function placed(river: ShownRiver, sizeM: number, wetness: number): Placed {
  const key = `${river.level} ${sizeM} ${wetness}`;
  let found = places.get(river.line);
  if (found?.key !== key) {
    const line = lineOf(river, sizeM, wetness);
    const lattices = Array.from({ length: RIVER_LATTICES }, (_, k) => {
      const side = RIVER_CELLS >> k;
      const cellM = sizeM / side;
      const pieces = piecesOf(line, k === 0 ? 0 : LEAST_CELLS * cellM);
      return pieces.map((piece) => [piece, cellsOf(piece, side, cellM)] as const);
    });
    found = { key, lattices };
    places.set(river.line, found);
  }
  return { lattices: found.lattices, share: river.share };
}

/** A river as it is drawn: its points, metres; metres down the river and half the width at each. */
interface Line {
  readonly points: Float64Array;
  readonly along: Float64Array;
  readonly half: Float64Array;
}

function lineOf({ line, level }: ShownRiver, sizeM: number, wetness: number): Line {
  const cellM = sizeM / (TILE_CELLS << level);
  const points = rounded(line.cells).map((v) => cellM * v);
  const n = points.length / 2;
  const along = new Float64Array(n);
  for (let i = 1; i < n; i += 1)
    along[i] = along[i - 1]! + Math.hypot(points[2 * i]! - points[2 * i - 2]!, points[2 * i + 1]! - points[2 * i - 1]!);
  const length = Math.max(along[n - 1]!, 1e-6);
  const [head, end] = line.areasM2.map(Math.log) as [number, number];
  const half = along.map((at) => halfWidthM(Math.exp(head + ((end - head) * at) / length), wetness));
  return { points, along, half };
}

/** Points nearer than `leastM` to the one before are left out, but for the last. */
function piecesOf({ points, along, half }: Line, leastM: number): Piece[] {
  const out: Piece[] = [];
  const n = along.length;
  let a = 0;
  for (let b = 1; b < n; b += 1) {
    const [ax, ay, bx, by] = [points[2 * a]!, points[2 * a + 1]!, points[2 * b]!, points[2 * b + 1]!];
    if (b < n - 1 && Math.hypot(bx - ax, by - ay) < leastM) continue;
    out.push([ax, ay, bx, by, half[a]!, half[b]!, along[a]!]);
    a = b;
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

/** The cells of a lattice of `side` times `side` that a piece with its banks may reach. */
function cellsOf([ax, ay, bx, by, ha, hb]: Piece, side: number, cellM: number): number[] {
  const half = Math.max(ha, hb);
  const reach = half + BANK_M + 2 * BANK_WIDTHS * half + REACH_CELLS * cellM;
  const at = (v: number): number => Math.min(side - 1, Math.max(0, Math.floor(v / cellM)));
  const out = [];
  for (let y = at(Math.min(ay, by) - reach); y <= at(Math.max(ay, by) + reach); y += 1)
    for (let x = at(Math.min(ax, bx) - reach); x <= at(Math.max(ax, bx) + reach); x += 1)
      if (isNear([ax, ay, bx, by], (x + 0.5) * cellM, (y + 0.5) * cellM, reach + Math.SQRT1_2 * cellM))
        out.push(y * side + x);
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
