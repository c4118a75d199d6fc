/** Where a stroke is felt, as the overlay of its influence shows it. Pure. */

import type { ChannelGrid } from "../core/types.ts";
import type { Stroke } from "../generated/contract.ts";
import { worldPoints } from "./strokes.ts";

/** Samples a side: a cell is a 128th of the domain, and the overlay fades over many. */
export const INFLUENCE_SIDE = 129;
/** A line of more points than this is thinned: the overlay is far coarser. */
const MOST_POINTS = 96;
/** An infinite reach counts as so many sides of the domain. It means pure diffusion, which the other strokes end. */
const INFINITE_REACH = 0.25;

/**
 * How strongly a stroke is felt: 1 on its line, falling to a half at the end of its flank on that side (or of its brush), and
 * from there as the solver's springs let it decay, by e for every reach. `reachM` null is infinity.
 */
export function strokeInfluence(stroke: Stroke, reachM: number | null, sizeM: number): ChannelGrid {
  const values = new Float32Array(INFLUENCE_SIDE * INFLUENCE_SIDE);
  const line = thinned(stroke);
  const reach = stroke.paint !== null ? 0 : (reachM ?? INFINITE_REACH * sizeM);
  const extents = bandExtents(stroke);
  for (let row = 0; row < INFLUENCE_SIDE && line.length > 0; row += 1) {
    for (let col = 0; col < INFLUENCE_SIDE; col += 1) {
      const x = (col / (INFLUENCE_SIDE - 1)) * sizeM;
      const y = (row / (INFLUENCE_SIDE - 1)) * sizeM;
      const { away, left } = nearest(line, x, y);
      const extent = left ? extents.left : extents.right;
      values[row * INFLUENCE_SIDE + col] = strength(away, extent, reach);
    }
  }
  return { side: INFLUENCE_SIDE, values };
}

/** Metres from the line to the end of the band on each side, as seen in the direction of travel. */
function bandExtents(stroke: Stroke): { left: number; right: number } {
  if (stroke.paint !== null) return { left: stroke.paint.radius_m, right: stroke.paint.radius_m };
  const plateau = stroke.plateau_radius_m;
  return { left: plateau + (stroke.left?.extent_m ?? 0), right: plateau + (stroke.right?.extent_m ?? 0) };
}

function strength(away: number, extent: number, reach: number): number {
  if (away < extent) return 1 - 0.5 * (away / extent) ** 2;
  return reach > 0 ? 0.5 * Math.exp(-(away - extent) / reach) : 0;
}

/** xy pairs of the line, at most MOST_POINTS, both ends kept. */
function thinned(stroke: Stroke): Float64Array {
  const points = worldPoints(stroke);
  const n = points.length / 3;
  const kept = Math.min(n, MOST_POINTS);
  const out = new Float64Array(2 * kept);
  for (let i = 0; i < kept; i += 1) {
    const from = kept === 1 ? 0 : Math.round((i * (n - 1)) / (kept - 1));
    out[2 * i] = points[3 * from]!;
    out[2 * i + 1] = points[3 * from + 1]!;
  }
  return out;
}

/** Distance to the line, and whether the place lies to its left. */
function nearest(line: Float64Array, x: number, y: number): { away: number; left: boolean } {
  let best = Number.POSITIVE_INFINITY;
  let left = false;
  const last = Math.max(line.length - 2, 2);
  for (let i = 0; i < last; i += 2) {
    const [ax, ay] = [line[i]!, line[i + 1]!];
    const dx = (line[i + 2] ?? ax) - ax;
    const dy = (line[i + 3] ?? ay) - ay;
    const t = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / Math.max(dx * dx + dy * dy, 1e-12)));
    const [ex, ey] = [x - ax - t * dx, y - ay - t * dy];
    const square = ex * ex + ey * ey;
    if (square < best) {
      best = square;
      left = dx * ey - dy * ex > 0;
    }
  }
  return { away: Math.sqrt(best), left };
}
