// Which crests cross, where and how high (SPEC U316).
import { describe, expect, it } from "vitest";
import { fullStroke } from "../../src/doc/document.ts";
import { MOST_MEETINGS, meetings } from "../../src/doc/meetings.ts";
import type { Stroke } from "../../src/generated/contract.ts";

function profile(
  id: string,
  from: [number, number],
  to: [number, number],
  top: number,
  more: Partial<Stroke> = {},
): Stroke {
  const curve: Stroke["curve"] = [
    [0, 0],
    [0.5, top],
    [1, 0],
  ];
  return fullStroke({ id, kind: "profile", first: [...from, 10], last: [...to, 10], curve, ...more });
}

const summit = profile("summit", [0, 500], [1000, 500], 700);

describe("meetings of strokes", () => {
  it("are where crests cross on the map, with the heights of both", () => {
    const low = profile("low", [500, 0], [500, 1000], 250);
    expect(meetings(summit, [summit, low])).toEqual([{ other: "low", x: 500, y: 500, mine: 710, theirs: 260 }]);
    expect(meetings(low, [summit, low])[0]).toMatchObject({ other: "summit", mine: 260, theirs: 710 });
    expect(meetings(summit, [profile("quarter", [250, 0], [250, 1000], 250)])[0]).toMatchObject({ x: 250, mine: 360 });
  });

  it("are none with strokes beside, at the same height, hidden or of paint", () => {
    const beside = profile("b", [0, 600], [1000, 600], 300);
    const alike = profile("a", [500, 0], [500, 1000], 700);
    const hidden = profile("h", [500, 0], [500, 1000], 250, { hidden: true });
    const paint = profile("p", [500, 0], [500, 1000], 1, {
      kind: "paint",
      paint: { channel: "snow", value: 1, radius_m: 9 },
    });
    expect(meetings(summit, [beside, alike, hidden, paint])).toEqual([]);
    expect(meetings(paint, [summit])).toEqual([]);
  });

  it("with an outline are where its level differs most, and overhangs count once", () => {
    const outline = fullStroke({
      id: "o",
      kind: "level",
      first: [300, 300, 100],
      last: [900, 300, 100],
      curve: [
        [0, 0],
        [1, 0],
        [1, 1],
        [0, 1],
        [0, 0],
      ],
    });
    const [met, ...more] = meetings(summit, [outline]);
    expect(more).toEqual([]);
    expect(met).toMatchObject({ other: "o", theirs: 100, y: 500 });
    const folded = profile("f", [500, 0], [500, 1000], 0, {
      curve: [
        [0, 0],
        [0.6, 90],
        [0.4, 200],
        [1, 0],
      ],
    });
    expect(meetings(summit, [folded])[0]!.theirs).toBeCloseTo(155, 0);
  });

  it("are listed nearest to the start first, and not without end", () => {
    const many = Array.from({ length: 40 }, (_, i) => profile(`s${i}`, [20 * i + 10, 0], [20 * i + 10, 1000], 50));
    const found = meetings(summit, many.toReversed());
    expect(found.length).toBe(MOST_MEETINGS);
    expect(found.map((m) => m.x)).toEqual(found.map((m) => m.x).toSorted((a, b) => a - b));
  });
});
