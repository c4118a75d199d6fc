/**
 * Where the water of each sample runs to: steepest descent on the drawn triangles, then over level ground (twin of
 * `backend/esker/flow/receivers.py`; docs/water.md). All heights are whole numbers, so no rounding turns a river.
 */

/** The receiver of the border and of the sea: water leaves there. */
export const OUT = -1;
/** What a drop towards one of the four samples beside counts, and along a diagonal: 181 / 256 is 1 / √2. */
const STRAIGHT = 256;
const DIAGONAL = 181;

/** A grid of whole heights, row 0 south. */
export interface WholeGrid {
  readonly rows: number;
  readonly cols: number;
  readonly z: Int32Array;
}

/** The steps of the edges that the mesh draws: E W N S SE NW. */
export function meshSteps(cols: number): readonly number[] {
  return [1, -1, cols, -cols, 1 - cols, cols - 1];
}

/** The receiver of each sample: OUT, an index, or the sample itself where no way leads down. */
export function steepest({ rows, cols, z }: WholeGrid, sea: number): Int32Array {
  const receiver = new Int32Array(z.length).fill(OUT);
  for (let r = 1; r < rows - 1; r += 1) {
    for (let i = r * cols + 1; i < r * cols + cols - 1; i += 1) {
      const own = z[i]!;
      if (own > sea) receiver[i] = lowest(z, i, own, cols);
    }
  }
  return receiver;
}

/** The steepest way down; where several are, it is the first in the order E W N S SE NW NE SW. */
function lowest(z: Int32Array, i: number, own: number, cols: number): number {
  let best = 0;
  let at = i;
  const way = (j: number, weight: number): void => {
    const drop = (own - z[j]!) * weight;
    if (drop <= best) return;
    best = drop;
    at = j;
  };
  way(i + 1, STRAIGHT);
  way(i - 1, STRAIGHT);
  way(i + cols, STRAIGHT);
  way(i - cols, STRAIGHT);
  way(i - cols + 1, DIAGONAL);
  way(i + cols - 1, DIAGONAL);
  // These two cross the middle of the drawn diagonal, which must lie lower.
  if (z[i + cols]! + z[i + 1]! < 2 * own) way(i + cols + 1, DIAGONAL);
  if (z[i - cols]! + z[i - 1]! < 2 * own) way(i - cols - 1, DIAGONAL);
  return at;
}

/** Leads level ground to its outlet, breadth first; what has none, to its sample of the lowest index: its pit. */
export function acrossFlats({ rows, cols, z }: WholeGrid, receiver: Int32Array): void {
  const queue = new Int32Array(z.length);
  const steps = meshSteps(cols);
  let tail = 0;
  for (let r = 1; r < rows - 1; r += 1) {
    for (let i = r * cols + 1; i < r * cols + cols - 1; i += 1) {
      if (receiver[i] !== i) continue;
      for (const step of steps) {
        const j = i + step;
        // An outlet is found before any ground is led to it, so it is marked, and led below.
        if (z[j] !== z[i] || receiver[j] === j || receiver[j]! < OUT) continue;
        receiver[i] = OUT - 1 - j;
        queue[tail++] = i;
        break;
      }
    }
  }
  for (let t = 0; t < tail; t += 1) receiver[queue[t]!] = OUT - 1 - receiver[queue[t]!]!;
  spread(z, receiver, queue, tail, steps, -1);
  for (let pit = 0; pit < z.length; pit += 1) {
    if (receiver[pit] !== pit) continue;
    queue[0] = pit;
    spread(z, receiver, queue, 1, steps, pit);
  }
}

/** Leads the level ground around what is queued to it. */
function spread(
  z: Int32Array,
  receiver: Int32Array,
  queue: Int32Array,
  queued: number,
  steps: readonly number[],
  pit: number,
): void {
  let tail = queued;
  for (let head = 0; head < tail; head += 1) {
    const i = queue[head]!;
    for (const step of steps) {
      const j = i + step;
      if (receiver[j] !== j || j === pit || z[j] !== z[i]) continue;
      receiver[j] = i;
      queue[tail++] = j;
    }
  }
}
