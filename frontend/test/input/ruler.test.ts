// @vitest-environment happy-dom
// What is measured, by mouse, finger and keys (SPEC N4 to N7).
import { describe, expect, it } from "vitest";
import type { Vec3 } from "../../src/core/types.ts";
import { MOST_POINTS } from "../../src/input/tools/ruler.ts";
import { at, c, doc, fire, input, lookOnly, messages, openForEach, pass, place, stroke, strokes } from "./hands.ts";

openForEach();

const A: Vec3 = [1500, 1500, 0];
const B: Vec3 = [2500, 1500, 0];
const C: Vec3 = [2500, 2200, 0];
const points = (): (readonly number[])[] => input.ruler.points.value.map((p) => p.map(Math.round));
const click = (p: Vec3, init: PointerEventInit = {}): void => {
  fire("pointerdown", ...at(p), init);
  fire("pointerup", ...at(p), init);
};
const key = (name: string, init: KeyboardEventInit = {}): void => {
  pass(40);
  window.dispatchEvent(new KeyboardEvent("keydown", { key: name, code: name, cancelable: true, ...init }));
};

describe("the place from which water is followed", () => {
  it("is one, set by a click and moved by a drag, with a link that only looks too (SPEC W49)", () => {
    lookOnly();
    input.ruler.open("water");
    click(A);
    click(B);
    expect(points()).toEqual([[2500, 1500]]);
    stroke([C, [1800, 2400, 0]]);
    expect(points()).toEqual([[1800, 2400]]);
    expect(strokes()).toEqual([]);
    expect(input.ruler.removeLast()).toBe(true);
    expect(points()).toEqual([]);
  });

  it("is the last point of a line, and stays one point when a line is measured again (SPEC W49)", () => {
    input.ruler.open("line");
    click(A);
    click(B);
    key("z");
    expect(input.ruler.kind.value).toBe("water");
    expect(points()).toEqual([[2500, 1500]]);
    key("z");
    expect(input.ruler.kind.value).toBeNull();
  });
});

describe("the ruler", () => {
  it("takes points by clicks and changes no document, also with a link that only looks (SPEC N4)", () => {
    lookOnly();
    input.ruler.open("line");
    click(A);
    click(B);
    click(C);
    expect(points()).toEqual([
      [1500, 1500],
      [2500, 1500],
      [2500, 2200],
    ]);
    expect(strokes()).toEqual([]);
    expect(doc.pending.value).toBe(0);
    expect(messages).toEqual([]);
  });

  it("is drawn in one go, with few points left, and drawing anew takes its place (SPEC N4)", () => {
    input.ruler.open("line");
    stroke([A, B, C]);
    expect(points().length).toBeLessThanOrEqual(6);
    expect(points()[0]).toEqual([1500, 1500]);
    expect(points().at(-1)).toEqual([2500, 2200]);
    const D: Vec3 = [1900, 2600, 0];
    stroke([D, [1200, 1900, 0]]);
    expect(points()).toEqual([
      [1900, 2600],
      [1200, 1900],
    ]);
  });

  it("closes an outline that comes back to its beginning (SPEC N4)", () => {
    input.ruler.open("area");
    stroke([A, B, C, A]);
    const ring = points();
    expect(ring.length).toBeGreaterThanOrEqual(3);
    const last = ring.at(-1)!;
    expect(Math.hypot(last[0]! - 1500, last[1]! - 1500)).toBeGreaterThan(100);
  });

  it("has handles that are dragged, and Esc puts a point back (SPEC N5)", () => {
    input.ruler.open("line");
    click(A);
    click(B);
    expect(input.handles.value.map((h) => h.kind)).toEqual(["ruler", "ruler"]);
    stroke([B, C]);
    expect(points()[1]).toEqual([2500, 2200]);
    expect(points()[0]).toEqual([1500, 1500]);
    stroke([C, B], {}, false);
    expect(points()[1]).toEqual([2500, 1500]);
    key("Escape");
    expect(points()[1]).toEqual([2500, 2200]);
  });

  it("is used with the keys alone (SPEC N6)", () => {
    key("y");
    expect(input.ruler.kind.value).toBe("line");
    key("Enter");
    key("Enter");
    for (let i = 0; i < 6; i++) key("ArrowRight");
    key("Enter");
    expect(points()).toHaveLength(2);
    expect(input.keyPen.words.value).toContain("Point 2 is set");
    key("Backspace");
    expect(points()).toHaveLength(1);
    key("Escape");
    key("Escape");
    expect(input.ruler.kind.value).toBeNull();
    key("Y", { shiftKey: true });
    expect(input.ruler.kind.value).toBe("area");
    expect(points()).toHaveLength(1);
  });

  it("leaves strokes alone while it is open, and a tool puts it away (SPEC N7)", () => {
    place();
    input.tool.value = "select";
    input.selection.value = "r";
    input.ruler.open("line");
    expect(input.handles.value).toEqual([]);
    click(A);
    click([2048, 1700, 300]);
    expect(input.selection.value).toBe("r");
    expect(points()).toHaveLength(2);
    input.actions.get("mountain")!.run();
    expect(input.ruler.kind.value).toBeNull();
    stroke([A, [2000, 1500, 300], B]);
    expect(strokes()).toHaveLength(2);
  });

  it("by a finger draws, or moves the view where fingers do (SPEC N6)", () => {
    input.ruler.open("line");
    click(A, { pointerType: "touch" });
    expect(points()).toHaveLength(1);
    input.fingerDraws.value = false;
    const before = c.state.value.eye;
    stroke([C, B], { pointerType: "touch" });
    expect(points()).toHaveLength(1);
    expect(c.state.value.eye).not.toEqual(before);
  });

  it("says where it cannot begin, and has a bound on its points (SPEC N5)", () => {
    input.ruler.open("line");
    fire("pointerdown", 500, 2);
    fire("pointermove", 560, 2);
    fire("pointerup", 560, 2);
    fire("pointerdown", 500, 2);
    fire("pointerup", 500, 2);
    expect(messages).toEqual(["Begin the line on the land.", "Begin the line on the land."]);
    for (let i = 0; i < MOST_POINTS + 3; i++) input.ruler.add([i, i]);
    expect(points()).toHaveLength(MOST_POINTS);
  });
});
