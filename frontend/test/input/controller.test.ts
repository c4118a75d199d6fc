// @vitest-environment happy-dom
// What pointers do to the document and the camera, with synthetic events (SPEC I40-I52).
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { Camera } from "../../src/core/camera.ts";
import { distance, distanceXY } from "../../src/core/math.ts";
import type { Ground, Vec3 } from "../../src/core/types.ts";
import { worldPoints } from "../../src/doc/strokes.ts";
import { SyncDoc } from "../../src/doc/sync.ts";
import type { Op, Stroke } from "../../src/generated/contract.ts";
import { InputController, type InputOptions } from "../../src/input/controller.ts";
import { toolDefaults } from "../../src/input/defaults.ts";
import { type HandleKind, handlesOf } from "../../src/input/handles.ts";
import { EMPTY, ridge } from "../doc/model.ts";
import { camera, FLAT, groundOf, SIZE, SLOPE } from "./scene.ts";

type PointerType = "mouse" | "pen" | "touch";

let canvas: HTMLElement;
let c: Camera;
let doc: SyncDoc;
let input: InputController;
let messages: string[];
let cursors: (Vec3 | null)[];
let time: number;
let editable: boolean;

function open(mode: "orbit" | "map" = "orbit", over: Partial<InputOptions> = {}): void {
  canvas = document.createElement("div");
  // The page shows 500 x 400 CSS pixels for 1000 x 800 device pixels.
  canvas.getBoundingClientRect = () => ({ left: 10, top: 20, width: 500, height: 400 }) as DOMRect;
  document.body.append(canvas);
  c = camera(mode);
  time = 1_000_000;
  doc = new SyncDoc("me", () => time);
  doc.welcome({
    type: "welcome",
    protocol: 1,
    server: "",
    client: "me",
    role: "edit",
    colour: "#000000",
    levels: 4,
    finest: 4,
    clock: 0,
    document: EMPTY,
    ops: null,
    members: [],
    device: "",
  });
  messages = [];
  cursors = [];
  editable = true;
  input = new InputController({
    canvas,
    camera: c,
    doc,
    ground: () => FLAT,
    freeze: () => FLAT,
    clientId: "me",
    canEdit: () => editable,
    defaults: toolDefaults(SIZE),
    onCursor: (p) => cursors.push(p),
    onMessage: (m) => messages.push(m),
    now: () => time,
    ...over,
  });
}

/** A pointer event at a device pixel. */
function fire(type: string, x: number, y: number, init: PointerEventInit = {}): void {
  time += 20;
  vi.advanceTimersByTime(20);
  const at = { clientX: 10 + x / 2, clientY: 20 + y / 2 };
  canvas.dispatchEvent(
    new PointerEvent(type, {
      pointerId: 1,
      pointerType: "mouse",
      button: 0,
      bubbles: true,
      cancelable: true,
      ...at,
      ...init,
    }),
  );
}

function at(p: Vec3): [number, number] {
  const { x, y } = c.project(p);
  return [x, y];
}

/** Presses, moves in steps over world points, and releases unless told otherwise. */
function stroke(path: readonly Vec3[], init: PointerEventInit = {}, release = true): void {
  fire("pointerdown", ...at(path[0]!), init);
  for (let i = 1; i < path.length; i++) {
    const [a, b] = [at(path[i - 1]!), at(path[i]!)];
    for (let k = 1; k <= 10; k++)
      fire("pointermove", a[0] + ((b[0] - a[0]) * k) / 10, a[1] + ((b[1] - a[1]) * k) / 10, init);
  }
  if (release) fire("pointerup", ...at(path.at(-1)!), init);
}

const PEAK: readonly Vec3[] = [
  [1400, 1700, 0],
  [2048, 1700, 300],
  [2700, 1700, 0],
];
const strokes = (): Stroke[] => [...doc.doc.value!.strokes.values()];
const only = (): Stroke => {
  expect(strokes().length).toBe(1);
  return strokes()[0]!;
};

function place(over: Partial<Stroke> = {}): Stroke {
  const flank = { slope_deg: 35, extent_m: 512, shape: "concave" as const };
  const s = ridge("r", {
    first: [1400, 1700, 0],
    last: [2700, 1700, 0],
    curve: [
      [0, 0],
      [0.25, 150],
      [0.5, 300],
      [0.75, 150],
      [1, 0],
    ],
    left: flank,
    right: { ...flank },
    finished: true,
    ...over,
  });
  expect(doc.submit({ type: "stroke.begin", stroke: s })).toBeNull();
  return s;
}

function handle(kind: HandleKind) {
  return input.handles.value.find((h) => h.kind === kind)!;
}

beforeEach(() => {
  vi.useFakeTimers();
  open();
});

afterEach(() => {
  input.dispose();
  canvas.remove();
  vi.useRealTimers();
});

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
    editable = false;
    const before = c.state.value.eye;
    stroke(PEAK);
    stroke(PEAK);
    expect(strokes()).toEqual([]);
    expect(messages).toEqual(["This link lets you look, not draw. Ask for an edit link to change the terrain."]);
    expect(c.state.value.eye).not.toEqual(before);
  });

  it("a line that begins in the sky says so and moves the view", () => {
    fire("pointerdown", 500, 3);
    fire("pointermove", 560, 40);
    fire("pointerup", 560, 40);
    expect(messages).toEqual(["Begin the line on the ground."]);
    expect(strokes()).toEqual([]);
  });

  it("a stroke that somebody deletes under the pen ends with a message", () => {
    stroke(PEAK, {}, false);
    const { id } = only();
    const op: Op = { type: "stroke.delete", stroke: id };
    const out = doc.outgoing();
    doc.ack({ type: "ack", ids: out.map((o) => o.id), clocks: out.map((_, i) => i + 1) });
    doc.ordered({ type: "ordered", ops: [{ clock: out.length + 1, id: "you:1", author: "you", op }] });
    fire("pointermove", 700, 300);
    time += 40;
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
