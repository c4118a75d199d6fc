// Cut and fill beside integration by hand (spec W43), and areas under a level (spec W44).

import { describe, expect, it } from "vitest";
import { earthwork } from "../../src/core/measure/earthwork.ts";
import { areaBelow } from "../../src/core/measure/flooded.ts";

const LINE = [100, 500, 0, 900, 500, 0];

describe("earthwork", () => {
  it("is none where the ground is straight across, however steep", () => {
    const found = earthwork(LINE, 60, 8, (x, y) => 0.7 * y + 0.2 * x);
    expect(found.cutM3).toBeCloseTo(0, 6);
    expect(found.fillM3).toBeCloseTo(0, 6);
  });

  it("of a trench is its section times its length", () => {
    // A bed 20 m wide and 5 m deep with banks that rise over 30 m: 20 * 5 + 2 * 30 * 5 / 2.
    const depth = (t: number): number => 5 * Math.min(1, Math.max(0, (40 - Math.abs(t)) / 30));
    const found = earthwork(LINE, 60, 8, (_, y) => 300 - depth(y - 500));
    expect(found.cutM3 / (250 * 800)).toBeCloseTo(1, 1);
    expect(found.fillM3).toBe(0);
  });

  it("of a road along a slope is cut above and fill below, as much of one as of the other", () => {
    // A slope of 0.4 with a level bench of 2 * 12 m: two triangles of 12 * 4.8 / 2.
    const found = earthwork(LINE, 24, 4, (_, y) => (Math.abs(y - 500) < 12 ? 0 : 0.4 * (y - 500)));
    expect(found.cutM3 / ((12 * 4.8 * 800) / 2)).toBeCloseTo(1, 1);
    expect(found.fillM3 / found.cutM3).toBeCloseTo(1, 6);
  });

  it("of an embankment is fill, along lines with corners too", () => {
    const line = [100, 500, 0, 500, 500, 0, 500, 500, 0, 500, 900, 0];
    const dam = (x: number, y: number): number => {
      const away = Math.min(
        Math.hypot(Math.max(0, x - 500, 100 - x), y - 500),
        Math.hypot(x - 500, Math.max(0, 500 - y, y - 900)),
      );
      return away < 10 ? 6 : 0;
    };
    const found = earthwork(line, 40, 4, dam);
    expect(found.cutM3 / found.fillM3).toBeLessThan(0.02);
    expect(found.fillM3 / (20 * 6 * 800)).toBeGreaterThan(0.9);
    expect(found.fillM3 / (20 * 6 * 800)).toBeLessThan(1.15);
  });

  it("of a point, or of a line without a reach, is none", () => {
    expect(earthwork([5, 5, 0], 10, 8, () => 1)).toEqual({ cutM3: 0, fillM3: 0 });
    expect(earthwork([5, 5, 0, 5, 5, 0], 10, 8, () => 1)).toEqual({ cutM3: 0, fillM3: 0 });
    expect(earthwork(LINE, 0, 8, () => 1)).toEqual({ cutM3: 0, fillM3: 0 });
  });
});

describe("the area under a level", () => {
  const side = 11;
  const plane = Float32Array.from({ length: side * side }, (_, i) => (i % side) + 0.5 * Math.floor(i / side));

  it("of a plane is that of the polygon that the level cuts off", () => {
    // x + y / 2 < 4 on a square of side 10 with cells of 1: a triangle 4 wide and 8 high.
    expect(areaBelow(plane, side, 1, 4)).toBeCloseTo(16, 9);
    expect(areaBelow(plane, side, 3, 4)).toBeCloseTo(9 * 16, 9);
  });

  it("is all of it under high water, and nothing under low", () => {
    expect(areaBelow(plane, side, 2, 100)).toBe(400);
    expect(areaBelow(plane, side, 2, -1)).toBe(0);
    expect(areaBelow(new Float32Array(4).fill(3), 2, 5, 3)).toBe(25);
  });
});
