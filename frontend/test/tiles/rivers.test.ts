// Rivers as shaders read them are those of the twin (spec W52), and fade while they change (spec W53).

import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { ShownRivers } from "../../src/app/layers/shown-rivers.ts";
import type { RiverLine, RiverMap, RiverSet } from "../../src/core/types.ts";
import { RIVER_CELLS, RIVER_COLUMNS, RIVER_LATTICES, riverMap } from "../../src/tiles/water/rivermap.ts";

interface Case {
  name: string;
  size_m: number;
  level: number;
  wetness: number;
  rivers: { cells: number[]; areas: [number, number] }[];
  columns: number;
  cells: [number, number[][]][];
}

const { cases } = JSON.parse(
  readFileSync(new URL("../../../tests/vectors/rivermap.json", import.meta.url), "utf8"),
) as { cases: Case[] };

const lineOf = (cells: number[], areasM2: readonly [number, number]): RiverLine => ({
  cells: Float32Array.from(cells),
  areasM2,
  into: null,
});

/** Cells of all lattices, the finest first. */
const CELLS = Array.from({ length: RIVER_LATTICES }, (_, k) => (RIVER_CELLS >> k) ** 2);
const ALL_CELLS = CELLS.reduce((sum, n) => sum + n);

/** Pieces of eight numbers by their cell. */
function piecesOf(map: RiverMap | null): [number, number[][]][] {
  const out: [number, number[][]][] = [];
  for (let k = 0; map !== null && k < ALL_CELLS; k += 1) {
    const [first, count] = [map.texels[4 * k]!, map.texels[4 * k + 1]!];
    const pieces = Array.from({ length: count }, (_, i) => [
      ...map.texels.subarray(4 * first + 8 * i, 4 * first + 8 * i + 8),
    ]);
    if (count > 0) out.push([k, pieces]);
  }
  return out;
}

describe("the map of rivers", () => {
  it.each(cases)("is that of the twin: $name", (c) => {
    expect(c.columns).toBe(RIVER_COLUMNS);
    const shown = c.rivers.map(({ cells, areas }) => ({ line: lineOf(cells, areas), level: c.level, share: 1 }));
    const found = piecesOf(riverMap(shown, c.size_m, c.wetness));
    expect(found.map(([cell, pieces]) => [cell, pieces.length])).toEqual(c.cells.map(([cell, p]) => [cell, p.length]));
    c.cells.forEach(([, pieces], k) => {
      pieces.flat().forEach((v, i) => {
        expect(found[k]![1].flat()[i]!).toBeCloseTo(v, 2);
      });
    });
  });

  it("has room for as many rivers as a frame can hold", () => {
    const zigzag = Array.from({ length: 400 }, (_, i) => [20 + (i % 7) * 3, 10 + i / 2]).flat();
    const many = Array.from({ length: 60 }, (_, k) => ({
      line: lineOf(
        zigzag.map((v, i) => v + (i % 2 === 0 ? k / 3 : 0)),
        [1e6, 2e6],
      ),
      level: 2,
      share: 1,
    }));
    const map = riverMap(many, 4096, 1)!;
    expect(map.texels.length).toBe(4 * RIVER_COLUMNS * map.rows);
    expect(map.rows).toBeLessThan(1024);
    const counts = piecesOf(map).map(([cell, pieces]) => [cell, pieces.length] as const);
    let first = 0;
    for (const cells of CELLS) {
      const inside = counts.filter(([cell]) => cell >= first && cell < first + cells);
      expect(inside.length, "every lattice has room").toBeGreaterThan(0);
      first += cells;
    }
  });
});

describe("rivers that change", () => {
  const across = [10, 100, 200, 100];
  const setOf = (...lines: number[][]): RiverSet => ({
    clock: 1,
    level: 2,
    settled: true,
    rivers: lines.map((cells) => lineOf(cells, [1e6, 1e6])),
  });
  const shares = (map: RiverMap | null): Set<number> =>
    new Set(piecesOf(map).flatMap(([, pieces]) => pieces.map((p) => Math.round(100 * p[7]!) / 100)));

  it("move at once by less than a coarse cell, and fade where they jump", () => {
    const shown = new ShownRivers(4096);
    expect(shares(shown.map(setOf(across), 1, 10))).toEqual(new Set([1]));
    expect(shown.fading).toBe(false);
    // Half a coarse cell to the north, found on a finer level.
    const near = { ...setOf([40, 402, 800, 402]), level: 4 };
    expect(shares(shown.map(near, 1, 11))).toEqual(new Set([1]));
    expect(shown.fading).toBe(false);
    const away = setOf([10, 160, 200, 160]);
    expect(shares(shown.map(away, 1, 12))).toEqual(new Set([1])); // the old one still, the new one not yet
    expect(shown.fading).toBe(true);
    expect(shares(shown.map(away, 1, 12.3))).toEqual(new Set([0.5]));
    const last = shown.map(away, 1, 13);
    expect(shares(last)).toEqual(new Set([1]));
    expect(shown.fading).toBe(false);
    expect(shown.map(away, 1, 14)).toBe(last);
  });

  it("go when there are none any more, and at once where nothing may move", () => {
    const shown = new ShownRivers(4096);
    shown.map(setOf(across), 1, Number.POSITIVE_INFINITY);
    shown.map(setOf([10, 160, 200, 160]), 1, Number.POSITIVE_INFINITY);
    expect(shown.fading).toBe(false);
    expect(shown.map(null, 1, Number.POSITIVE_INFINITY)).toBeNull();
  });
});
