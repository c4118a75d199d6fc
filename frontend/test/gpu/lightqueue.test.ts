/** Whose light is marched anew (SPEC R25). */

import { describe, expect, it } from "vitest";
import type { Atlas, Resident } from "../../src/gpu/atlas.ts";
import { LightQueue } from "../../src/gpu/lightqueue.ts";
import type { SunPass } from "../../src/gpu/tilecompute.ts";

const tile = (level: number, x: number, y: number): Resident => ({
  level,
  x,
  y,
  slot: 0,
  stamp: 0,
  neighbours: 0,
  used: 0,
});

/** A queue over a few resident tiles; `run` gives the tiles that were marched. */
function queue(residents: Resident[]) {
  const atlas = {
    groundMoved: false,
    levels: 10,
    residents: () => residents,
    holds: () => true,
    isCurrent: () => true,
  };
  let marched: readonly Resident[] = [];
  const pass = {
    run(...args: unknown[]) {
      marched = args[5] as readonly Resident[];
    },
  };
  const made = new LightQueue(pass as unknown as SunPass, atlas as unknown as Atlas);
  const run = (budget = 100): string[] => {
    made.run({} as GPUCommandEncoder, { sizeM: 1, high: 1, sun: [0, 0, 1] }, budget);
    return marched.map((r) => `${r.level}/${r.x}/${r.y}`).sort();
  };
  return { made, run, atlas };
}

const SUN = [0, 0, 1] as const;

describe("LightQueue", () => {
  it("R25: a tile that comes is marched at once, and its neighbours; others keep their light", () => {
    const [far, near, fresh] = [tile(8, 90, 3), tile(8, 11, 10), tile(8, 10, 10)];
    const { made, run } = queue([far, near, fresh]);
    made.mark([], [], SUN);
    run();
    made.mark([], [fresh], SUN);
    expect(run()).toEqual(["8/10/10", "8/11/10"]);
    expect(made.pending).toBe(false);
  });

  it("R25: a new border is marched with its tile; moved ground and a new sun make all light stale", () => {
    const [a, b] = [tile(5, 1, 1), tile(5, 20, 20)];
    const { made, run, atlas } = queue([a, b]);
    made.mark([], [], SUN);
    run();
    made.mark([b], [], SUN);
    expect(run()).toEqual(["5/20/20"]);
    atlas.groundMoved = true;
    made.mark([b], [], SUN);
    expect(run()).toEqual(["5/1/1", "5/20/20"]);
    atlas.groundMoved = false;
    made.mark([], [], [1, 0, 0]);
    expect(run()).toEqual(["5/1/1", "5/20/20"]);
  });
});
