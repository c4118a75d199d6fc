// What the page's bars cover of the picture (SPEC U315).
import { describe, expect, it } from "vitest";
import { coveredEdges } from "../../src/app/view/eye/covered.ts";

const box = (left: number, top: number, right: number, bottom: number) => ({ left, top, right, bottom });

describe("what covers the picture", () => {
  it("is a bar above, tools at the left, a bar below and the inspector at the right", () => {
    const picture = box(0, 0, 1280, 800);
    const chrome = {
      top: box(12, 12, 1268, 60),
      tools: box(12, 238, 64, 562),
      foot: box(1077, 744, 1268, 788),
      side: null,
    };
    expect(coveredEdges(picture, chrome)).toEqual({ left: 70, top: 66, right: 6, bottom: 62 });
    expect(coveredEdges(picture, { ...chrome, side: box(940, 72, 1268, 640) }).right).toBe(346);
  });

  it("is less where there is less, and a drawer below the picture covers nothing", () => {
    const none = { top: null, tools: null, foot: null, side: null };
    expect(coveredEdges(box(0, 0, 800, 600), none)).toEqual({ left: 6, top: 6, right: 6, bottom: 6 });
    const phone = {
      top: box(8, 8, 382, 52),
      tools: box(35, 338, 355, 394),
      foot: box(0, 0, 0, 0),
      side: box(0, 410, 390, 760),
    };
    expect(coveredEdges(box(0, 0, 390, 424), phone)).toEqual({ left: 6, top: 58, right: 6, bottom: 92 });
  });
});
