/**
 * What lies inside an outline: its area on the map and along the ground, heights, slope, and volumes between the ground and a level
 * or the ground of another moment. Integrals go cell by cell over samples of the tile grid; cells on the outline count with the part of
 * them that lies inside, which is clipped exactly. On planes all figures are exact but for rounding.
 */

import { msg } from "@lit/localize";
import { areaM2, crossesItself, type Impossible, lengthM, type Place } from "./places.ts";
import { NO_HEIGHT, NO_PLACE } from "./profile.ts";

type HeightAt = (x: number, y: number) => number;

export interface AreaFigures {
  readonly areaM2: number;
  readonly perimeterM: number;
  /** Along the ground. */
  readonly surfaceM2: number;
  readonly minM: number;
  readonly maxM: number;
  readonly meanM: number;
  /** Rise over run, the mean over the area. */
  readonly meanSlope: number;
  /** Between ground and level: of ground above it, and of room below it, both positive. */
  readonly aboveM3: number;
  readonly belowM3: number;
  /** Since the other moment: what was heaped up and what was dug out; null without one. */
  readonly risenM3: number | null;
  readonly sunkenM3: number | null;
  /** Width of the cells that were summed, metres. */
  readonly cellM: number;
}

export interface AreaQuestion {
  readonly levelM: number;
  /** The ground of another moment. */
  readonly before?: HeightAt | null;
  readonly sizeM: number;
  /** Cells of the finest level along the domain, a power of two. */
  readonly finestCells: number;
}

const MOST_CELLS = 256;
/** A cell in which a surface changes sides is summed by so many parts a side. */
const PARTS = 6;

export const TWO_POINTS = msg("An area needs three points. Click on the land once more, or draw its outline.");
export const CROSSES = msg("This outline crosses itself. Move a point so that it does not.");
export const NO_AREA = msg("This outline encloses nothing. Move a point.");

/** The figures of an area, or why there are none. */
export function measureArea(
  ring: readonly Place[],
  heightAt: HeightAt,
  question: AreaQuestion,
): AreaFigures | Impossible {
  if (ring.some((p) => !p.every(Number.isFinite)) || !Number.isFinite(question.levelM)) return { problem: NO_PLACE };
  if (ring.length < 3) return { problem: TWO_POINTS };
  if (crossesItself(ring)) return { problem: CROSSES };
  const area = areaM2(ring);
  if (!(area > 0)) return { problem: NO_AREA };
  const cells = cellsFor(ring, question);
  const sums = new Sums(cells.cellM, heightAt, question);
  for (const piece of piecesOf(ring, cells)) sums.add(piece);
  if (!sums.finite) return { problem: NO_HEIGHT };
  return { areaM2: area, perimeterM: lengthM([...ring, ring[0]!]), cellM: cells.cellM, ...sums.figures() };
}

interface Cells {
  readonly cellM: number;
  readonly col0: number;
  readonly row0: number;
  readonly cols: number;
  readonly rows: number;
}

/** The finest cells of the tile grid of which an outline spans no more than MOST_CELLS. */
function cellsFor(ring: readonly Place[], { sizeM, finestCells }: AreaQuestion): Cells {
  const xs = ring.map((p) => p[0]);
  const ys = ring.map((p) => p[1]);
  const span = Math.max(Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys));
  let cellM = sizeM / finestCells;
  while (span / cellM > MOST_CELLS) cellM *= 2;
  // An outline smaller than a few cells is summed by finer ones: the surface between samples is bilinear.
  while (span / cellM < 16) cellM /= 2;
  const [col0, row0] = [Math.floor(Math.min(...xs) / cellM), Math.floor(Math.min(...ys) / cellM)];
  const cols = Math.floor(Math.max(...xs) / cellM) - col0 + 1;
  const rows = Math.floor(Math.max(...ys) / cellM) - row0 + 1;
  return { cellM, col0, row0, cols, rows };
}

/** A cell, or the part of one that lies inside: its area and its centre of mass. `whole`: all of it. */
interface Piece {
  readonly col: number;
  readonly row: number;
  readonly whole: boolean;
  readonly area: number;
  readonly x: number;
  readonly y: number;
}

