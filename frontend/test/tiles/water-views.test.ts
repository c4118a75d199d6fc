// What the page makes of running water: gauges, drops, outlines, floods among lakes (spec W45 to W48).

import { describe, expect, it } from "vitest";
import { NO_LAKE } from "../../src/generated/contract.ts";
import { withFlood } from "../../src/tiles/lakes/flooded.ts";
import { findLakes } from "../../src/tiles/lakes/lakes.ts";
import { gaugeAt } from "../../src/tiles/water/gauge.ts";
import { outlineOf } from "../../src/tiles/water/outline.ts";
import { Rain } from "../../src/tiles/water/rain.ts";
import { findWater, NO_SEA, watershed } from "../../src/tiles/water/water.ts";

const SIDE = 33;

/** A valley that runs to the south, with a hollow in the middle of it. */
function valley(hollow = 0): Int32Array {
  return Int32Array.from({ length: SIDE * SIDE }, (_, i) => {
    const [x, y] = [i % SIDE, Math.floor(i / SIDE)];
    const away = Math.hypot(x - 16, y - 16);
    return y * 40 + Math.abs(x - 16) * 60 - (away < 5 ? hollow : 0);
  });
}

const waterOf = (z: Int32Array) => findWater({ rows: SIDE, cols: SIDE, z }, NO_SEA);

describe("a gauge", () => {
  const water = waterOf(valley());
  const at = 1 * SIDE + 16;
  const inside = watershed(water, at);

  it("passes all that fell, no more and no less", () => {
    const gauge = gaugeAt(water, inside, 10, { mmPerHour: 30, hours: 2 });
    const step = gauge.seconds[1]!;
    const passed = gauge.flow.reduce((sum, q) => sum + q * step, 0);
    expect(passed / (0.06 * gauge.areaM2)).toBeCloseTo(1, 1);
    expect(gauge.areaM2).toBe(water.area[at]! * 100);
  });

  it("comes to rain times area where rain falls long enough, and to less where it does not", () => {
    const long = gaugeAt(water, inside, 10, { mmPerHour: 30, hours: 48 });
    expect(long.peak.flow).toBeCloseTo((30 / 3.6e6) * long.areaM2, 9);
    expect(long.endless).toBeCloseTo(long.peak.flow, 9);
    const short = gaugeAt(water, inside, 10, { mmPerHour: 30, hours: 0.02 });
    expect(short.peak.flow).toBeLessThan(0.8 * short.endless);
    expect(short.peak.flow).toBeGreaterThan(0);
  });
});

describe("rain", () => {
  const water = waterOf(valley(300));
  let seed = 1;
  const random = (): number => {
    seed = (seed * 16807) % 2147483647;
    return seed / 2147483647;
  };
  const heightOf = (i: number): number => water.filled[i]!;

  it("runs downhill, gathers in the valley, and stays on the grid", () => {
    const rain = new Rain(water, 400, null, random);
    for (let k = 0; k < 150; k += 1) rain.step(0.1);
    let [near, all] = [0, 0];
    rain.each(heightOf, (x, y, z, shown, falling) => {
      expect(x).toBeGreaterThanOrEqual(0);
      expect(y).toBeLessThanOrEqual(SIDE - 1);
      expect(Number.isFinite(z)).toBe(true);
      expect(shown).toBeGreaterThanOrEqual(0);
      if (falling > 0) return;
      all += 1;
      if (Math.abs(x - 16) < 5) near += 1;
    });
    expect(all).toBeGreaterThan(100);
    expect(near / all).toBeGreaterThan(0.5); // a third of the map
  });

  it("falls under its cloud alone, and moves with it", () => {
    const rain = new Rain(water, 200, { x: 8, y: 24, radius: 3 }, random);
    rain.step(8.2);
    rain.each(heightOf, (x, y, _z, _shown, falling) => {
      if (falling > 0.5) expect(Math.hypot(x - 8, y - 24)).toBeLessThan(5);
    });
    rain.move({ x: 26, y: 8, radius: 2 });
    for (let k = 0; k < 900; k += 1) rain.step(0.1);
    let there = 0;
    rain.each(heightOf, (x, y, _z, _shown, falling) => {
      if (falling > 0.5 && Math.hypot(x - 26, y - 8) < 4) there += 1;
      if (falling > 0.5) expect(Math.hypot(x - 8, y - 24)).toBeGreaterThan(5);
    });
    expect(there).toBeGreaterThan(0);
  });
});

describe("an outline", () => {
  it("goes once around, and around holes", () => {
    const side = 12;
    const ring = Uint8Array.from({ length: side * side }, (_, i) => {
      const away = Math.max(Math.abs((i % side) - 5), Math.abs(Math.floor(i / side) - 5));
      return away <= 4 && away >= 2 ? 1 : 0;
    });
    const [outer, inner, ...more] = outlineOf(ring, side);
    expect(more).toEqual([]);
    expect([outer!.length / 2 - 1, inner!.length / 2 - 1]).toEqual([36, 12]);
    for (const line of [outer!, inner!]) expect([...line.slice(0, 2)]).toEqual([...line.slice(-2)]);
    // Corners are rounded, edges stay.
    expect(Math.min(...outer!)).toBeCloseTo(0.5, 6);
    expect(Math.max(...outer!)).toBeCloseTo(9.5, 6);
  });

  it("leaves specks out, and stays on the map at its border", () => {
    const side = 6;
    expect(
      outlineOf(
        Uint8Array.from({ length: 36 }, (_, i) => (i === 14 ? 1 : 0)),
        side,
      ),
    ).toEqual([]);
    const all = outlineOf(new Uint8Array(36).fill(1), side);
    expect(all).toHaveLength(1);
  });
});

describe("a flood among lakes", () => {
  const heights = Float32Array.from(valley(900), (q) => q / 16);
  const found = findLakes(heights, SIDE, { cellM: 10, leastM: 2, seaM: null });
  const bed = 16 * SIDE + 16;

  it("stands in place of the lake that its hollow has otherwise", () => {
    expect(found.samples.size).toBe(1);
    const samples = Int32Array.of(bed, bed + 1, bed - 1);
    const flood = withFlood(found, { heights, lakes: [{ levelM: heights[bed]! + 5, samples }] });
    expect([...flood.samples]).toEqual([[Math.fround(heights[bed]! + 5), 3]]);
    expect(flood.levels[bed]).toBe(Math.fround(heights[bed]! + 5));
    const [level] = found.samples.keys();
    expect([...flood.levels].includes(level!)).toBe(false);
  });

  it("leaves other lakes alone, and is nothing on another level's grid", () => {
    const away = 28 * SIDE + 4;
    const flood = withFlood(found, { heights, lakes: [{ levelM: heights[away]! + 1, samples: Int32Array.of(away) }] });
    expect(flood.samples.size).toBe(2);
    expect(flood.levels[bed]).not.toBe(NO_LAKE);
    expect(withFlood(found, { heights: new Float32Array(9), lakes: [] })).toBe(found);
  });
});
