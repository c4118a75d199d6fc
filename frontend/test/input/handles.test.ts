// @vitest-environment happy-dom
// Choosing strokes and dragging their handles, with synthetic events (SPEC I44-I46).
import { beforeEach, describe, expect, it } from "vitest";
import { strokeOf } from "../../src/app/history/gone.ts";
import { distance, distanceXY } from "../../src/core/math.ts";
import type { Vec3 } from "../../src/core/types.ts";
import { worldPoints } from "../../src/doc/strokes.ts";
import { type HandleKind, handlesOf } from "../../src/input/tools/handles.ts";
import { ridge } from "../doc/model.ts";
import {
  at,
  c,
  doc,
  fire,
  handle,
  input,
  messages,
  only,
  openForEach,
  type PointerType,
  place,
  refusals,
} from "./hands.ts";
import { groundOf, SIZE } from "./scene.ts";

openForEach();

describe("select and drag (SPEC I44)", () => {
  beforeEach(() => {
    input.tool.value = "select";
    place();
    input.selection.value = "r";
  });

  it("finds the feet of flanks that could reach far beyond them", () => {
    const high = groundOf((_x, y) => (y > 2600 ? 400 : Math.max(0, 300 - Math.abs(y - 1700) * 0.7)));
    const wide = { slope_deg: 35, extent_m: SIZE / 2, shape: "concave" as const };
    const s = place({ id: "wide", left: wide, right: null });
    const foot = handlesOf(s, high, null).find((h) => h.kind === "left")!;
    expect(foot.position[1] - 1700).toBeCloseTo(300 / Math.tan((35 * Math.PI) / 180), 0);
  });

  it("shows six handles where they belong", () => {
    const kinds = input.handles.value.map((h) => h.kind).sort();
    expect(kinds).toEqual(["crest", "first", "last", "left", "move", "right"]);
    expect(handle("first").position).toEqual([1400, 1700, 0]);
    expect(handle("crest").position).toEqual([2050, 1700, 300]);
    expect(handle("left").position[1]).toBeCloseTo(1700 + 300 / Math.tan((35 * Math.PI) / 180), 3);
    expect(handle("right").position[1]).toBeLessThan(1700);
  });

  function drag(kind: HandleKind, to: Vec3, init: PointerEventInit = {}): void {
    const from = at(handle(kind).position);
    const [x, y] = at(to);
    fire("pointerdown", ...from, init);
    for (let k = 1; k <= 6; k++)
      fire("pointermove", from[0] + ((x - from[0]) * k) / 6, from[1] + ((y - from[1]) * k) / 6, init);
    fire("pointerup", x, y, init);
  }

  it("a stroke that was deleted meanwhile is named, so that it can be restored (SPEC U344)", () => {
    const from = at(handle("last").position);
    fire("pointerdown", ...from);
    fire("pointermove", from[0] + 12, from[1]);
    doc.submit({ type: "stroke.delete", stroke: "r" });
    fire("pointermove", from[0] + 40, from[1]);
    fire("pointerup", from[0] + 40, from[1]);
    expect(refusals.map(({ code, op }) => [code, strokeOf(op)])).toEqual([["deleted_stroke", "r"]]);
  });

  it("an end slides on the ground and re-projects the stroke (SPEC I45)", () => {
    const before = worldPoints(only());
    drag("last", [2400, 1200, 0]);
    const s = only();
    expect(distance(s.last, [2400, 1200, 0])).toBeLessThan(0.5);
    expect(s.curve).toEqual([
      [0, 0],
      [0.25, 150],
      [0.5, 300],
      [0.75, 150],
      [1, 0],
    ]);
    const after = worldPoints(s);
    expect(after[6]).toBeCloseTo((1400 + s.last[0]) / 2, 3);
    expect(after[8]).toBeCloseTo(before[8]!, 3);
    doc.undo();
    expect(only().last).toEqual([2700, 1700, 0]);
    expect(doc.canUndo.value).toBe(true);
  });

  it("taking a handle beside its middle does not make it jump", () => {
    const [x, y] = at(handle("last").position);
    fire("pointerdown", x + 9, y + 6);
    fire("pointermove", x + 9 + 40, y + 6);
    const first = only().last;
    const p = c.project(first);
    expect(p.x).toBeCloseTo(x + 40, 0);
    expect(p.y).toBeCloseTo(y, 0);
    fire("pointerup", x + 49, y + 6);
  });

  it("the crest scales the heights", () => {
    drag("crest", [2050, 1700, 450]);
    const heights = only().curve.map(([, w]) => w);
    expect(heights[2]).toBeCloseTo(450, -0.5);
    expect(heights[1]! / heights[2]!).toBeCloseTo(0.5, 3);
  });

  it("a flank's foot sets its slope; equal flanks go together, Alt drags one", () => {
    drag("right", [2050, 1700 - 600, 0]);
    const slope = (Math.atan2(300, 600) * 180) / Math.PI;
    expect(only().right!.slope_deg).toBeCloseTo(slope, 0);
    expect(only().left).toEqual(only().right);
    drag("right", [2050, 1700 - 300, 0], { altKey: true });
    expect(only().right!.slope_deg).toBeCloseTo(45, 0);
    expect(only().left!.slope_deg).toBeCloseTo(slope, 0);
  });

  it("move keeps the shape and carries both ends", () => {
    const from = handle("move").position;
    drag("move", [from[0] - 200, from[1] - 300, from[2]]);
    const s = only();
    expect(distance(s.first, [1200, 1400, 0])).toBeLessThan(3);
    expect(distanceXY(s.first, s.last)).toBeCloseTo(1300, 2);
  });

  it("the body of the selected stroke can be dragged; another one is only selected", () => {
    const s2 = ridge("q", {
      first: [1400, 900, 0],
      last: [2700, 900, 0],
      curve: [
        [0, 0],
        [0.5, 100],
        [1, 0],
      ],
    });
    doc.submit({ type: "stroke.begin", stroke: s2 });
    const eye = c.state.value.eye;
    const [x, y] = at([1725, 1700, 150]);
    fire("pointerdown", x, y);
    fire("pointermove", x + 60, y);
    fire("pointerup", x + 60, y);
    expect(doc.doc.value!.strokes.get("r")!.first[0]).toBeGreaterThan(1430);
    expect(c.state.value.eye).toEqual(eye);
    const [u, v] = at([1725, 900, 50]);
    fire("pointerdown", u, v);
    fire("pointerup", u, v);
    expect(input.selection.value).toBe("q");
    expect(doc.doc.value!.strokes.get("q")).toEqual(s2);
  });

  it("one drag is one step of undo, and Escape takes it back", () => {
    const s = only();
    const [x, y] = at(handle("last").position);
    fire("pointerdown", x, y);
    for (let k = 1; k < 9; k++) fire("pointermove", x - 20 * k, y);
    expect(only().last).not.toEqual(s.last);
    window.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", code: "Escape" }));
    expect(only()).toEqual(s);
  });

  it("a locked stroke is selectable and refuses with a sentence (SPEC I46)", () => {
    doc.submit({ type: "stroke.set", stroke: "r", fields: { locked: true } });
    expect(input.handles.value).toEqual([]);
    const [x, y] = at([1725, 1700, 150]);
    fire("pointerdown", x, y);
    fire("pointermove", x + 60, y);
    fire("pointerup", x + 60, y);
    expect(messages).toEqual(["This stroke is locked. Unlock it to change it."]);
    expect(only().first[0]).toBe(1400);
  });

  it("dragging empty ground orbits; a click there selects nothing", () => {
    const eye = c.state.value.eye;
    fire("pointerdown", ...at([2048, 800, 0]));
    fire("pointermove", 700, 600);
    fire("pointerup", 700, 600);
    expect(distance(c.state.value.eye, eye)).toBeGreaterThan(10);
    expect(input.selection.value).toBe("r");
  });

  it("the level stroke's last keeps the height of its first", () => {
    const mesa = ridge("m", {
      kind: "level",
      first: [900, 900, 120],
      last: [1500, 900, 120],
      curve: [
        [0, 0],
        [0.5, 0.2],
        [1, 0],
      ],
    });
    doc.submit({ type: "stroke.begin", stroke: mesa });
    input.selection.value = "m";
    drag("last", [1600, 1300, 0]);
    const moved = doc.doc.value!.strokes.get("m")!;
    expect(moved.last[2]).toBe(120);
    expect(distanceXY(moved.last, [1600, 1300, 0])).toBeLessThan(250);
    drag("crest", [...handle("crest").position.slice(0, 2), 200] as unknown as Vec3);
    expect(doc.doc.value!.strokes.get("m")!.first[2]).toBeCloseTo(200, -0.5);
  });

  it("is within 12 CSS pixels of a stroke for a mouse and 24 for a finger", () => {
    input.selection.value = null;
    const [x, y] = at([1725, 1700, 150]);
    const d = c.project([1725, 1700, 150]).y - y;
    expect(d).toBe(0);
    const click = (off: number, pointerType: PointerType): string | null => {
      input.selection.value = null;
      fire("pointerdown", x - off, y - off, { pointerType });
      fire("pointerup", x - off, y - off, { pointerType });
      return input.selection.value;
    };
    expect(click(14, "mouse")).toBe("r");
    expect(click(26, "mouse")).toBeNull();
    expect(click(26, "touch")).toBe("r");
    expect(click(48, "touch")).toBeNull();
  });
});
