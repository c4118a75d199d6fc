// SPEC I80-I83
// @vitest-environment happy-dom
import { signal } from "@preact/signals-core";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { centreOf, cornersOf, type GridPlace } from "../../src/core/lattice.ts";
import type { Vec3 } from "../../src/core/types.ts";
import type { GridHandleKind, Placing } from "../../src/input/tools/placement.ts";
import { at, fire, input, open, strokes } from "./hands.ts";

const SHAPE = { rows: 101, cols: 201 };
const START: GridPlace = { anchor: [1048, 1548], rotation_deg: 0, spacing_m: [10, 10], scale: 1, lift_m: 0 };

let laid: { place: GridPlace; gesture: string }[];
let ends: string[];

function hold(start: GridPlace = START): Placing {
  const place = signal(start);
  const placing: Placing = {
    id: "g",
    ...SHAPE,
    low_m: 0,
    high_m: 200,
    place,
    moveTo(next, gesture) {
      laid.push({ place: next, gesture });
      place.value = next;
      return null;
    },
    finish: () => ends.push("finish"),
    cancel: () => ends.push("cancel"),
  };
  input.placing.value = placing;
  return placing;
}

const handle = (kind: GridHandleKind) => input.handles.value.find((h) => h.kind === kind)!;

function drag(from: Vec3, to: Vec3, init: PointerEventInit = {}, release = true): void {
  const [a, b] = [at(from), at(to)];
  fire("pointerdown", ...a, init);
  for (let k = 1; k <= 10; k++)
    fire("pointermove", a[0] + ((b[0] - a[0]) * k) / 10, a[1] + ((b[1] - a[1]) * k) / 10, init);
  if (release) fire("pointerup", ...b, init);
}

const last = (): GridPlace => laid.at(-1)!.place;

beforeEach(() => {
  vi.useFakeTimers();
  laid = [];
  ends = [];
  open();
});
afterEach(() => {
  input.dispose();
  document.body.replaceChildren();
  vi.useRealTimers();
});

