/** Whose light is marched anew (SPEC R25). */

import { describe, expect, it } from "vitest";
import type { Atlas, Resident } from "../../src/gpu/atlas/atlas.ts";
import { LightQueue } from "../../src/gpu/atlas/lightqueue.ts";
import type { TakeLightPass } from "../../src/gpu/atlas/takelight.ts";
import type { SunPass } from "../../src/gpu/atlas/tilecompute.ts";

const tile = (level: number, x: number, y: number): Resident => ({
  level,
  x,
  y,
  slot: 0,
  stamp: 0,
  held: 0,
  version: 0,
  used: 0,
});

/** A queue over a few resident tiles; `run` gives the tiles that were marched. */
function queue(residents: Resident[]) {
  const atlas = {
    groundMoved: false,
    residents: () => residents,
    holds: () => true,
    isCurrent: () => true,
  };
  let marched: readonly Resident[] = [];
  const pass = {
    run(...args: unknown[]) {
      marched = args[4] as readonly Resident[];
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

  it("R55: synthetic tiles take their light from their parents, and again when those are marched", () => {
    const held: Resident = { ...tile(4, 1, 1), held: 16 };
    const [a, b, far] = [tile(5, 2, 2), tile(6, 4, 4), tile(6, 40, 40)];
    const parents = new Map([
      [a, held],
      [b, a],
    ]);
    const atlas = {
      groundMoved: false,
      residents: () => [b, held, far, a],
      holds: () => true,
      isCurrent: () => true,
      parentOf: (r: Resident) => parents.get(r) ?? r,
    };
    let taken: readonly Resident[] = [];
    const taking = {
      run(_: unknown, jobs: readonly Resident[]) {
        taken = jobs;
      },
    };
    const pass = { run() {} };
    const made = new LightQueue(
      pass as unknown as SunPass,
      atlas as unknown as Atlas,
      taking as unknown as TakeLightPass,
    );
    const run = (): readonly Resident[] => {
      made.run({} as GPUCommandEncoder, { sizeM: 1, high: 1, sun: [0, 0, 1] }, 100);
      return taken;
    };
    made.mark([], [held, a, b, far], SUN);
    expect(run()).toEqual([a, b, far]);
    expect(made.pending).toBe(false);
    made.mark([held], [], SUN);
    expect(made.pending).toBe(true);
    expect(run()).toEqual([a, b]);
    // A tile that is held no more gives up its own light.
    held.held = 0;
    made.mark([held, a, b], [], SUN);
    expect(made.pending).toBe(false);
    expect(run()).toEqual([held, a, b]);
    made.mark([b], [], SUN);
    expect(run()).toEqual([]);
  });
});
