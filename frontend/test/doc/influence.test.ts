/** Where a stroke is felt (R61). */

import { describe, expect, test } from "vitest";
import { INFLUENCE_SIDE, strokeInfluence } from "../../src/doc/influence.ts";
import type { Stroke } from "../../src/generated/contract.ts";

const SIZE = 4096;
const ridge: Stroke = {
  id: "a",
  author: "",
  kind: "profile",
  first: [1024, 2048, 0],
  last: [3072, 2048, 0],
  curve: [
    [0, 0],
    [0.5, 300],
    [1, 0],
  ],
  left: { slope_deg: 40, extent_m: 640, shape: "concave" },
  right: { slope_deg: 40, extent_m: 320, shape: "concave" },
  plateau_radius_m: 0,
  amplitude_m: 0,
  roughness: 0.5,
  yields: 0,
  paint: null,
  course: null,
  locked: false,
  hidden: false,
  label: "",
  finished: true,
};

const at = (grid: { values: Float32Array }, x: number, y: number): number =>
  grid.values[
    Math.round((y / SIZE) * (INFLUENCE_SIDE - 1)) * INFLUENCE_SIDE + Math.round((x / SIZE) * (INFLUENCE_SIDE - 1))
  ]!;

describe("influence of a stroke", () => {
  test("R61: whole on the line, a half at the end of each flank", () => {
    const grid = strokeInfluence(ridge, 200, SIZE);
    expect(at(grid, 2048, 2048)).toBe(1);
    // Travel goes east: north is left.
    expect(at(grid, 2048, 2048 + 640)).toBeCloseTo(0.5, 5);
    expect(at(grid, 2048, 2048 - 320)).toBeCloseTo(0.5, 5);
    expect(at(grid, 2048, 2048 + 320)).toBeGreaterThan(0.8);
  });

  test("R61: beyond the flanks it decays by e for every reach; an infinite one goes further", () => {
    const grid = strokeInfluence(ridge, 256, SIZE);
    expect(at(grid, 2048, 2048 - 320 - 256)).toBeCloseTo(0.5 / Math.E, 5);
    expect(at(strokeInfluence(ridge, null, SIZE), 2048, 64)).toBeGreaterThan(2 * at(grid, 2048, 64));
  });

  test("R61: a brush is felt within its radius alone; a stroke without points nowhere", () => {
    const brush: Stroke = {
      ...ridge,
      kind: "paint",
      curve: [
        [0, 0],
        [1, 0],
      ],
      left: null,
      right: null,
      paint: { channel: "snow", value: 1, radius_m: 320 },
    };
    const grid = strokeInfluence(brush, 256, SIZE);
    expect(at(grid, 2048, 2048 + 288)).toBeGreaterThan(0.5);
    expect(at(grid, 2048, 2048 + 352)).toBe(0);
    expect(strokeInfluence({ ...ridge, curve: [] }, 256, SIZE).values.every((v) => v === 0)).toBe(true);
  });
});
