// SPEC W37
import { describe, expect, it } from "vitest";
import { riverLines } from "../../src/app/layers/river-lines.ts";
import type { RiverSet } from "../../src/core/types.ts";
import { SIZE } from "../input/scene.ts";

const SET: RiverSet = {
  clock: 3,
  level: 2,
  settled: true,
  rivers: [
    { cells: new Float32Array([128, 200, 128, 100]), areasM2: [1e5, 4e5], into: 1 },
    { cells: new Float32Array([128, 100, 100, 0]), areasM2: [4e6, 8e6], into: null },
  ],
};

describe("rivers on the map (SPEC W37)", () => {
  it("run through their points, in metres of the terrain, and are wider where more water runs", () => {
    const [brook, river] = riverLines(SET, 1, SIZE);
    const cell = SIZE / 256;
    expect([...brook!.points]).toEqual([128 * cell, 200 * cell, 0, 128 * cell, 100 * cell, 0]);
    expect(brook!.halfWidthPx).toBeGreaterThanOrEqual(0.75);
    expect(river!.halfWidthPx).toBeGreaterThan(brook!.halfWidthPx!);
  });

  it("are made anew only where they are wider", () => {
    const [first, second] = riverLines(SET, 1, SIZE);
    expect(riverLines(SET, 1, SIZE)[0]).toBe(first);
    expect(riverLines(SET, 10, SIZE)[1]!.halfWidthPx).toBeGreaterThan(second!.halfWidthPx!);
  });
});
