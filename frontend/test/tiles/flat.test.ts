// Contours fade on flat ground (SPEC N20 to N23).
import { describe, expect, it } from "vitest";
import { contourShare, flatSlope, sharesOf } from "../../src/tiles/flat.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { all, frame, SIZE_M } from "./frames.ts";

const store = (height: (x: number, y: number) => number): TileStore => {
  const tiles = new TileStore(SIZE_M, 1);
  for (const level of [0, 1]) tiles.apply(frame("LEVEL", level, all(level, 1, height)));
  return tiles;
};

describe("contours on flat ground", () => {
  it("are not there on a plain, at whatever height, and are there on slopes", () => {
    for (const z of [0, 20, 33.3]) {
      const flat = sharesOf(
        store(() => z),
        20,
      )!;
      expect(Math.max(...flat.values)).toBe(0);
    }
    const slope = sharesOf(
      store((x) => x / 5),
      20,
    )!;
    expect(Math.min(...slope.values)).toBe(1);
  });

  it("fade between: half where the next line lies half a domain away", () => {
    expect(contourShare(flatSlope(20, 1000), 20, 1000)).toBeCloseTo(0.5, 9);
    expect(contourShare(0, 20, 1000)).toBe(0);
    expect(contourShare(1, 20, 1000)).toBe(1);
    let last = 0;
    for (let s = 0; s < 0.2; s += 0.001) {
      const share = contourShare(s, 20, 1000);
      expect(share).toBeGreaterThanOrEqual(last);
      last = share;
    }
  });

  it("stand at the foot of a slope, not on the plain before it", () => {
    const { side, values } = sharesOf(
      store((x) => Math.max(0, x - 500) / 4),
      10,
    )!;
    const row = [...values.subarray(0, side)];
    expect(row.slice(0, (side >> 1) - 2).every((v) => v === 0)).toBe(true);
    expect(row.slice((side >> 1) + 2).every((v) => v === 1)).toBe(true);
  });

  it("are found once for a ground and an interval", () => {
    const tiles = store((x) => x / 5);
    expect(sharesOf(tiles, 20)).toBe(sharesOf(tiles, 20));
    expect(sharesOf(new TileStore(SIZE_M, 1), 20)).toBeNull();
  });
});
