// @vitest-environment happy-dom
// Drawing with the keys alone (SPEC I65).
import { describe, expect, it } from "vitest";
import { distance } from "../../src/core/math.ts";
import { type Pixel, through } from "../../src/input/sketch/spline.ts";
import { at, c, cursors, doc, fire, input, lookOnly, messages, only, openForEach, pass, strokes } from "./hands.ts";

openForEach();

function press(key: string, times = 1, init: KeyboardEventInit = {}): void {
  for (let i = 0; i < times; i++) {
    pass(40);
    window.dispatchEvent(new KeyboardEvent("keydown", { key, code: key, cancelable: true, ...init }));
  }
}

const pen = (): Pixel => input.keyPen.visual.value!.at;

/** Left foot, summit, right foot: pen up by 6 steps of 20 pixels in the middle. */
function silhouette(): void {
  press("Enter", 2);
  press("ArrowRight", 6);
  press("ArrowUp", 6);
  press("Enter");
  press("ArrowRight", 6);
  press("ArrowDown", 6);
  press("Enter");
}

describe("the pen of the arrow keys (SPEC I65)", () => {
  it("draws a mountain from three points, as one step of undo", () => {
    press("Enter");
    expect(pen()).toEqual([500, 440]);
    expect(input.keyPen.words.value).toContain("Enter begins");
    press("ArrowLeft", 3);
    const foot: Pixel = pen();
    expect(foot).toEqual([440, 440]);
    press("Enter");
    press("ArrowRight", 6);
    press("ArrowUp", 6);
    expect(only().finished).toBe(false); // it rises while the pen moves
    expect(input.ghost.value).not.toBeNull();
    press("Enter");
    expect(input.keyPen.visual.value!.points.length).toBe(2);
    press("ArrowRight", 6);
    press("ArrowDown", 6);
    press("Enter", 2);
    const s = only();
    expect(s.finished).toBe(true);
    expect(distance([...at(s.first), 0], [440, 440, 0])).toBeLessThan(1.5);
    expect(distance([...at(s.last), 0], [680, 440, 0])).toBeLessThan(1.5);
    expect(Math.max(...s.curve.map(([, w]) => w))).toBeGreaterThan(100);
    expect(input.selection.value).toBe(s.id);
    expect(input.keyPen.visual.value).toBeNull();
    doc.undo();
    expect(strokes()).toEqual([]);
    expect(doc.canUndo.value).toBe(false);
  });

  it("moves finely with Shift and stays in the picture", () => {
    press("Enter");
    press("ArrowUp", 1, { shiftKey: true });
    expect(pen()).toEqual([500, 438]);
    press("ArrowLeft", 100);
    expect(pen()[0]).toBe(0);
    expect(cursors.at(-1)).not.toBeNull();
  });

  it("Backspace and Ctrl+Z take points back, Esc gives the line up, Esc again puts the pen away", () => {
    silhouette();
    expect(input.keyPen.visual.value!.points.length).toBe(3);
    press("Backspace");
    expect(input.keyPen.visual.value!.points.length).toBe(2);
    expect(pen()).toEqual(input.keyPen.visual.value!.points[1]);
    press("z", 1, { ctrlKey: true, code: "KeyZ" });
    expect(input.keyPen.visual.value!.points.length).toBe(1);
    press("Escape");
    expect(strokes()).toEqual([]);
    expect(doc.undo().done).toBe(false);
    expect(input.keyPen.visual.value).not.toBeNull();
    press("Escape");
    expect(input.keyPen.visual.value).toBeNull();
  });

  it("another hand ends the line at its last point", () => {
    silhouette();
    press("ArrowUp", 9);
    fire("pointerdown", ...at([2048, 700, 0]));
    fire("pointerup", ...at([2048, 700, 0]));
    const s = only();
    expect(s.finished).toBe(true);
    const { y } = c.project(s.last);
    expect(Math.abs(y - 440)).toBeLessThan(1.5);
    expect(input.keyPen.visual.value).toBeNull();
  });

  it("swallows other keys while a line is under way and says so; before, the view moves as usual", () => {
    press("Enter");
    const before = c.state.value;
    press(",", 1, { code: "Comma" });
    expect(c.state.value).not.toEqual(before);
    const turned = c.state.value;
    press("Enter");
    press(".", 1, { code: "Period" });
    expect(c.state.value).toEqual(turned);
    expect(messages.at(-1)).toContain("under way");
  });

  it("a tool taken meanwhile gives the line up, the select tool puts the pen away", () => {
    silhouette();
    input.tool.value = "plateau";
    expect(strokes()).toEqual([]);
    expect(input.keyPen.visual.value).not.toBeNull();
    input.tool.value = "select";
    expect(input.keyPen.visual.value).toBeNull();
    press("Enter");
    expect(input.keyPen.visual.value).toBeNull();
  });

  it("a brush leaves a dab where Enter is pressed twice; a mountain wants a movement first", () => {
    press("Enter", 3);
    expect(messages.at(-1)).toContain("Move the pen");
    press("Escape", 2);
    input.tool.value = "paint";
    press("Enter", 3);
    expect(only().kind).toBe("paint");
    expect(only().finished).toBe(true);
  });

  it("is nothing for people who may only look, and above the horizon nothing begins", () => {
    press("Enter");
    press("ArrowUp", 40);
    press("Enter");
    expect(messages.at(-1)).toContain("Begin the line on the land");
    press("Escape");
    lookOnly();
    press("Enter");
    expect(input.keyPen.visual.value).toBeNull();
  });

  it("draws on the map too", () => {
    input.actions.get("camera-map")!.run();
    silhouette();
    press("Enter");
    expect(only().kind).toBe("profile");
    expect(Math.max(...only().curve.map(([, w]) => w))).toBeGreaterThan(50);
  });
});

describe("the line through the points", () => {
  it("passes through each, without loops, with samples of 6 pixels", () => {
    const points: Pixel[] = [
      [0, 0],
      [100, -80],
      [110, 5],
      [300, 0],
    ];
    const line = through(points);
    for (const p of points) expect(line.some(([x, y]) => Math.hypot(x - p[0], y - p[1]) < 1e-9)).toBe(true);
    for (let i = 1; i < line.length; i++)
      expect(Math.hypot(line[i]![0] - line[i - 1]![0], line[i]![1] - line[i - 1]![1])).toBeLessThan(14);
    expect(Math.min(...line.map(([, y]) => y))).toBeGreaterThan(-100);
  });

  it("is straight between two, and a point that repeats counts once", () => {
    const line = through([
      [0, 0],
      [0, 0],
      [60, 30],
    ]);
    for (const [x, y] of line) expect(y).toBeCloseTo(x / 2, 9);
    expect(through([[5, 5]])).toEqual([[5, 5]]);
  });
});
