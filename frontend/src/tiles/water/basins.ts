/**
 * Basins: which pit each sample runs to, and how high water rises in it before it runs over (twin of
 * `backend/esker/flow/basins.py`). A flood of the graph of basins stands for one of all samples.
 */

import { meshSteps, OUT, type WholeGrid } from "./receivers.ts";

/** Below every height: where water stands outside. */
export const LOWEST = -(2 ** 40);

/** The lowest way between two basins: its height, and the samples on both sides of it. */
interface Pass {
  readonly low: number;
  readonly high: number;
  height: number;
  /** The sample in basin `low`, and that in basin `high`. */
  inner: number;
  outer: number;
}

/** At which height each basin runs over, and the samples on both sides of the pass over which it does. */
export interface Spill {
  readonly height: Float64Array;
  readonly exitIn: Int32Array;
  readonly exitOut: Int32Array;
}

/** Areas in samples, and an order in which each sample comes after all that run through it (Kahn's). */
export function gather(receiver: Int32Array): { readonly area: Int32Array; readonly order: Int32Array } {
  const n = receiver.length;
  const area = new Int32Array(n).fill(1);
  const coming = new Int8Array(n);
  for (let i = 0; i < n; i += 1) {
    const j = receiver[i]!;
    if (j >= 0 && j !== i) coming[j]! += 1;
  }
  const order = new Int32Array(n);
  let place = 0;
  for (let i = 0; i < n; i += 1) {
    let at = i;
    while (coming[at] === 0) {
      coming[at] = OUT;
      order[place++] = at;
      const j = receiver[at]!;
      if (j < 0 || j === at) break;
      area[j]! += area[at]!;
      coming[j]! -= 1;
      at = j;
    }
  }
  return { area, order };
}

/** The basin of each sample: 0 where water runs out without a lake, else 1, 2, … in the order of the pits; and their pits. */
export function label(
  receiver: Int32Array,
  order: Int32Array,
): { readonly basin: Int32Array; readonly pits: Int32Array } {
  const basin = new Int32Array(receiver.length);
  const pits = [OUT];
  for (let i = 0; i < receiver.length; i += 1) {
    if (receiver[i] !== i) continue;
    basin[i] = pits.length;
    pits.push(i);
  }
  for (let t = order.length - 1; t >= 0; t -= 1) {
    const i = order[t]!;
    const j = receiver[i]!;
    if (j >= 0 && j !== i) basin[i] = basin[j]!;
  }
  return { basin, pits: Int32Array.from(pits) };
}

/** The lowest pass of each pair of basins that touch along an edge of the mesh; of equally low ones that of the lower samples. */
function findPasses({ rows, cols, z }: WholeGrid, basin: Int32Array, count: number): Pass[] {
  const found = new Map<number, Pass>();
  const [east, , north, , , northWest] = meshSteps(cols) as [number, number, number, number, number, number];
  const offer = (i: number, j: number): void => {
    const [a, b] = [basin[i]!, basin[j]!];
    if (a === b) return;
    const [low, high, inner, outer] = a < b ? [a, b, i, j] : [b, a, j, i];
    const height = Math.max(z[i]!, z[j]!);
    const key = low * (count + 1) + high;
    const known = found.get(key);
    if (known === undefined) found.set(key, { low, high, height, inner, outer });
    else if (height < known.height || (height === known.height && isBefore(inner, outer, known)))
      Object.assign(known, { height, inner, outer });
  };
  for (let r = 0; r < rows; r += 1) {
    for (let c = 0; c < cols; c += 1) {
      const i = r * cols + c;
      if (c < cols - 1) offer(i, i + east);
      if (r === rows - 1) continue;
      offer(i, i + north);
      if (c > 0) offer(i, i + northWest);
    }
  }
  return [...found.values()];
}

function isBefore(a: number, b: number, known: Pass): boolean {
  const low = Math.min(known.inner, known.outer);
  const own = Math.min(a, b);
  return own < low || (own === low && Math.max(a, b) < Math.max(known.inner, known.outer));
}

/** Prim's flood from outside over the graph of basins. Of equally high ways the one of the lower samples comes first. */
export function spillOf(grid: WholeGrid, basin: Int32Array, count: number): Spill {
  const passes = findPasses(grid, basin, count);
  const around: Pass[][] = Array.from({ length: count + 1 }, () => []);
  for (const pass of passes) {
    around[pass.low]!.push(pass);
    around[pass.high]!.push(pass);
  }
  const spill = {
    height: new Float64Array(count + 1).fill(LOWEST),
    exitIn: new Int32Array(count + 1),
    exitOut: new Int32Array(count + 1),
  };
  const done = new Uint8Array(count + 1);
  const queue = new Queue<{ readonly b: number; readonly pass: Pass | null }>();
  queue.push([LOWEST, 0, 0, 0], { b: 0, pass: null });
  for (let next = queue.pop(); next !== null; next = queue.pop()) {
    const { b, pass } = next.item;
    if (done[b] === 1) continue;
    done[b] = 1;
    const level = next.key[0]!;
    spill.height[b] = level;
    if (pass !== null) {
      spill.exitIn[b] = pass.low === b ? pass.inner : pass.outer;
      spill.exitOut[b] = pass.low === b ? pass.outer : pass.inner;
    }
    for (const way of around[b]!) {
      const other = way.low === b ? way.high : way.low;
      if (done[other] === 1) continue;
      const ends = [Math.min(way.inner, way.outer), Math.max(way.inner, way.outer)] as const;
      queue.push([Math.max(level, way.height), ...ends, other], { b: other, pass: way });
    }
  }
  return spill;
}

/** Turns round the way from each basin's exit to its pit, so that its water runs over. */
export function turnRound(receiver: Int32Array, { exitIn, exitOut }: Spill): void {
  for (let b = 1; b < exitIn.length; b += 1) {
    let at = exitIn[b]!;
    let next = exitOut[b]!;
    for (;;) {
      const old = receiver[at]!;
      receiver[at] = next;
      if (old === at) break;
      next = at;
      at = old;
    }
  }
}

/** A heap of items with keys of several numbers: the smallest key comes first. */
export class Queue<Item> {
  readonly #heap: { readonly key: readonly number[]; readonly item: Item }[] = [];

  push(key: readonly number[], item: Item): void {
    const heap = this.#heap;
    let at = heap.length;
    heap.push({ key, item });
    while (at > 0) {
      const up = (at - 1) >> 1;
      if (!isLess(key, heap[up]!.key)) break;
      [heap[at], heap[up]] = [heap[up]!, heap[at]!];
      at = up;
    }
  }

  pop(): { readonly key: readonly number[]; readonly item: Item } | null {
    const heap = this.#heap;
    const first = heap[0];
    const last = heap.pop();
    if (first === undefined || last === undefined) return null;
    if (heap.length === 0) return first;
    heap[0] = last;
    for (let at = 0; ; ) {
      let down = 2 * at + 1;
      if (down >= heap.length) break;
      if (down + 1 < heap.length && isLess(heap[down + 1]!.key, heap[down]!.key)) down += 1;
      if (!isLess(heap[down]!.key, heap[at]!.key)) break;
      [heap[at], heap[down]] = [heap[down]!, heap[at]!];
      at = down;
    }
    return first;
  }

  /** Takes over all that another has. */
  take(other: Queue<Item>): void {
    for (const { key, item } of other.#heap) this.push(key, item);
  }
}

function isLess(a: readonly number[], b: readonly number[]): boolean {
  for (let k = 0; k < a.length; k += 1) if (a[k] !== b[k]) return a[k]! < b[k]!;
  return false;
}