function* piecesOf(ring: readonly Place[], cells: Cells): Iterable<Piece> {
  const { cellM, col0, row0, cols, rows } = cells;
  const onEdge = edgeCells(ring, cells);
  for (let r = 0; r < rows; r++) {
    const crossings = crossingsOf(ring, (row0 + r + 0.5) * cellM);
    for (let c = 0; c < cols; c++) {
      const [col, row] = [col0 + c, row0 + r];
      if (onEdge[r * cols + c] === 1) {
        const piece = clipped(ring, col * cellM, row * cellM, cellM);
        if (piece !== null) yield { col, row, whole: false, ...piece };
        continue;
      }
      const x = (col + 0.5) * cellM;
      if (crossings.filter((at) => at < x).length % 2 === 1)
        yield { col, row, whole: true, area: cellM * cellM, x, y: (row + 0.5) * cellM };
    }
  }
}

/** 1 for the cells that a side of the outline passes or touches. */
function edgeCells(ring: readonly Place[], { cellM, col0, row0, cols, rows }: Cells): Uint8Array {
  const out = new Uint8Array(cols * rows);
  ring.forEach(([ax, ay], i) => {
    const [bx, by] = ring[(i + 1) % ring.length]!;
    const [low, high] = [Math.min(ay, by), Math.max(ay, by)];
    for (let r = Math.floor(low / cellM) - row0; r <= Math.floor(high / cellM) - row0; r++) {
      const [y0, y1] = [Math.max(low, (row0 + r) * cellM), Math.min(high, (row0 + r + 1) * cellM)];
      const at = (y: number): number => (ay === by ? ax : ax + ((y - ay) / (by - ay)) * (bx - ax));
      const ends = ay === by ? [ax, bx] : [at(y0), at(y1)];
      const from = Math.floor(Math.min(...ends) / cellM - 1e-9) - col0;
      const to = Math.floor(Math.max(...ends) / cellM + 1e-9) - col0;
      for (let c = Math.max(0, from); c <= Math.min(cols - 1, to); c++) if (r >= 0 && r < rows) out[r * cols + c] = 1;
    }
  });
  return out;
}

/** Where a horizontal line crosses an outline. */
function crossingsOf(ring: readonly Place[], y: number): number[] {
  return ring.flatMap(([ax, ay], i) => {
    const [bx, by] = ring[(i + 1) % ring.length]!;
    return ay > y === by > y ? [] : [ax + ((y - ay) / (by - ay)) * (bx - ax)];
  });
}

/** The part of an outline inside of a square (Sutherland and Hodgman 1974): area and centre; null for none. */
function clipped(
  ring: readonly Place[],
  x0: number,
  y0: number,
  side: number,
): Omit<Piece, "col" | "row" | "whole"> | null {
  let points: readonly Place[] = ring;
  for (const [axis, bound, sign] of [
    [0, x0, 1],
    [0, x0 + side, -1],
    [1, y0, 1],
    [1, y0 + side, -1],
  ] as const) {
    const inside = (p: Place): number => sign * (p[axis] - bound);
    points = points.flatMap((p, i) => {
      const q = points[(i + 1) % points.length]!;
      const [a, b] = [inside(p), inside(q)];
      const t = a / (a - b);
      const met: Place[] = a >= 0 === b >= 0 ? [] : [[p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]];
      return a >= 0 ? [p, ...met] : met;
    });
    if (points.length === 0) return null;
  }
  let [twice, mx, my] = [0, 0, 0];
  for (let i = 0; i < points.length; i++) {
    const [ax, ay] = [points[i]![0] - x0, points[i]![1] - y0];
    const q = points[(i + 1) % points.length]!;
    const [bx, by] = [q[0] - x0, q[1] - y0];
    const cross = ax * by - bx * ay;
    twice += cross;
    mx += (ax + bx) * cross;
    my += (ay + by) * cross;
  }
  if (Math.abs(twice) < 1e-12 * side * side) return null;
  return { area: Math.abs(twice) / 2, x: x0 + mx / (3 * twice), y: y0 + my / (3 * twice) };
}

