// @vitest-environment happy-dom
// A line drawn over the selected stroke redraws that part of it (SPEC I66).
import { describe, expect, it } from "vitest";
import type { Vec3 } from "../../src/core/types.ts";
import type { CurvePoint } from "../../src/doc/strokes.ts";
import { redraws, spliced } from "../../src/input/sketch/oversketch.ts";
import { at, c, canvas, doc, fire, input, only, openForEach, place, stroke, strokes } from "./hands.ts";

openForEach();

/** A point of the placed ridge's plane: x, height. */
const on = (x: number, z: number): Vec3 => [x, 1700, z];
const heightAt = (u: number): number => {
  const { curve } = only();
  const i = Math.max(
    1,
    curve.findIndex(([v]) => v >= u),
  );
  const [a, b] = [curve[i - 1]!, curve[i]!];
  return a[1] + ((u - a[0]) / (b[0] - a[0] || 1)) * (b[1] - a[1]);
};
const uOf = (x: number): number => (x - 1400) / 1300;

/** The ridge of `place` from 1400 to 2700, its summit of 300 m in the middle; selected, the mountain tool in hand. */
function selected() {
  const s = place();
  input.selection.value = s.id;
  input.tool.value = "mountain";
  return s;
}

describe("over-sketching (SPEC I66)", () => {
  it("redraws the part that the line passes and leaves the rest, live, as one step of undo", () => {
    const s = selected();
    const steps = doc.canUndo.value;
    stroke([on(1725, 150), on(2048, 450), on(2375, 150)], {}, false);
    expect(only().curve).not.toEqual(s.curve); // already while the pen moves
    expect(input.ink.value).not.toBeNull();
    fire("pointerup", ...at(on(2375, 150)));
    expect(heightAt(0.5)).toBeGreaterThan(430);
    expect(heightAt(uOf(1500))).toBeCloseTo(150 * (uOf(1500) / 0.25), 0);
    expect(heightAt(uOf(2600))).toBeCloseTo((150 * (1 - uOf(2600))) / 0.25, 0);
    expect([only().first, only().last]).toEqual([s.first, s.last]);
    expect(input.selection.value).toBe(s.id);
    expect(input.ink.value).toBeNull();
    doc.undo();
    expect(only().curve).toEqual(s.curve);
    expect(doc.canUndo.value).toBe(steps);
  });

  it("works backwards too, and u goes on growing", () => {
    selected();
    stroke([on(2375, 150), on(2048, 100), on(1725, 150)]);
    expect(heightAt(0.5)).toBeLessThan(120);
    const us = only().curve.map(([u]) => u);
    expect(us).toEqual([...us].sort((a, b) => a - b));
  });

  it("joins without a step where the pen was a little off the line", () => {
    selected();
    stroke([on(1725, 165), on(2048, 420), on(2375, 135)]);
    const { curve } = only();
    for (let i = 1; i < curve.length; i++) {
      const slope = Math.abs(curve[i]![1] - curve[i - 1]![1]) / (1300 * (curve[i]![0] - curve[i - 1]![0]) + 0.5);
      expect(slope).toBeLessThan(2.5);
    }
  });

  it("begins a new stroke with Alt, at an end, with another tool, beside the line, and when nothing is selected", () => {
    selected();
    stroke([on(1725, 150), on(2048, 450), on(2375, 150)], { altKey: true });
    expect(strokes().length).toBe(2);
    input.selection.value = "r";
    stroke([on(1400, 0), [1300, 1500, 200], [1200, 1300, 0]]);
    expect(strokes().length).toBe(3);
    input.selection.value = "r";
    input.tool.value = "crevice";
    stroke([on(1725, 150), on(2048, 50), on(2375, 150)]);
    expect(strokes().length).toBe(4);
    input.selection.value = "r";
    input.tool.value = "mountain";
    stroke([on(1725, 40), on(2048, 250), on(2375, 0)]);
    expect(strokes().length).toBe(5);
    input.selection.value = null;
    stroke([on(1725, 150), on(2048, 450), on(2375, 150)]);
    expect(strokes().length).toBe(6);
  });

  it("shows under the pointer that a line begun here redraws", () => {
    const s = selected();
    fire("pointermove", ...at(on(1725, 150)));
    expect([input.hovered.value, canvas.style.cursor]).toEqual([s.id, "cell"]);
    fire("pointermove", ...at(on(1725, 40)));
    expect([input.hovered.value, canvas.style.cursor]).toEqual([null, "crosshair"]);
  });

  it("Esc takes it back, a click changes nothing", () => {
    const s = selected();
    stroke([on(1725, 150), on(2048, 450)], {}, false);
    window.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", code: "Escape" }));
    expect(only().curve).toEqual(s.curve);
    fire("pointerup", ...at(on(2048, 450)));
    fire("pointerdown", ...at(on(1725, 150)));
    fire("pointerup", ...at(on(1725, 150)));
    expect(only().curve).toEqual(s.curve);
    expect(input.selection.value).toBe(s.id);
  });

  it("never sinks a mountain below its anchors, and never starts on a locked stroke", () => {
    const s = selected();
    stroke([on(1725, 150), on(2048, -200), on(2375, 150)]);
    expect(Math.min(...only().curve.map(([, w]) => w))).toBeGreaterThanOrEqual(0);
    expect(redraws("mountain", { ...s, locked: true })).toBe(false);
    expect(redraws("plateau", s)).toBe(false);
    expect(redraws("plateau", { ...s, kind: "level" })).toBe(true);
  });

  it("redraws a plateau's outline", () => {
    c.goTo([2048, -800, 2900], [2048, 1800, 0], 0);
    place({
      kind: "level",
      first: [1500, 1500, 100],
      last: [2500, 1500, 100],
      curve: [
        [0, 0],
        [0, 0.5],
        [1, 0.5],
        [1, 0],
      ],
    });
    input.selection.value = "r";
    input.tool.value = "plateau";
    stroke([
      [1700, 2000, 100],
      [2000, 2300, 100],
      [2300, 2000, 100],
    ]);
    const most = Math.max(...only().curve.map(([, v]) => v));
    expect(most).toBeGreaterThan(0.75);
    expect(only().curve[0]).toEqual([0, 0]);
    expect(only().curve.at(-1)).toEqual([1, 0]);
  });
});

describe("splicing", () => {
  const old: CurvePoint[] = [0, 1, 2, 3, 4].map((i) => [i, 0]);
  const drawn: CurvePoint[] = [
    [1.5, 7],
    [2.5, 8],
  ];

  it("puts the new part between what stays", () => {
    expect(spliced(old, drawn, 1.5, 2.5, false)).toEqual([old[0], old[1], ...drawn, old[3], old[4]]);
    expect(spliced(old, drawn.toReversed(), 2.5, 1.5, false)).toEqual([old[0], old[1], ...drawn, old[3], old[4]]);
  });

  it("goes the shorter way round a closed outline", () => {
    const found = spliced(old, drawn, 0.5, 3.5, true);
    expect(found).toEqual([drawn[1], drawn[0], old[1], old[2], old[3], drawn[1]]);
  });
});
