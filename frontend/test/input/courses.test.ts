// SPEC I420-I424
// @vitest-environment happy-dom
import fc from "fast-check";
import { describe, expect, it } from "vitest";
import { courseFacts } from "../../src/app/words/course-words.ts";
import type { Vec3 } from "../../src/core/types.ts";
import { worldPoints } from "../../src/doc/strokes.ts";
import { courseStyle } from "../../src/input/defaults.ts";
import { arcs, graded, laid, obeying, steepest, thinned } from "../../src/input/sketch/courseline.ts";
import { restyled, vertexOps } from "../../src/input/tools/coursedrag.ts";
import { at, doc, fire, handle, input, only, open, openForEach, stroke, strokes } from "./hands.ts";
import { SIZE, SLOPE } from "./scene.ts";

const heights = (line: Float64Array): number[] => [...line.filter((_, k) => k % 3 === 2)];
/** A line along x over heights, 10 m apart. */
const over = (z: readonly number[]): Float64Array => new Float64Array(z.flatMap((h, i) => [10 * i, 0, h]));
const grounds = fc.array(fc.double({ min: -500, max: 500, noNaN: true }), { minLength: 2, maxLength: 60 });
const style = (use: "river" | "road" | "ridge") => courseStyle(use, SIZE);

describe("the heights of a course (SPEC I421, I422)", () => {
  it("a river lies at least as deep as its style says, and never rises", () => {
    fc.assert(
      fc.property(grounds, (z) => {
        const line = laid(over(z), style("river"));
        const bed = heights(line);
        const ground = z.at(-1)! > z[0]! ? [...z].reverse() : z;
        for (const [i, h] of bed.entries()) {
          expect(h).toBeLessThanOrEqual(ground[i]! - style("river").depthM);
          if (i > 0) expect(h).toBeLessThanOrEqual(bed[i - 1]!);
        }
      }),
    );
  });

  it("a road is nowhere steeper than its grade, and stays on ground that is not", () => {
    fc.assert(
      fc.property(grounds, fc.double({ min: 0.01, max: 1, noNaN: true }), (z, grade) => {
        const line = laid(over(z), { ...style("road"), grade });
        expect(steepest(line)).toBeLessThanOrEqual(grade * (1 + 1e-9) + 1e-9);
        if (steepest(over(z)) <= grade) expect(heights(line)).toEqual(z);
      }),
    );
    const step = over([0, 0, 0, 10, 10, 10]);
    const road = graded(
      step.filter((_, k) => k % 3 === 2),
      arcs(step),
      0.1,
    );
    expect(Math.max(...road) - Math.min(...road)).toBeLessThanOrEqual(5 + 1e-9);
  });

  it("a ridge rises from the ground and comes down to it at its ends", () => {
    const line = heights(laid(over(Array(41).fill(50)), style("ridge")));
    expect(line[0]).toBe(50);
    expect(line.at(-1)).toBe(50);
    expect(line[20]).toBeCloseTo(50 + style("ridge").depthM, 6);
  });

  it("needs few points where it is straight, and keeps heights that matter", () => {
    const flat = thinned(over(Array(60).fill(5)), 2, 8, 100);
    expect(flat).toHaveLength(6);
    const bump = thinned(over(Array.from({ length: 60 }, (_, i) => (i === 30 ? 40 : 5))), 2, 8, 100);
    expect(heights(bump)).toContain(40);
  });
});

describe("drawing (SPEC I420, I423)", () => {
  const DOWN: readonly Vec3[] = [
    [2048, 2600, 260],
    [1900, 1900, 190],
    [2200, 1300, 130],
  ];
  openForEach();

  it("a river drawn uphill runs down all the same, in one step of undo", () => {
    open("orbit", { ground: () => SLOPE, freeze: () => SLOPE });
    input.actions.get("course")!.run();
    stroke([...DOWN].reverse());
    const s = only();
    expect(s).toMatchObject({ kind: "course", finished: true, paint: null });
    expect(s.course).toMatchObject({ use: "river", depth_m: 8 });
    expect(s.left).toMatchObject({ slope_deg: null, extent_m: SIZE / 50 });
    const line = worldPoints(s);
    expect(line[1]).toBeGreaterThan(line.at(-2)!);
    expect(line[2]).toBeCloseTo(0.1 * line[1]! - 8, 1);
    expect(input.selection.value).toBe(s.id);
    doc.undo();
    expect(strokes()).toEqual([]);
  });

  it("its points are handles: one that is moved lies on the ground there, and lifted a river still falls", () => {
    open("orbit", { ground: () => SLOPE, freeze: () => SLOPE });
    input.actions.get("course")!.run();
    stroke(DOWN);
    input.tool.value = "select";
    const [x, y] = at(handle("vertex-1").position);
    fire("pointerdown", x, y);
    fire("pointermove", x + 40, y + 30);
    fire("pointerup", x + 40, y + 30);
    const moved = worldPoints(only());
    expect(moved[5]).toBeLessThanOrEqual(0.1 * moved[4]! - 7.9);
    const rises = only().course!.rises!;
    for (let i = 1; i < rises.length; i++) expect(rises[i]).toBeLessThanOrEqual(rises[i - 1]!);
    const ops = vertexOps(only(), 1, 500, SLOPE);
    const fields = (ops[0] as { fields: { course: { rises: number[] } } }).fields;
    expect(fields.course.rises[1]).toBe(fields.course.rises[0]);
    expect(vertexOps(only(), 99, 5, SLOPE)).toEqual([]);
    const line = worldPoints(only());
    const near = vertexOps(only(), 0, [line[0]! + 5, line[1]!, 0], SLOPE)[0] as { fields: { first: number[] } };
    expect(near.fields.first[2]).toBeCloseTo(line[2]!, 2);
    expect(vertexOps(only(), 1, null, SLOPE)).toEqual([]);
  });

  it("becomes a road that keeps its grade, and says what it is (SPEC I424)", () => {
    open("orbit", { ground: () => SLOPE, freeze: () => SLOPE });
    input.actions.get("course")!.run();
    stroke(DOWN);
    const road = restyled(only(), { ...style("road"), grade: 0.05, widthM: 20 });
    expect(road.plateau_radius_m).toBe(10);
    doc.submit({ type: "stroke.set", stroke: only().id, fields: road });
    const facts = courseFacts(only());
    expect(facts.map((f) => f.over)).toEqual([false, false, false]);
    expect(steepest(worldPoints(only()))).toBeLessThan(0.0505);
    const steep = obeying(worldPoints(only()), { use: "road", grade: 1 });
    expect(heights(steep)).toEqual(heights(worldPoints(only())));
  });
});
