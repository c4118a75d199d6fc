// SPEC I70-I76
// @vitest-environment happy-dom
import { describe, expect, it, vi } from "vitest";
import type { Vec3 } from "../../src/core/types.ts";
import { fullStroke } from "../../src/doc/document.ts";
import { worldPoints } from "../../src/doc/strokes.ts";
import { drape, drapedOf, pickStroke } from "../../src/input/picking.ts";
import {
  BrushSketch,
  brushRadius,
  PAINT_CHANNELS,
  pressedPaint,
  radiusRange,
} from "../../src/input/tools/painttool.ts";
import {
  at,
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
  stroke,
  strokes,
} from "./hands.ts";
import { camera, groundOf, SIZE, SLOPE, sampleAt, sampleOf } from "./scene.ts";

const LINE: readonly Vec3[] = [
  [1500, 1400, 0],
  [2048, 1800, 0],
  [2600, 1500, 0],
];

const paint = () => input.actions.get("paint")!.run();

describe("the brush", () => {
  openForEach();

  it("draws a line on the ground that carries its paint, in one step of undo", () => {
    paint();
    stroke(LINE);
    const s = only();
    expect(s).toMatchObject({ kind: "paint", finished: true, left: null, right: null, amplitude_m: 0 });
    expect(s.paint).toEqual({ channel: "snow", value: 0.8, radius_m: brushRadius(SIZE / 40, SIZE) });
    const points = worldPoints(s);
    for (const corner of LINE) {
      let nearest = Infinity;
      for (let i = 0; i < points.length; i += 3)
        nearest = Math.min(nearest, Math.hypot(points[i]! - corner[0], points[i + 1]! - corner[1]));
      expect(nearest).toBeLessThan(30);
    }
    expect(input.selection.value).toBeNull();
    doc.undo();
    expect(strokes()).toEqual([]);
  });

  it("is seen while it moves: the stroke is there before the pointer is up", () => {
    paint();
    stroke(LINE, {}, false);
    expect(only().finished).toBe(false);
    expect(only().curve.length).toBeGreaterThan(2);
    expect(input.drawing.value).toBe(only().id);
    expect(input.ghost.value).toBeNull();
  });

  it("leaves a dab at a click, but takes the line of paint that is there", () => {
    paint();
    const [x, y] = at([2048, 1700, 0]);
    fire("pointerdown", x, y);
    fire("pointerup", x, y);
    const dab = only();
    expect(dab).toMatchObject({ kind: "paint", finished: true });
    expect(dab.curve.length).toBe(2);
    const points = worldPoints(dab);
    expect(Math.hypot(points[0]! - 2048, points[1]! - 1700)).toBeLessThan(2);
    input.selection.value = null;
    fire("pointerdown", x, y);
    fire("pointerup", x, y);
    expect(only().id).toBe(dab.id);
    expect(input.selection.value).toBe(dab.id);
    doc.undo();
    expect(strokes()).toEqual([]);
  });

  it("takes away with Alt, and with the other end of a pen", () => {
    paint();
    stroke(LINE, { altKey: true });
    expect(only().paint!.value).toBe(-0.8);
    doc.undo();
    stroke(LINE, { pointerType: "pen", button: 5, pressure: 0.5 });
    expect(only().paint!.value).toBe(-0.8);
  });

  it("is as wide as a pen is pressed", () => {
    paint();
    const wide = input.actions && brushRadius(SIZE / 40, SIZE);
    stroke(LINE, { pointerType: "pen", pressure: 1 });
    expect(only().paint!.radius_m).toBeGreaterThan(1.2 * wide);
    doc.undo();
    stroke(LINE, { pointerType: "pen", pressure: 0.05 });
    expect(only().paint!.radius_m).toBeLessThan(0.5 * wide);
  });

  it("is for those who may draw", () => {
    lookOnly();
    paint();
    stroke(LINE);
    expect(strokes()).toEqual([]);
    expect(messages[0]).toMatch(/edit link/);
  });

  it("is a finger where a finger draws; a second finger takes the line back and moves the view", () => {
    paint();
    stroke(LINE, { pointerType: "touch" });
    expect(only().kind).toBe("paint");
    doc.undo();
    stroke(LINE, { pointerType: "touch", pointerId: 1 }, false);
    expect(strokes().length).toBe(1);
    fire("pointerdown", 200, 200, { pointerType: "touch", pointerId: 2 });
    expect(strokes()).toEqual([]);
    fire("pointerup", 200, 200, { pointerType: "touch", pointerId: 2 });
    fire("pointerup", 300, 200, { pointerType: "touch", pointerId: 1 });
    input.fingerDraws.value = false;
    stroke(LINE, { pointerType: "touch" });
    expect(strokes()).toEqual([]);
  });

  it("is given up with Escape", () => {
    paint();
    stroke(LINE, {}, false);
    input.actions.get("cancel")!.run();
    expect(strokes()).toEqual([]);
  });

  it("begins on the ground", () => {
    paint();
    fire("pointerdown", 500, 2);
    fire("pointermove", 600, 4);
    expect(strokes()).toEqual([]);
    expect(messages).toEqual(["Begin the line on the land."]);
  });
});