describe("a grid in hand", () => {
  it("has handles at its corners, in the middle, beyond its north edge and above", () => {
    hold();
    expect(input.handles.value.map((h) => h.kind)).toEqual([
      ...["grid-0", "grid-1", "grid-2", "grid-3", "grid-turn", "grid-move", "grid-lift"],
    ]);
    expect(handle("grid-2").position).toEqual([3048, 2548, 0]);
    expect(handle("grid-turn").position[1]).toBeGreaterThan(2548);
    expect(handle("grid-lift").position[2]).toBeGreaterThan(200);
  });

  it("cannot be lifted on the map", () => {
    input.dispose();
    open("map");
    hold();
    expect(input.handles.value.map((h) => h.kind)).not.toContain("grid-lift");
  });

  it("is moved by its middle and by its ground", () => {
    hold();
    drag(handle("grid-move").position, [2148, 1848, 0]);
    expect(last().anchor[0]).toBeCloseTo(1148, 0);
    expect(last().anchor[1]).toBeCloseTo(1348, 0);
    const before = last().anchor;
    drag([1700, 1700, 0], [1800, 1700, 0]);
    expect(last().anchor[0] - before[0]).toBeCloseTo(100, 0);
    expect(last()).toMatchObject({ rotation_deg: 0, spacing_m: [10, 10], lift_m: 0 });
    expect(strokes()).toEqual([]);
  });

  it("lets the view be turned beside it, with any tool", () => {
    input.tool.value = "mountain";
    hold();
    drag([3800, 500, 0], [3600, 600, 0]);
    expect(laid).toEqual([]);
    expect(strokes()).toEqual([]);
    expect(input.inputMode.value).toBe("idle");
  });

  it("scales about the corner across, in its proportions", () => {
    hold();
    drag(handle("grid-2").position, [2048, 2048, 0]);
    expect(last().anchor).toEqual([1048, 1548]);
    expect(last().spacing_m[0]).toBeCloseTo(5, 1);
    expect(last().spacing_m[1]).toBe(last().spacing_m[0]);
    drag(handle("grid-0").position, [1548, 1798, 0]);
    expect(cornersOf(SHAPE, last())[2]![0]).toBeCloseTo(2048, 0);
  });

  it("with Alt scales each way by itself, and never inside out", () => {
    hold();
    drag(handle("grid-2").position, [2048, 2548, 0], { altKey: true });
    expect(last().spacing_m[0]).toBeCloseTo(5, 1);
    expect(last().spacing_m[1]).toBeCloseTo(10, 1);
    drag(handle("grid-2").position, [400, 1200, 0]);
    expect(Math.min(...last().spacing_m)).toBeGreaterThan(0);
  });

  it("turns about its middle and snaps to right angles, not with Alt", () => {
    hold();
    const middle = centreOf(SHAPE, START);
    const radius = handle("grid-turn").position[1] - middle[1];
    const towards = (deg: number): Vec3 => {
      const a = ((deg + 90) * Math.PI) / 180;
      return [middle[0] + radius * Math.cos(a), middle[1] + radius * Math.sin(a), 0];
    };
    drag(handle("grid-turn").position, towards(27));
    expect(last().rotation_deg).toBeCloseTo(27, 0);
    expect(centreOf(SHAPE, last())[0]).toBeCloseTo(middle[0], 1);
    drag(handle("grid-turn").position, towards(1.8));
    expect(last().rotation_deg).toBe(0);
    drag(handle("grid-turn").position, towards(-40));
    drag(handle("grid-turn").position, towards(1.8), { altKey: true });
    expect(last().rotation_deg).toBeCloseTo(1.8, 0);
    expect(last().rotation_deg).not.toBe(0);
  });

  it("is lifted by the knob above it", () => {
    hold();
    const { position } = handle("grid-lift");
    drag(position, [position[0], position[1], position[2] + 150]);
    expect(last().lift_m).toBeCloseTo(150, -1);
    expect(last().anchor).toEqual(START.anchor);
  });

  it("is one gesture a drag, at most thirty places a second, and the last one arrives", () => {
    hold();
    drag(handle("grid-move").position, [2348, 2048, 0]);
    expect(new Set(laid.map((l) => l.gesture)).size).toBe(1);
    // Twelve events in 240 ms.
    expect(laid.length).toBeLessThanOrEqual(10);
    expect(last().anchor[0]).toBeCloseTo(1348, 0);
    drag(handle("grid-move").position, [2048, 2048, 0]);
    expect(new Set(laid.map((l) => l.gesture)).size).toBe(2);
  });

  it("goes back on Esc in the middle of a drag; then Esc gives it up", () => {
    hold();
    drag(handle("grid-move").position, [2348, 2048, 0], {}, false);
    expect(last().anchor[0]).not.toBe(1048);
    input.actions.get("cancel")!.run();
    expect(last()).toEqual(START);
    expect(ends).toEqual([]);
    input.actions.get("cancel")!.run();
    expect(ends).toEqual(["cancel"]);
  });

  it("obeys keys: Enter, arrows, < and >", () => {
    hold();
    input.actions.get("nudge-right")!.run();
    input.actions.get("nudge-right")!.run();
    expect(last().anchor[0]).toBeGreaterThan(1048 + 16);
    expect(new Set(laid.map((l) => l.gesture)).size).toBe(1);
    input.actions.get("turn-grid-left")!.run();
    expect(last().rotation_deg).toBe(1);
    input.actions.get("turn-grid-right")!.run();
    expect(last().rotation_deg).toBe(0);
    input.actions.get("set-point")!.run();
    expect(ends).toEqual(["finish"]);
    input.placing.value = null;
    input.tool.value = "select";
    expect(input.actions.get("set-point")!.enabled()).toBe(false);
  });

  it("does not select what lies under it", () => {
    hold();
    fire("pointerdown", ...at([2048, 2048, 0]));
    fire("pointerup", ...at([2048, 2048, 0]));
    expect(input.selection.value).toBeNull();
  });
});
