// Lakes are those of the Python twin, to the bit (spec R67, R68); what the picture asks of them.

import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { NO_LAKE } from "../../src/generated/contract.ts";
import { wavesOf } from "../../src/gpu/passes/patches.ts";
import { findLakes, flooded, LAKE_SIDE, lakeGround, levelsOn, Surfaces } from "../../src/tiles/lakes/lakes.ts";

interface Case {
  name: string;
  cell_m: number;
  least_m: number;
  sea_m: number | null;
  ground: number[];
  levels: (number | null)[];
  samples: [number, number][];
  waves: { size_m: number; heights: [number, number][] }[];
}

const { cases } = JSON.parse(readFileSync(new URL("../../../tests/vectors/lakes.json", import.meta.url), "utf8")) as {
  cases: Case[];
};

describe("lakes", () => {
  it.each(cases)("are those of the twin: $name", (c) => {
    const ground = Float32Array.from(c.ground, (q) => q / 16);
    const side = Math.sqrt(ground.length);
    const lakes = findLakes(ground, side, { cellM: c.cell_m, leastM: c.least_m, seaM: c.sea_m });
    expect([...lakes.levels].map((z) => (z === NO_LAKE ? null : z))).toEqual(c.levels);
    expect([...lakes.samples].sort((a, b) => a[0] - b[0])).toEqual(c.samples);
    for (const { size_m, heights } of c.waves)
      expect([...wavesOf(lakes, size_m)].sort((a, b) => a[0] - b[0])).toEqual(heights);
  });

  it("the waves of the vectors reach those of the sea on wide lakes, and only there", () => {
    const all = cases.flatMap((c) => c.waves.flatMap((w) => w.heights.map(([, height]) => height)));
    expect(Math.max(...all)).toBe(1);
    expect(Math.min(...all)).toBeLessThan(0.4);
  });

  it("stand nowhere above the lowest way out", () => {
    const side = 33;
    const ground = Float32Array.from({ length: side * side }, (_, i) => ((i * 7919) % 97) / 7);
    const filled = flooded(ground, side);
    // No sample is lower than the lowest of its neighbours' water and no higher than it needs.
    for (let r = 1; r < side - 1; r += 1) {
      for (let c = 1; c < side - 1; c += 1) {
        const i = r * side + c;
        const around = [i + 1, i - 1, i + side, i - side, i + side - 1, i - side + 1].map((k) => filled[k]!);
        expect(filled[i]).toBe(Math.max(ground[i]!, Math.min(...around)));
      }
    }
  });
});

describe("what the picture asks", () => {
  // A funnel of 40 m in a rim of 200 m, in the middle of a plain: 61 samples wide.
  const heights = Float32Array.from({ length: LAKE_SIDE * LAKE_SIDE }, (_, i) => {
    const away = Math.hypot((i % LAKE_SIDE) - 128, Math.floor(i / LAKE_SIDE) - 128);
    return away > 30 ? Math.max(0, 200 - 20 * (away - 30)) : 160 + (40 * away) / 30;
  });
  const lakes = findLakes(heights, LAKE_SIDE, { cellM: 16, leastM: 4, seaM: null });
  const [level] = [...lakes.samples.keys()];

  it("knows which patches a lake may show on, at any level", () => {
    const water = new Surfaces(lakes, Number.NEGATIVE_INFINITY);
    expect(water.highest(0, 1, 1)).toBe(level);
    expect(water.highest(0, 0, 0)).toBe(Number.NEGATIVE_INFINITY);
    expect(water.highest(2, 8, 8)).toBe(level);
    expect(water.highest(9, 8 << 7, 8 << 7)).toBe(level);
    expect(water.highest(9, 1 << 7, 8 << 7)).toBe(Number.NEGATIVE_INFINITY);
    expect(new Surfaces(lakes, 5).highest(0, 0, 0)).toBe(5);
    expect(levelsOn(lakes, 0, 1, 1)).toEqual([level]);
    expect(levelsOn(lakes, 8, 8 << 6, 8 << 6)).toEqual([level]);
    expect(levelsOn(lakes, 8, 0, 0)).toEqual([]);
  });

  it("agrees on patches and levels wherever it is asked", () => {
    const water = new Surfaces(lakes, Number.NEGATIVE_INFINITY);
    for (const at of [0, 1, 2, 3, 4]) {
      const n = 4 << at;
      for (let y = 0; y < n; y += 1) {
        for (let x = 0; x < n; x += 1) {
          const highest = levelsOn(lakes, at, x, y).at(-1) ?? Number.NEGATIVE_INFINITY;
          expect(water.highest(at, x, y)).toBe(highest);
        }
      }
    }
  });

  it("takes coarser ground where finer is not held", () => {
    const heights = Float32Array.from({ length: 65 * 65 }, (_, i) => (i % 65) * 2 + Math.floor(i / 65) * 3);
    const tile = { level: 0, x: 0, y: 0, heights };
    const view = { tile: (l: number) => (l === 0 ? tile : undefined) } as never;
    const ground = lakeGround(view)!;
    expect(ground[0]).toBe(0);
    expect(ground[5]).toBe(2.5);
    expect(ground[LAKE_SIDE * LAKE_SIDE - 1]).toBe(64 * 5);
    expect(lakeGround({ tile: () => undefined } as never)).toBeNull();
  });
});