describe("keys of the brush", () => {
  openForEach();
  const run = (id: string) => input.actions.get(id)!.run();

  it("change the next paint, and the selected one as one step of undo", () => {
    paint();
    run("brush-larger");
    run("brush-weaker");
    run("brush-channel");
    run("brush-opposite");
    stroke(LINE);
    input.selection.value = only().id;
    const radius = brushRadius(brushRadius(SIZE / 40, SIZE) * 1.25, SIZE);
    expect(only().paint).toEqual({ channel: "forest", value: -0.7, radius_m: radius });
    pass(2000);
    run("brush-smaller");
    run("brush-smaller");
    run("brush-stronger");
    expect(only().paint!.radius_m).toBeLessThan(0.7 * radius);
    expect(only().paint!.value).toBe(-0.8);
    doc.undo();
    expect(only().paint).toEqual({ channel: "forest", value: -0.7, radius_m: radius });
  });

  it("belong to paint: with other tools, and for locked strokes, they do nothing", () => {
    for (const id of [
      "brush-smaller",
      "brush-larger",
      "brush-weaker",
      "brush-stronger",
      "brush-channel",
      "brush-opposite",
    ])
      expect(input.actions.get(id)!.enabled()).toBe(false);
    paint();
    stroke(LINE);
    input.selection.value = only().id;
    expect(input.actions.get("brush-larger")!.enabled()).toBe(true);
    run("lock");
    expect(input.actions.get("brush-larger")!.enabled()).toBe(false);
  });

  it("stay within what a brush can be", () => {
    paint();
    for (let i = 0; i < 40; i++) run("brush-larger");
    for (let i = 0; i < 20; i++) run("brush-stronger");
    stroke(LINE);
    expect(only().paint!.value).toBe(1);
    expect(Math.abs(only().paint!.radius_m / radiusRange(SIZE)[1] - 1)).toBeLessThan(0.01);
  });

  it("go through all channels and come back", () => {
    paint();
    const seen = PAINT_CHANNELS.map(() => {
      run("brush-channel");
      stroke(LINE);
      return strokes().at(-1)!.paint!.channel;
    });
    expect(new Set(seen).size).toBe(PAINT_CHANNELS.length);
    expect(seen.at(-1)).toBe("snow");
  });
});

describe("a line of paint", () => {
  openForEach();

  it("is moved, duplicated, locked, hidden and deleted like any stroke; it has no flanks and no height", () => {
    paint();
    stroke(LINE);
    const { id, first } = only();
    input.selection.value = id;
    expect(input.actions.get("mirror")!.enabled()).toBe(false);
    expect(input.actions.get("raise")!.enabled()).toBe(false);
    input.actions.get("nudge-right")!.run();
    expect(only().first[0]).toBeGreaterThan(first[0]);
    input.actions.get("duplicate")!.run();
    expect(strokes().length).toBe(2);
    expect(strokes()[1]!.paint).toEqual(strokes()[0]!.paint);
    input.actions.get("hide")!.run();
    expect(strokes()[1]!.hidden).toBe(true);
    input.actions.get("delete")!.run();
    expect(strokes().map((s) => s.id)).toEqual([id]);
  });

  it("has handles on the ground: its rim changes the radius", () => {
    paint();
    stroke(LINE);
    input.tool.value = "select";
    input.selection.value = only().id;
    const all = ["first", "last", "move", "radius"];
    expect(input.handles.value.map((h) => h.kind).sort()).toEqual(all);
    input.tool.value = "mountain";
    expect(input.handles.value).toEqual([]);
    paint();
    expect(input.handles.value.map((h) => h.kind).sort()).toEqual(all);
    const { radius_m } = only().paint!;
    const rim = handle("radius").position;
    const middle = handle("move").position;
    expect(Math.hypot(rim[0] - middle[0], rim[1] - middle[1])).toBeCloseTo(radius_m, 0);
    const to: Vec3 = [middle[0] + 2 * (rim[0] - middle[0]), middle[1] + 2 * (rim[1] - middle[1]), 0];
    stroke([rim, to]);
    expect(only().paint!.radius_m).toBeGreaterThan(1.9 * radius_m);
    expect(only().paint!.radius_m).toBeLessThan(2.1 * radius_m);
  });

  it("is taken by a click after the land's strokes, and not by the tools that draw land", () => {
    paint();
    stroke(LINE);
    const { id } = only();
    const [x, y] = at([...LINE[1]!.slice(0, 2), 0] as unknown as Vec3);
    const click = (tool: "select" | "mountain"): string | null => {
      input.selection.value = null;
      input.tool.value = tool;
      fire("pointerdown", x, y);
      fire("pointerup", x, y);
      return input.selection.value;
    };
    expect(click("select")).toBe(id);
    expect(click("mountain")).toBeNull();
    input.actions.get("mountain")!.run();
    stroke([PEAK[0]!, LINE[1]!, PEAK[2]!]);
    const ridge = strokes().find((s) => s.kind === "profile")!;
    expect(click("select")).toBe(ridge.id);
  });
});

