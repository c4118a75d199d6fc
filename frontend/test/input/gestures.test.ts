// @vitest-environment happy-dom
// The camera by mouse, fingers and pen, with synthetic events (SPEC I47-I49).
import { describe, expect, it } from "vitest";
import { distance } from "../../src/core/math.ts";
import type { Ground, Vec3 } from "../../src/core/types.ts";
import { at, c, canvas, cursors, doc, fire, input, only, openForEach, PEAK, stroke, strokes } from "./hands.ts";
import { FLAT, SIZE } from "./scene.ts";

openForEach();

describe("the camera (SPEC I47)", () => {
  const eye = (): Vec3 => c.state.value.eye;

  it("right drag orbits, middle and Shift+right pan, Space+left pans, in every tool", () => {
    const moves = (init: PointerEventInit): { eye: number; height: number } => {
      const before = eye();
      stroke(
        [
          [2048, 1500, 0],
          [2300, 1400, 0],
        ],
        init,
      );
      expect(input.inputMode.value).toBe("idle");
      return { eye: distance(eye(), before), height: Math.abs(eye()[2] - before[2]) };
    };
    expect(moves({ button: 2 }).height).toBeGreaterThan(5);
    for (const init of [{ button: 1 }, { button: 2, shiftKey: true }]) {
      const { eye: moved, height } = moves(init);
      expect(moved).toBeCloseTo(Math.hypot(252, 100), 3);
      expect(height).toBeCloseTo(0, 9);
    }
    window.dispatchEvent(new KeyboardEvent("keydown", { key: " ", code: "Space" }));
    const before = c.state.value.target;
    stroke([
      [2048, 1500, 0],
      [2300, 1400, 0],
    ]);
    window.dispatchEvent(new KeyboardEvent("keyup", { key: " ", code: "Space" }));
    expect(distance(c.state.value.target, before)).toBeGreaterThan(20);
    expect(strokes()).toEqual([]);
  });

  it("panning keeps the grabbed ground under the pointer", () => {
    const p: Vec3 = [2300, 1400, 0];
    const [x, y] = at(p);
    fire("pointerdown", x, y, { button: 1 });
    fire("pointermove", x + 50, y + 4, { button: 1 });
    expect(c.project(p).x).toBeCloseTo(x + 50, 6);
    fire("pointerup", x + 50, y, { button: 1 });
  });

  it("the wheel zooms toward the pointer", () => {
    const p: Vec3 = [1500, 2000, 0];
    const [x, y] = at(p);
    const before = distance(eye(), p);
    const event = new WheelEvent("wheel", { deltaY: -100, cancelable: true });
    Object.defineProperties(event, { clientX: { value: 10 + x / 2 }, clientY: { value: 20 + y / 2 } });
    canvas.dispatchEvent(event);
    for (let i = 0; i < 100 && c.update(0.016, FLAT as Ground); i++);
    expect(distance(eye(), p)).toBeCloseTo(before / 1.22, 0);
    expect(c.project(p).x).toBeCloseTo(x, 3);
  });

  it("a double click flies there", () => {
    const p: Vec3 = [1500, 2000, 0];
    const [x, y] = at(p);
    const before = distance(eye(), c.state.value.target);
    canvas.dispatchEvent(new MouseEvent("dblclick", { clientX: 10 + x / 2, clientY: 20 + y / 2 }));
    for (let i = 0; i < 100 && c.update(0.016, FLAT as Ground); i++);
    expect(distance(c.state.value.target, p)).toBeLessThan(0.1);
    expect(distance(eye(), p)).toBeCloseTo(before / 2, 3);
  });

  it("the pointer's place on the ground is told, and that it has left", () => {
    fire("pointermove", ...at([1500, 2000, 0]));
    expect(distance(cursors.at(-1)!, [1500, 2000, 0])).toBeLessThan(0.1);
    fire("pointerleave", 0, 0);
    expect(cursors.at(-1)).toBeNull();
  });
});

