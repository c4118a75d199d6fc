/** Contours of a square of heights as lines on the map. Pure. */

import type { Heights } from "./difference.ts";

export interface ContourLine {
  readonly levelM: number;
  /** xy pairs, metres; the last point is the first again where the line is closed. */
  readonly points: Float64Array;
}

/** The most levels that are drawn: the interval is made larger where there would be more. */
export const MOST_LEVELS = 60;

/** The contours at multiples of `everyM`. */
export function contourLines(heights: Heights, sizeM: number, everyM: number): ContourLine[] {
  const { data } = heights;
  const low = data.reduce((a, b) => Math.min(a, b), Number.POSITIVE_INFINITY);
  const high = data.reduce((a, b) => Math.max(a, b), Number.NEGATIVE_INFINITY);
  const every = everyM * Math.max(1, Math.ceil((high - low) / (everyM * MOST_LEVELS)));
  const out: ContourLine[] = [];
  for (let k = Math.ceil(low / every); k * every < high; k += 1) out.push(...linesAt(heights, sizeM, k * every));
  return out;
}

/** The edges to which a line goes on from each crossed edge of the lattice: one or two. */
type Crossings = Map<number, number[]>;

function linesAt(heights: Heights, sizeM: number, level: number): ContourLine[] {
  const next = crossings(heights, level);
  const out: ContourLine[] = [];
  const walk = (from: number): void => {
    const edges = [from];
    for (let at: number | undefined = from; at !== undefined; ) {
      const to: number | undefined = next.get(at)?.shift();
      if (to === undefined) break;
      const back = next.get(to)!;
      back.splice(back.indexOf(at), 1);
      edges.push(to);
      at = to;
    }
    if (edges.length > 1) out.push({ levelM: level, points: placed(heights, sizeM, level, edges) });
  };
  // Lines that end at the border begin there; what is left is closed.
  for (const [edge, to] of next) if (to.length === 1) walk(edge);
  for (const edge of next.keys()) while (next.get(edge)!.length > 0) walk(edge);
  return out;
}

/** Edge 2 i goes east from sample i, edge 2 i + 1 north. */
function crossings({ side, data }: Heights, level: number): Crossings {
  const next: Crossings = new Map();
  const join = (a: number, b: number): void => {
    for (const [from, to] of [
      [a, b],
      [b, a],
    ] as const) {
      const known = next.get(from);
      if (known === undefined) next.set(from, [to]);
      else known.push(to);
    }
  };
  for (let row = 0; row + 1 < side; row += 1)
    for (let col = 0; col + 1 < side; col += 1) {
      const i = row * side + col;
      const [sw, se, ne, nw] = [i, i + 1, i + side + 1, i + side].map((k) => data[k]! >= level);
      const [south, east, north, west] = [2 * i, 2 * (i + 1) + 1, 2 * (i + side), 2 * i + 1];
      const cut: number[] = [];
      if (sw !== se) cut.push(south);
      if (se !== ne) cut.push(east);
      if (ne !== nw) cut.push(north);
      if (nw !== sw) cut.push(west);
      if (cut.length === 2) join(cut[0]!, cut[1]!);
      else if (cut.length === 4) {
        const middle = (data[i]! + data[i + 1]! + data[i + side]! + data[i + side + 1]!) / 4 >= level;
        if (middle === sw) {
          join(south, east);
          join(north, west);
        } else {
          join(south, west);
          join(north, east);
        }
      }
    }
  return next;
}

function placed({ side, data }: Heights, sizeM: number, level: number, edges: readonly number[]): Float64Array {
  const cell = sizeM / (side - 1);
  const out = new Float64Array(2 * edges.length);
  edges.forEach((edge, k) => {
    const i = edge >> 1;
    const north = edge % 2 === 1;
    const [a, b] = [data[i]!, data[north ? i + side : i + 1]!];
    const t = (level - a) / (b - a);
    out[2 * k] = ((i % side) + (north ? 0 : t)) * cell;
    out[2 * k + 1] = (Math.floor(i / side) + (north ? t : 0)) * cell;
  });
  return out;
}