describe("where paint lies", () => {
  it("is on the ground as it is drawn; its anchors and its line are on the solved one", () => {
    const shown = { ...groundOf((_x, y) => 0.1 * y + 7), solvedAt: (_x: number, y: number) => 0.1 * y };
    vi.useFakeTimers();
    open("orbit", { ground: () => shown, freeze: () => shown });
    try {
      paint();
      const on = (p: Vec3): Vec3 => [p[0], p[1], shown.heightAt(p[0], p[1])];
      stroke(LINE.map(on));
      const s = only();
      for (const anchor of [s.first, s.last]) expect(anchor[2]).toBeCloseTo(0.1 * anchor[1], 0);
      expect(Math.hypot(s.first[0] - LINE[0]![0], s.first[1] - LINE[0]![1])).toBeLessThan(3);
      const { points } = drapedOf(s, shown);
      expect(points.length).toBeGreaterThan(3 * 30);
      for (let i = 0; i < points.length; i += 3) expect(points[i + 2]).toBeCloseTo(0.1 * points[i + 1]!, 6);
      expect(drapedOf(s, shown)).toBe(drapedOf(s, shown));
    } finally {
      input.dispose();
      canvas.remove();
      vi.useRealTimers();
    }
  });

  it("is picked there, on a slope too", () => {
    const s = fullStroke({
      id: "p",
      kind: "paint",
      first: [1500, 3000, 0],
      last: [2600, 3000, 0],
      curve: [
        [0, 0],
        [1, 0],
      ],
      paint: { channel: "snow", value: 1, radius_m: 50 },
    });
    const cam = camera();
    const all = { strokes: new Map([["p", s]]) } as never;
    const p = cam.project([2048, 3000, 300]);
    expect(pickStroke(all, cam, SLOPE, p.x, p.y, 6)?.stroke.id).toBe("p");
    const under = cam.project([2048, 3000, 0]);
    expect(pickStroke(all, cam, SLOPE, under.x, under.y, 6)).toBeNull();
    expect(pickStroke(all, cam, SLOPE, p.x, p.y, 6, ["land"])).toBeNull();
  });

  it("does not jump over a crest to the far ground", () => {
    const wall = groundOf((_x, y) => (y > 1500 && y < 1600 ? 400 : 0));
    const cam = camera();
    cam.goTo([2048, 900, 60], [2048, 1500, 60], 0);
    const start = {
      camera: cam,
      ground: wall,
      hit: [2048, 1200, 0] as Vec3,
      sample: sampleOf(cam, [2048, 1200, 0]),
      nowMs: 0,
    };
    const sketch = new BrushSketch(start);
    sketch.add(sampleOf(cam, [2100, 1250, 0]));
    sketch.add({ ...sampleOf(cam, [2100, 1250, 0]), ray: { origin: [2048, 900, 1000], dir: [0, 1, -0.2] } });
    const { points } = sketch.shape(0, true, 100);
    expect(points.length).toBe(6);
    for (let i = 1; i < points.length; i += 3) expect(points[i]).toBeLessThan(1600);
  });

  it("keeps the bends that a straight line on the screen makes over a hill", () => {
    const hill = groundOf((x, y) => 500 * Math.exp(-((x - 2048) ** 2 + (y - 1800) ** 2) / 160_000));
    const cam = camera();
    const on = (x: number, y: number): Vec3 => [x, y, hill.heightAt(x, y)];
    const [a, b] = [cam.project(on(1500, 1500)), cam.project(on(2600, 1500))];
    const path = Array.from({ length: 40 }, (_, k) =>
      sampleAt(cam, a.x + ((b.x - a.x) * k) / 39, a.y + ((b.y - a.y) * k) / 39),
    );
    const sketch = new BrushSketch({ camera: cam, ground: hill, hit: on(1500, 1500), sample: path[0]!, nowMs: 0 });
    for (const sample of path.slice(1)) sketch.add(sample);
    const { points } = sketch.shape(0, true, 100);
    expect(points.length).toBeGreaterThan(3 * 5);
    const ys = [...points].filter((_, i) => i % 3 === 1);
    expect(Math.max(...ys) - Math.min(...ys)).toBeGreaterThan(50);
  });

  it("follows the ground in steps, however far apart its points are", () => {
    const line = drape([0, 0, 0, 100, 0, 0], 10, (x) => x * x);
    expect(line.length).toBe(33);
    expect([...line.slice(3, 6)]).toEqual([10, 0, 100]);
    expect(drape([0, 0, 0, 1e9, 0, 0], 1, () => 0).length).toBeLessThan(1000);
  });
});

describe("pressure", () => {
  it("is in the radius, never in what is painted", () => {
    const base = { channel: "snow" as const, value: 0.5, radius_m: 100 };
    expect(pressedPaint(base, 1)).toEqual({ ...base, radius_m: 125 });
    expect(pressedPaint(base, 0)).toEqual({ ...base, radius_m: 35 });
  });
});
