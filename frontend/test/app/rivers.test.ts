// SPEC W37
import { describe, expect, it } from "vitest";
import { riverLines } from "../../src/app/layers/river-lines.ts";
import type { RiverSet } from "../../src/core/types.ts";
import { footprintStyle } from "../../src/gpu/passes/ribbons.ts";
import { SIZE, SLOPE } from "../input/scene.ts";

const SET: RiverSet = {
  clock: 3,
  level: 2,
  settled: true,
  rivers: [
    { cells: new Float32Array([128, 200, 128, 100]), areasM2: [1e5, 4e5], into: 1 },
    { cells: new Float32Array([128, 100, 100, 0]), areasM2: [4e6, 8e6], into: null },
  ],
};

describe("rivers on the ground (SPEC W37)", () => {
  it("lie on it all along, in metres of the terrain, and wider where more water runs", () => {
    const [brook, river] = riverLines(SET, 1, SLOPE);
    expect(brook!.points[0]).toBeCloseTo((SIZE / 256) * 128, 3);
    expect(brook!.points[1]).toBeCloseTo((SIZE / 256) * 200, 3);
    for (let i = 0; i < brook!.points.length; i += 3)
      expect(brook!.points[i + 2]).toBeCloseTo(SLOPE.heightAt(brook!.points[i]!, brook!.points[i + 1]!), 1);
    expect(brook!.points.length / 3).toBeGreaterThan(100);
    expect(brook!.halfWidthPx).toBeGreaterThanOrEqual(0.75);
    expect(river!.halfWidthPx).toBeGreaterThan(brook!.halfWidthPx!);
  });

  it("are hidden by hills, and are drawn anew only on other ground", () => {
    const [first] = riverLines(SET, 1, SLOPE);
    expect(footprintStyle(first!, 2)).toMatchObject({
      halfWidthPx: 2 * first!.halfWidthPx!,
      haloPx: 0,
      hiddenOpacity: 0,
    });
    expect(riverLines(SET, 1, SLOPE)[0]).toBe(first);
    expect(riverLines(SET, 1, { ...SLOPE })[0]).not.toBe(first);
    expect(riverLines(SET, 10, SLOPE)[1]!.halfWidthPx).toBeGreaterThan(riverLines(SET, 1, SLOPE)[1]!.halfWidthPx!);
  });
});
