// A card of the wall shades what is held whole, as the 2D map does (SPEC R600).
import { describe, expect, it } from "vitest";
import type { TileView } from "../../src/core/types.ts";
import { wholeLevel } from "../../src/gpu/map/card.ts";

const view = (held: readonly string[]): TileView =>
  ({
    sizeM: 4096,
    levels: 3,
    tile: (level: number, x: number, y: number) => (held.includes(`${level}/${x}/${y}`) ? {} : undefined),
  }) as unknown as TileView;

describe("what a card is drawn from", () => {
  it("is the finest level that is held whole", () => {
    const one = ["1/0/0", "1/1/0", "1/0/1", "1/1/1"];
    expect(wholeLevel(view([]))).toBe(-1);
    expect(wholeLevel(view(["0/0/0"]))).toBe(0);
    expect(wholeLevel(view(["0/0/0", ...one.slice(1)]))).toBe(0);
    expect(wholeLevel(view(["0/0/0", ...one, "3/0/0"]))).toBe(1);
  });
});
