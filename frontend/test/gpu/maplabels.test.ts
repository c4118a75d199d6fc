import { describe, expect, it } from "vitest";
import { labelPlaces } from "../../src/gpu/map/map.ts";

describe("the kilometres around the map", () => {
  it("stand in the picture or not at all (SPEC U410)", () => {
    const wide = 36;
    // A phone upright: the map fills it from side to side.
    expect(labelPlaces(13, 13, wide, 390)).toEqual({ across: 21, beside: null });
    expect(labelPlaces(377, 13, wide, 390).across).toBe(390 - 21);
    // Room on all sides: where they always were.
    expect(labelPlaces(256, 256, wide, 1000)).toEqual({ across: 256, beside: 245 });
    // A corner that is out of the picture takes its label along.
    expect(labelPlaces(-40, -40, wide, 390)).toEqual({ across: -40, beside: null });
  });
});
