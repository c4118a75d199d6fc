/** A ray through the cells of one sub-patch, met exactly with the bilinear surface of each cell. */

import { PATCH_CELLS, TILE_SAMPLES } from "../generated/contract.ts";

/** A ray under way. `above`: it was above the surface at the last point looked at. */
export interface March {
  readonly ox: number;
  readonly oy: number;
  readonly oz: number;
  readonly dx: number;
  readonly dy: number;
  readonly dz: number;
  above: boolean;
}

/**
 * Ray parameter of the first crossing inside a 16x16-cell patch over [from, to], or null.
 *
 * `origin` is the index in `heights` of the patch's south-west sample, which lies at (x0, y0); `cell` is the spacing.
 */
export function marchPatch(
  heights: Float32Array,
  origin: number,
  x0: number,
  y0: number,
  cell: number,
  march: March,
  from: number,
  to: number,
): number | null {
  const u = (march.ox - x0) / cell;
  const v = (march.oy - y0) / cell;
  const du = march.dx / cell;
  const dv = march.dy / cell;
  const last = PATCH_CELLS - 1;
  let col = startCell(u + from * du, du, last);
  let row = startCell(v + from * dv, dv, last);
  let t = from;
  for (;;) {
    const nextCol = du === 0 ? Number.POSITIVE_INFINITY : (col + (du > 0 ? 1 : 0) - u) / du;
    const nextRow = dv === 0 ? Number.POSITIVE_INFINITY : (row + (dv > 0 ? 1 : 0) - v) / dv;
    const end = Math.max(t, Math.min(nextCol, nextRow, to));
    const hit = meetCell(heights, origin + row * TILE_SAMPLES + col, u - col, v - row, du, dv, march, t, end);
    if (hit !== null) return hit;
    if (end >= to) return null;
    if (nextCol <= nextRow) col += du > 0 ? 1 : -1;
    else row += dv > 0 ? 1 : -1;
    if (col < 0 || row < 0 || col > last || row > last) return null;
    t = end;
  }
}

/** The cell that a coordinate lies in; on a cell boundary, the one that the ray is about to enter. */
function startCell(at: number, step: number, last: number): number {
  const cell = step < 0 ? Math.ceil(at) - 1 : Math.floor(at);
  return Math.min(Math.max(cell, 0), last);
}

/**
 * Solves `ray height = bilinear height` over [from, to] in one cell. With x and y linear in t the difference is a
 * quadratic, a t^2 + b t + c, so the answer is exact. (u, v) is the ray's origin in cells from the cell's corner.
 */
function meetCell(
  heights: Float32Array,
  at: number,
  u: number,
  v: number,
  du: number,
  dv: number,
  march: March,
  from: number,
  to: number,
): number | null {
  const h00 = heights[at]!;
  const east = heights[at + 1]! - h00;
  const north = heights[at + TILE_SAMPLES]! - h00;
  const twist = heights[at + TILE_SAMPLES + 1]! - h00 - east - north;
  // Taken from the point where the ray enters: parameters from a far eye would cancel.
  const us = u + from * du;
  const vs = v + from * dv;
  const a = -twist * du * dv;
  const b = march.dz - east * du - north * dv - twist * (us * dv + vs * du);
  const c = march.oz + from * march.dz - (h00 + east * us + north * vs + twist * us * vs);
  const above = march.above;
  const length = to - from;
  if (!Number.isFinite(length)) return plumb(c, march, from);
  if (c !== 0 && c > 0 !== above) {
    // The surface itself jumped: two tiles of different levels meet here.
    march.above = c > 0;
    return from;
  }
  const s = firstRoot(a, b, c, length);
  if (s !== null) return from + s;
  march.above = c + (b + a * length) * length >= 0;
  return march.above === above ? null : to;
}

/** A vertical ray never leaves its cell. */
function plumb(c: number, march: March, from: number): number | null {
  if (march.dz === 0) return null;
  const s = -c / march.dz;
  return s >= 0 ? from + s : null;
}

/** Smallest root of a s^2 + b s + c in (0, length] at which the sign changes, or null. */
function firstRoot(a: number, b: number, c: number, length: number): number | null {
  if (c === 0) return 0;
  const disc = b * b - 4 * a * c;
  if (disc < 0) return null;
  const q = -0.5 * (b + (b < 0 ? -1 : 1) * Math.sqrt(disc));
  let best = Number.POSITIVE_INFINITY;
  for (const s of [q === 0 ? Number.NaN : c / q, a === 0 ? Number.NaN : q / a])
    if (s >= 0 && s <= length && s < best) best = s;
  return best === Number.POSITIVE_INFINITY ? null : best;
}