class Sums {
  readonly #cellM: number;
  readonly #heightAt: HeightAt;
  readonly #q: AreaQuestion;
  /** Heights of samples, those of now and of before: neighbours share them. */
  readonly #now = new Map<number, number>();
  readonly #before = new Map<number, number>();
  #area = 0;
  #surface = 0;
  #height = 0;
  #slope = 0;
  #low = Number.POSITIVE_INFINITY;
  #high = Number.NEGATIVE_INFINITY;
  #above = 0;
  #below = 0;
  #risen = 0;
  #sunken = 0;

  constructor(cellM: number, heightAt: HeightAt, question: AreaQuestion) {
    this.#cellM = cellM;
    this.#heightAt = heightAt;
    this.#q = question;
  }

  get finite(): boolean {
    return this.#area > 0 && Number.isFinite(this.#height) && Number.isFinite(this.#risen + this.#sunken);
  }

  add(piece: Piece): void {
    const now = this.#corners(this.#now, this.#heightAt, piece);
    const u = piece.x / this.#cellM - piece.col;
    const v = piece.y / this.#cellM - piece.row;
    const [a, b, c, d] = now;
    const gx = ((b - a) * (1 - v) + (d - c) * v) / this.#cellM;
    const gy = ((c - a) * (1 - u) + (d - b) * u) / this.#cellM;
    const slope = Math.hypot(gx, gy);
    const z = bilinear(now, u, v);
    this.#area += piece.area;
    this.#height += piece.area * z;
    this.#surface += piece.area * Math.hypot(1, slope);
    this.#slope += piece.area * slope;
    this.#low = Math.min(this.#low, z);
    this.#high = Math.max(this.#high, z);
    const level = this.#q.levelM;
    const [above, below] = parted([a - level, b - level, c - level, d - level], piece, u, v);
    this.#above += above;
    this.#below += below;
    if (!this.#q.before) return;
    const before = this.#corners(this.#before, this.#q.before, piece);
    const [risen, sunken] = parted([a - before[0], b - before[1], c - before[2], d - before[3]], piece, u, v);
    this.#risen += risen;
    this.#sunken += sunken;
  }

  figures(): Omit<AreaFigures, "areaM2" | "perimeterM" | "cellM"> {
    const compared = Boolean(this.#q.before);
    return {
      surfaceM2: this.#surface,
      minM: this.#low,
      maxM: this.#high,
      meanM: this.#height / this.#area,
      meanSlope: this.#slope / this.#area,
      aboveM3: this.#above,
      belowM3: this.#below,
      risenM3: compared ? this.#risen : null,
      sunkenM3: compared ? this.#sunken : null,
    };
  }

  #corners(known: Map<number, number>, heightAt: HeightAt, { col, row }: Piece): Corners {
    const at = (c: number, r: number): number => {
      const key = r * 0x4000000 + c;
      let z = known.get(key);
      if (z === undefined) {
        z = heightAt(c * this.#cellM, r * this.#cellM);
        known.set(key, z);
      }
      return z;
    };
    return [at(col, row), at(col + 1, row), at(col, row + 1), at(col + 1, row + 1)];
  }
}

/** South-west, south-east, north-west, north-east. */
type Corners = readonly [number, number, number, number];

function bilinear([a, b, c, d]: Corners, u: number, v: number): number {
  return (a * (1 - u) + b * u) * (1 - v) + (c * (1 - u) + d * u) * v;
}

/** The integral of a bilinear surface over a piece, its positive and its negative part. */
function parted(corners: Corners, piece: Piece, u: number, v: number): readonly [number, number] {
  const mixed = Math.min(...corners) < 0 && Math.max(...corners) > 0;
  if (!mixed || !piece.whole) {
    const sum = piece.area * bilinear(corners, u, v);
    return sum >= 0 ? [sum, 0] : [0, -sum];
  }
  let [above, below] = [0, 0];
  for (let i = 0; i < PARTS; i++)
    for (let j = 0; j < PARTS; j++) {
      const z = bilinear(corners, (i + 0.5) / PARTS, (j + 0.5) / PARTS);
      if (z > 0) above += z;
      else below -= z;
    }
  const part = piece.area / (PARTS * PARTS);
  return [above * part, below * part];
}