describe("touch and pen (SPEC I48)", () => {
  const touch = (pointerId: number): PointerEventInit => ({ pointerType: "touch", pointerId });

  it("one finger draws until a pen is seen", () => {
    stroke(PEAK, touch(1));
    expect(strokes().length).toBe(1);
    stroke(
      [
        [1400, 1000, 0],
        [2400, 1000, 100],
      ],
      { pointerType: "pen", pointerId: 7, pressure: 0.5 },
    );
    expect(strokes().length).toBe(2);
    expect(input.fingerDraws.value).toBe(false);
    const before = c.state.value.eye;
    stroke(PEAK, touch(1));
    expect(strokes().length).toBe(2);
    expect(c.state.value.eye).not.toEqual(before);
  });

  it("a second finger cancels the stroke and pinches (SPEC I49)", () => {
    fire("pointerdown", 400, 500, touch(1));
    for (let k = 1; k < 10; k++) fire("pointermove", 400 + 8 * k, 500, touch(1));
    expect(strokes().length).toBe(1);
    fire("pointerdown", 700, 500, touch(2));
    expect(strokes()).toEqual([]);
    expect(input.inputMode.value).toBe("pinch");
    const [a, b] = [c.state.value.eye, c.metresPerPixelAt(c.state.value.target)];
    fire("pointermove", 300, 500, touch(1));
    fire("pointermove", 860, 500, touch(2));
    expect(c.state.value.eye).not.toEqual(a);
    expect(c.metresPerPixelAt(c.state.value.target)).toBeLessThan(b);
    fire("pointerup", 860, 500, touch(2));
    fire("pointermove", 350, 600, touch(1));
    fire("pointerup", 350, 600, touch(1));
    expect(input.inputMode.value).toBe("idle");
    expect(doc.canUndo.value === false || doc.undo().done === false).toBe(true);
  });

  it("twisting two fingers turns the view with them", () => {
    const heading = (): number => {
      const { eye, target } = c.state.value;
      return Math.atan2(target[0] - eye[0], target[1] - eye[1]);
    };
    const before = heading();
    fire("pointerdown", 400, 400, touch(1));
    fire("pointerdown", 600, 400, touch(2));
    // 10 degrees clockwise on the screen (y down): the ground turns clockwise, the camera against it.
    const r = (10 * Math.PI) / 180;
    fire("pointermove", 500 - 100 * Math.cos(r), 400 - 100 * Math.sin(r), touch(1));
    fire("pointermove", 500 + 100 * Math.cos(r), 400 + 100 * Math.sin(r), touch(2));
    expect(((heading() - before) * 180) / Math.PI).toBeCloseTo(-10, 0);
  });

  it("touch is ignored while a pen is down", () => {
    const pen: PointerEventInit = { pointerType: "pen", pointerId: 7, pressure: 0.5 };
    const before = c.state.value.eye;
    fire("pointerdown", ...at(PEAK[0]!), pen);
    fire("pointermove", ...at(PEAK[1]!), pen);
    for (const finger of [2, 3]) fire("pointerdown", 100 * finger, 100, touch(finger));
    for (const finger of [2, 3]) fire("pointermove", 300, 300 * finger, touch(finger));
    for (const finger of [2, 3]) fire("pointerup", 300, 300, touch(finger));
    fire("pointermove", ...at(PEAK[2]!), pen);
    fire("pointerup", ...at(PEAK[2]!), pen);
    expect(only().finished).toBe(true);
    expect(c.state.value.eye).toEqual(before);
  });

  it("pen pressure sets the extent of the flanks, whole at full pressure; a mouse leaves the default", () => {
    for (const [pressure, share] of [
      [1, 1],
      [0.5, 0.3],
      [0.2, 0.09],
    ] as const) {
      stroke(PEAK, { pointerType: "pen", pointerId: 7, pressure });
      expect(only().left!.extent_m).toBeCloseTo((share * SIZE) / 2, 0);
      expect(only().right).toEqual(only().left);
      doc.undo();
    }
    stroke(PEAK);
    expect(only().left!.extent_m).toBe(SIZE / 2);
  });

  it("a cancelled pointer gives the stroke up", () => {
    stroke(PEAK, touch(1), false);
    fire("pointercancel", 0, 0, touch(1));
    expect(strokes()).toEqual([]);
    expect(input.inputMode.value).toBe("idle");
  });
});
