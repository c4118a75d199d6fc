// Water in the page is that of the server on the same heights (spec W38 to W41).

import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { pour } from "../../src/tiles/water/pour.ts";
import { brim, findWater, NO_SEA, quanta, raindrop, seaQuanta, watershed } from "../../src/tiles/water/water.ts";

interface Ground {
  name: string;
  rows: number;
  cols: number;
  sea: number | null;
  ground: number[];
}

interface FlowCase extends Ground {
  receiver: number[];
  filled: number[];
  area: number[];
}

interface PourCase extends Ground {
  brims: [number, number][];
  poured: {
    at: number;
    volume: number;
    left: number;
    pools: { level: number; samples: number[] }[];
  }[];
}

function vectors<Case>(name: string): Case[] {
  const path = new URL(`../../../tests/vectors/${name}`, import.meta.url);
  return (JSON.parse(readFileSync(path, "utf8")) as { cases: Case[] }).cases;
}

const waterOf = ({ rows, cols, sea, ground }: Ground) =>
  findWater({ rows, cols, z: Int32Array.from(ground) }, sea ?? NO_SEA);

describe("running water", () => {
  it.each(vectors<FlowCase>("flow.json"))("is that of the twin: $name", (c) => {
    const water = waterOf(c);
    expect([...water.receiver]).toEqual(c.receiver);
    expect([...water.filled]).toEqual(c.filled);
    expect([...water.area]).toEqual(c.area);
  });

  it.each(vectors<FlowCase>("flow.json"))("has watersheds as large as their areas, and ways that end: $name", (c) => {
    const water = waterOf(c);
    for (let i = 0; i < water.z.length; i += 5) {
      expect(watershed(water, i).reduce((sum, v) => sum + v, 0)).toBe(water.area[i]);
      const way = raindrop(water, i);
      expect(water.receiver[way.at(-1)!]).toBe(-1);
      for (let k = 1; k < way.length; k += 1)
        expect(water.filled[way[k]!]!).toBeLessThanOrEqual(water.filled[way[k - 1]!]!);
    }
  });
});

describe("poured water", () => {
  it.each(vectors<PourCase>("pour.json"))("stands where the twin has it: $name", (c) => {
    const water = waterOf(c);
    expect(c.brims.map(([at]) => [at, brim(water, at)])).toEqual(c.brims);
    for (const { at, volume, left, pools } of c.poured) {
      const found = pour(water, at, volume);
      expect(found.left).toBe(left);
      expect(found.pools.map(({ level, samples }) => ({ level, samples: [...samples] }))).toEqual(pools);
      const held = found.pools.reduce((sum, pool) => sum + pool.volume, 0);
      expect(Math.abs(held + left - volume)).toBeLessThanOrEqual(1e-9 * Math.max(1, volume));
    }
  });
});

describe("whole heights", () => {
  it("round halves to even, and are refused where they are none", () => {
    expect([...quanta([0.5, 1.5, 2.5, -0.5, -1.5, 3.2], 256)!]).toEqual([0, 2, 2, 0, -2, 3]);
    expect(quanta([1, Number.NaN], 256)).toBeNull();
    expect(quanta([1e12], 1)).toBeNull();
  });

  it("put the sea below all ground where there is none", () => {
    expect(seaQuanta(null, 16)).toBe(NO_SEA);
    expect(seaQuanta(10.99, 256)).toBe(10);
    expect(seaQuanta(-0.5, 256)).toBe(-1);
  });
});
