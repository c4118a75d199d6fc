/** The search for hidden patches: its pyramid, and where it pays (SPEC R58, R59). Drawing: tests/gpu/test_hidden.py. */

import { describe, expect, it } from "vitest";
import { pyramidLevels } from "../../src/gpu/passes/hidden.ts";
import { HiddenChoice } from "../../src/gpu/passes/picture.ts";

describe("hidden patches", () => {
  it("R59: the levels of the pyramid lie one after the other down to one texel, whatever the size", () => {
    for (const [width, height] of [
      [1024, 768],
      [301, 203],
      [1, 1],
      [7680, 4320],
    ] as const) {
      const levels = pyramidLevels(width, height);
      expect(levels[0]).toEqual([0, Math.ceil(width / 4), Math.ceil(height / 4)]);
      expect(levels.at(-1)!.slice(1)).toEqual([1, 1]);
      levels.slice(1).forEach(([at, w, h], k) => {
        const [before, columns, rows] = levels[k]!;
        expect(at).toBe(before + columns * rows);
        expect([w, h]).toEqual([Math.ceil(columns / 2), Math.ceil(rows / 2)]);
      });
    }
  });

  it("R58: is left off for small cuts and for a while where little is hidden", () => {
    const choice = new HiddenChoice();
    expect(choice.use(100)).toBe(false);
    expect(choice.use(1000)).toBe(true);
    choice.measured(1000, 600);
    expect(choice.use(1000)).toBe(true);
    choice.measured(1000, 990);
    let off = 0;
    while (!choice.use(1000)) off += 1;
    expect(off).toBeGreaterThan(10);
    expect(off).toBeLessThan(200);
  });
});
