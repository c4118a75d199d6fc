/**
 * How high water stands that is poured out at a place: hollows fill from their pit, run over at their lowest brim into the
 * next, and join where both stand at it. No drop is lost: what the pools hold and what has run off is what was poured
 * (twin of `backend/esker/flow/pour.py`; both read tests/vectors/pour.json).
 */

import { Queue } from "./basins.ts";
import { meshSteps } from "./receivers.ts";
import type { Water } from "./water.ts";

/** Water that stands in one hollow, or in several that have joined. */
export interface Pool {
  /** Steps of height, not always a whole number. */
  readonly level: number;
  /** The samples below it. */
  readonly samples: Int32Array;
  /** Steps of height times samples. */
  readonly volume: number;
}

export interface Poured {
  /** In the order in which they filled. */
  readonly pools: readonly Pool[];
  /** What ran off over the border or into the sea. */
  readonly left: number;
}

interface Filling {
  readonly basins: Set<number>;
  readonly front: Queue<number>;
  samples: number[];
  level: number;
}

type Ground = Pick<Water, "cols" | "z" | "basin" | "pits">;

/** Pours a volume (steps of height times samples) out at a sample. */
export function pour(ground: Ground, index: number, volume: number): Poured {
  const { z, basin, pits } = ground;
  const taken = new Uint8Array(z.length);
  const fillings: Filling[] = [];
  let left = volume;
  let to = basin[index]!;
  while (to !== 0 && left > 0) {
    const known = fillings.findIndex((f) => f.basins.has(to));
    if (known >= 0) join(fillings, known);
    else fillings.push(fillingOf(to, pits[to]!, z));
    [left, to] = fill(ground, fillings.at(-1)!, taken, left);
  }
  return { pools: fillings.map((f) => poolOf(f, z)), left };
}

function fillingOf(b: number, pit: number, z: Int32Array): Filling {
  const front = new Queue<number>();
  front.push([z[pit]!, pit], pit);
  return { basins: new Set([b]), front, samples: [], level: z[pit]! };
}

/** The pools from one on stand at the brim between them: they are one from now on. */
function join(fillings: Filling[], first: number): void {
  const into = fillings[first]!;
  for (const { basins, front, samples, level } of fillings.splice(first + 1)) {
    for (const b of basins) into.basins.add(b);
    into.front.take(front);
    into.samples = into.samples.concat(samples);
    into.level = Math.max(into.level, level);
  }
}

/** Raises a pool until the water is used up or runs over: what is left, and the basin into which it runs, 0 outside. */
function fill(
  { z, basin, cols }: Ground,
  pool: Filling,
  taken: Uint8Array,
  volume: number,
): [left: number, to: number] {
  const steps = meshSteps(cols);
  let left = volume;
  for (let next = pool.front.pop(); next !== null; next = pool.front.pop()) {
    const i = next.item;
    const isOwn = pool.basins.has(basin[i]!);
    if (isOwn && taken[i] === 1) continue;
    const to = Math.max(pool.level, z[i]!);
    const more = (to - pool.level) * pool.samples.length;
    if (left < more) {
      pool.front.push(next.key, i);
      break;
    }
    left -= more;
    pool.level = to;
    if (!isOwn) {
      pool.front.push(next.key, i);
      return [left, basin[i]!];
    }
    taken[i] = 1;
    pool.samples.push(i);
    for (const step of steps) {
      // No sample of a basin lies on the border, so all around one are samples.
      const j = i + step;
      // Water of another pool is a way out too: both join where they stand equally high.
      if (taken[j] === 0 || !pool.basins.has(basin[j]!)) pool.front.push([z[j]!, j], j);
    }
  }
  pool.level += left / pool.samples.length;
  return [0, 0];
}

function poolOf({ samples, level }: Filling, z: Int32Array): Pool {
  const below = Int32Array.from(samples.filter((i) => z[i]! < level)).sort();
  let volume = 0;
  for (const i of below) volume += level - z[i]!;
  return { level, samples: below, volume };
}
