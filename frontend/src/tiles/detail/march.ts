/** A ray through a square of cells, met exactly with the bilinear surface of each cell. */

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

/** A square of cells in an array of heights. */
export interface Patch {
  readonly heights: Float32Array;
  /** Samples in a row of the array. */
  readonly stride: number;
  /** Index of the south-west sample, which lies at (x0, y0) metres. */
  readonly origin: number;
  readonly x0: number;
  readonly y0: number;
  /** Spacing in metres, and cells on a side. */
  readonly cell: number;
  readonly cells: number;
}

/** Ray parameter of the first crossing inside a patch over [from, to], or null. */
export function marchPatch(patch: Patch, march: March, from: number, to: number): number | null {
  const { heights, stride, origin, x0, y0, cell, cells } = patch;
  const u = (march.ox - x0) / cell;
  const v = (march.oy - y0) / cell;
  const du = march.dx / cell;
  const dv = march.dy / cell;
  const last = cells - 1;
  let col = startCell(u + from * du, du, last);
  let row = startCell(v + from * dv, dv, last);
  let t = from;
  for (;;) {
    const nextCol = du === 0 ? Number.POSITIVE_INFINITY : (col + (du > 0 ? 1 : 0) - u) / du;
    const nextRow = dv === 0 ? Number.POSITIVE_INFINITY : (row + (dv > 0 ? 1 : 0) - v) / dv;
    const end = Math.max(t, Math.min(nextCol, nextRow, to));
    const hit = meetCell(heights, stride, origin + row * stride + col, u - col, v - row, du, dv, march, t, end);
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
  stride: number,
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
  const north = heights[at + stride]! - h00;
  const twist = heights[at + stride + 1]! - h00 - east - north;
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

/** Ray parameters. */
export interface Span {
  from: number;
  to: number;
}

/**
 * Narrows the span to where `origin + t * dir` is in [low, high]; false when nothing is left. A ray along a shared edge
 * belongs to the upper side, as in `heightAt`, unless `last`: the edge is the domain's.
 */
export function clip(span: Span, origin: number, dir: number, low: number, high: number, last: boolean): boolean {
  if (dir === 0) return origin >= low && (origin < high || (last && origin === high));
  const a = (low - origin) / dir;
  const b = (high - origin) / dir;
  span.from = Math.max(span.from, Math.min(a, b));
  span.to = Math.min(span.to, Math.max(a, b));
  return span.from <= span.to;
}

/** Narrows the span to square (x, y) of a grid with `count` squares a side of the domain. */
export function clipSquare(span: Span, m: March, x: number, y: number, count: number, sizeM: number): boolean {
  const low = (i: number) => (sizeM * i) / count;
  return (
    clip(span, m.ox, m.dx, low(x), low(x + 1), x + 1 === count) &&
    clip(span, m.oy, m.dy, low(y), low(y + 1), y + 1 === count)
  );
}

/** True when the ray, known to be above the ground, stays above `top` all the way. */
export function passesOver(march: March, from: number, to: number, top: number): boolean {
  if (!march.above) return false;
  const lowest = march.dz < 0 ? march.oz + to * march.dz : march.oz + from * march.dz;
  return lowest > top;
}
