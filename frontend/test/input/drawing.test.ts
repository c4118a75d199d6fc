// @vitest-environment happy-dom
// What pointers draw, with synthetic events (SPEC I40-I43, I53).
import { effect } from "@preact/signals-core";
import { describe, expect, it, vi } from "vitest";
import { distance } from "../../src/core/math.ts";
import type { Vec3 } from "../../src/core/types.ts";
import type { Op } from "../../src/generated/contract.ts";
import {
  at,
  c,
  canvas,
  doc,
  fire,
  handle,
  input,
  lookOnly,
  messages,
  only,
  open,
  openForEach,
  PEAK,
  pass,
  place,
  stroke,
  strokes,
} from "./hands.ts";
import { FLAT, groundOf, SIZE, SLOPE } from "./scene.ts";

openForEach();

describe("drawing", () => {
  it("a mountain appears while it is drawn and is finished on release (SPEC I40)", () => {
    stroke(PEAK, {}, false);
    const live = only();
    expect(live.finished).toBe(false);
    expect(input.drawing.value).toBe(live.id);
    expect(input.ghost.value?.corners.length).toBe(4);
    expect(input.ink.value!.points.length).toBe(21);
    expect(live.curve.length).toBeGreaterThan(2);
    fire("pointerup", ...at(PEAK.at(-1)!));
    const s = only();
    expect(s.finished).toBe(true);
    expect(s.kind).toBe("profile");
    expect(distance(s.first, [1400, 1700, 0])).toBeLessThan(2);
    expect(distance(s.last, [2700, 1700, 0])).toBeLessThan(2);
    expect(Math.max(...s.curve.map(([, w]) => w))).toBeGreaterThan(280);
    expect(s.left).toEqual({ slope_deg: 35, extent_m: SIZE / 2, shape: "concave" });
    expect(input.selection.value).toBe(s.id);
    expect(input.drawing.value).toBeNull();
    expect(input.ghost.value).toBeNull();
  });

  it("never shows ink of a new stroke without its name: that is how a line over an old one is told apart", () => {
    const seen: boolean[] = [];
    const stop = effect(() => void seen.push(input.ink.value !== null && input.drawing.value === null));
    stroke(PEAK);
    stop();
    expect(seen.length).toBeGreaterThan(3);
    expect(seen).not.toContain(true);
  });

  it("is one step of undo", () => {
    stroke(PEAK);
    doc.undo();
    expect(strokes()).toEqual([]);
    expect(doc.canUndo.value).toBe(false);
  });

  it("submits at most every 33 ms", () => {
    let ops = 0;
    const submit = doc.submit.bind(doc);
    vi.spyOn(doc, "submit").mockImplementation((op: Op, gesture?: string) => {
      if (op.type === "stroke.append") ops++;
      return submit(op, gesture);
    });
    stroke(PEAK, {}, false); // 21 events, 20 ms apart: 420 ms
    expect(ops).toBeGreaterThan(5);
    expect(ops).toBeLessThanOrEqual(14);
  });

  it("a click without movement selects or deselects and draws nothing (SPEC I41)", () => {
    const s = place();
    fire("pointerdown", ...at([2048, 1700, 300]));
    fire("pointermove", at([2048, 1700, 300])[0] + 5, at([2048, 1700, 300])[1]);
    fire("pointerup", ...at([2048, 1700, 300]));
    expect(input.selection.value).toBe(s.id);
    fire("pointerdown", ...at([2048, 900, 0]));
    fire("pointerup", ...at([2048, 900, 0]));
    expect(input.selection.value).toBeNull();
    expect(strokes().length).toBe(1);
  });

  it("Escape gives the stroke up and leaves nothing to undo (SPEC I42)", () => {
    stroke(PEAK, {}, false);
    window.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", code: "Escape" }));
    expect(strokes()).toEqual([]);
    fire("pointermove", 600, 300);
    fire("pointerup", 600, 300);
    expect(strokes()).toEqual([]);
    expect(doc.undo().done).toBe(false);
  });

  it("plateaux lie level; crevices dig", () => {
    input.tool.value = "plateau";
    stroke([
      [1400, 1500, 0],
      [2400, 1900, 0],
    ]);
    const p = only();
    expect([p.kind, p.plateau_radius_m, p.left?.slope_deg]).toEqual(["level", SIZE / 40, 30]);
    input.tool.value = "crevice";
    stroke([
      [1400, 1000, 0],
      [2048, 1000, -120],
      [2600, 1000, 0],
    ]);
    const s = strokes()[1]!;
    expect(Math.min(...s.curve.map(([, w]) => w))).toBeLessThan(-90);
    expect(s.left?.slope_deg).toBe(50);
  });

  it.each([
    ["mountain", "up into the air"],
    ["crevice", "as a hollow"],
  ] as const)(
    "a straight %s along the ground comes to hand with a word; one with a shape does not (SPEC I53)",
    (tool, word) => {
      input.tool.value = tool;
      const side = tool === "mountain" ? 1 : -1;
      stroke([
        [1400, 1000, 0],
        [2048, 1000, side * 120],
        [2600, 1000, 0],
      ]);
      expect([messages, input.tool.value]).toEqual([[], tool]);
      stroke([
        [1400, 2000, 0],
        [2000, 2000, side * 6],
        [2600, 2000, 0],
      ]);
      expect(messages).toEqual([expect.stringContaining(word)]);
      expect(input.tool.value).toBe("select");
      expect(input.selection.value).toBe(strokes()[1]!.id);
      expect(input.handles.value.map((h) => h.kind)).toContain("crest");
    },
  );

  it("a plateau level with the ground comes to hand with a word on what to do; its handle raises it (SPEC I53)", () => {
    input.tool.value = "plateau";
    stroke([
      [1400, 1500, 0],
      [2400, 1900, 0],
    ]);
    expect(messages).toEqual(["This plateau lies level with the ground. Drag its handle up to raise it."]);
    expect(input.tool.value).toBe("select");
    expect(input.selection.value).toBe(only().id);
    const crest = handle("crest");
    expect(crest.position[2]).toBeCloseTo(0, 3);
    expect(input.handles.value.map((h) => h.kind)).not.toContain("left");
    const [x, y] = at(crest.position);
    fire("pointerdown", x, y);
    fire("pointermove", x, y - 10);
    fire("pointermove", x, y - 60);
    fire("pointermove", x, y - 60);
    const live = only();
    expect(live.first[2]).toBeGreaterThan(20);
    expect(live.last[2]).toBe(live.first[2]);
    fire("pointermove", x, y - 120);
    fire("pointermove", x, y - 120);
    expect(only().first[2]).toBeGreaterThan(1.7 * live.first[2]);
    fire("pointerup", x, y - 120);
    expect(input.handles.value.map((h) => h.kind)).toContain("left");
    expect(input.handles.value.map((h) => h.label)).toContain(`Height ${Math.round(only().first[2])} m`);
  });

  it("a plateau that stands out of the ground stays with its tool", () => {
    input.dispose();
    open("orbit", { freeze: () => SLOPE, ground: () => SLOPE });
    input.tool.value = "plateau";
    const on = ([x, y]: readonly [number, number]): Vec3 => [x, y, SLOPE.heightAt(x, 1500)];
    stroke([on([1400, 1500]), on([2000, 1900])]);
    expect(only().kind).toBe("level");
    expect(messages).toEqual([]);
    expect(input.tool.value).toBe("plateau");
  });

  it("on the map a mountain is a ridge", () => {
    input.dispose();
    open("map");
    stroke([
      [1000, 1000, 0],
      [2000, 1000, 0],
    ]);
    expect(Math.max(...only().curve.map(([, w]) => w))).toBeCloseTo(250, 0);
  });

  it("all coalesced positions are used, predicted ones only for ink", () => {
    fire("pointerdown", ...at(PEAK[0]!));
    const extra = [at([1500, 1700, 200]), at([2000, 1700, 10])].map(
      ([x, y]) => new PointerEvent("pointermove", { clientX: 10 + x / 2, clientY: 20 + y / 2 }),
    );
    const event = new PointerEvent("pointermove", {
      pointerId: 1,
      clientX: extra[1]!.clientX,
      clientY: extra[1]!.clientY,
    });
    Object.assign(event, { getCoalescedEvents: () => extra, getPredictedEvents: () => [extra[0]!] });
    canvas.dispatchEvent(event);
    expect(input.ink.value!.points.length).toBe(3);
    expect(input.ink.value!.predicted.length).toBe(1);
    fire("pointerup", ...at([2000, 1700, 10]));
    expect(Math.max(...only().curve.map(([, w]) => w))).toBeGreaterThan(150);
  });

  it("a view-only link looks and is told once (SPEC I43)", () => {
    lookOnly();
    const before = c.state.value.eye;
    stroke(PEAK);
    stroke(PEAK);
    expect(strokes()).toEqual([]);
    expect(messages).toEqual(["This link lets you look, not draw. Ask for an edit link to change the terrain."]);
    expect(c.state.value.eye).not.toEqual(before);
  });

  it("a line that begins in the sky or far beside the land is refused in place: the view stays (SPEC I312)", () => {
    const before = c.state.value;
    for (const type of ["mouse", "touch"] as const)
      for (const [x, y] of [[500, 3], at([-1500, 1700, 0])] as const) {
        fire("pointerdown", x, y, { pointerType: type });
        fire("pointermove", x + 60, y + 40, { pointerType: type });
        fire("pointermove", x + 200, y + 40, { pointerType: type });
        fire("pointerup", x + 200, y + 40, { pointerType: type });
      }
    expect(messages).toEqual(Array(4).fill("Begin the line on the land."));
    expect(strokes()).toEqual([]);
    expect(c.state.value).toBe(before);
  });

  it("a view that is on its way somewhere stays when a line begins (SPEC I312)", () => {
    c.goTo([2048, -900, 950], [2048, 1900, 0], 400);
    c.update(0.1, FLAT);
    expect(c.moving).toBe(true);
    const before = c.state.value.eye;
    stroke(PEAK, {}, false);
    expect(c.moving).toBe(false);
    c.update(0.1, FLAT);
    expect(c.state.value.eye).toEqual(before);
  });

  it("a line that begins just beside the land begins at its border (SPEC I312)", () => {
    c.goTo([2048, -4500, 2500], [2048, 1800, 0], 0);
    const before = c.state.value;
    for (const beside of [
      [-60, 1700, 0],
      [SIZE + 60, 1700, 0],
    ] as const)
      stroke([beside, [2048, 1700, 400], [2048 + (beside[0] < 0 ? 900 : -900), 1700, 0]]);
    expect(strokes().length).toBe(2);
    expect(strokes().map((s) => Math.round(s.first[0]))).toEqual([
      Math.round(SIZE / 1000),
      Math.round(SIZE - SIZE / 1000),
    ]);
    for (const s of strokes()) expect(Math.abs(s.first[1] - 1700)).toBeLessThan(15);
    expect(messages).toEqual([]);
    expect(c.state.value).toBe(before);
  });

  it("a line that begins on the face where the land is cut off begins at the border right above (SPEC I312)", () => {
    // What somebody else draws may lift the border between the pen and the place it aims at.
    const high = groundOf((_x, y) => 700 - y / 10);
    input.dispose();
    open("orbit", { freeze: () => high, ground: () => high });
    c.goTo([180, -3000, 1040], [2400, 1740, -450], 0);
    stroke([
      [2060, 0, 640],
      [2048, 1700, 900],
      [2700, 1700, 530],
    ]);
    expect(messages).toEqual([]);
    const [x, y] = only().first;
    expect(Math.abs(x - 2060)).toBeLessThan(15);
    expect(y).toBeCloseTo(SIZE / 1000, 0);
  });

  it("a stroke that somebody deletes under the pen ends with a message", () => {
    stroke(PEAK, {}, false);
    const { id } = only();
    const op: Op = { type: "stroke.delete", stroke: id };
    const out = doc.outgoing();
    doc.ack({ type: "ack", ids: out.map((o) => o.id), clocks: out.map((_, i) => i + 1) });
    doc.ordered({ type: "ordered", ops: [{ clock: out.length + 1, id: "you:1", author: "you", op }] });
    fire("pointermove", 700, 300);
    pass(40);
    fire("pointermove", 720, 300);
    expect(messages.length).toBe(1);
    expect(input.drawing.value).toBeNull();
    fire("pointerup", 720, 300);
    expect(strokes()).toEqual([]);
  });

  it("a long scribble stays within the limits of the wire", () => {
    fire("pointerdown", 300, 500);
    for (let i = 0; i < 900; i++) fire("pointermove", 300 + (i % 400) + (i % 2), 500 - ((i * 7) % 260));
    fire("pointerup", 600, 500);
    expect(messages).toEqual([]);
    expect(only().curve.length).toBeLessThanOrEqual(2048);
    expect(only().finished).toBe(true);
  });
});
