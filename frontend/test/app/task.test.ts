import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { LACKS, TaskDraft } from "../../src/app/lesson/task/draft.ts";
import { readTask, writeTask } from "../../src/app/lesson/task/task-file.ts";
import { alongProfile } from "../../src/app/lesson/task/task-view.ts";
import { goalWords } from "../../src/app/lesson/task/words.ts";
import { chartOf } from "../../src/app/view/instruments/profile-chart.ts";
import { contourLines } from "../../src/core/contour-lines.ts";
import {
  DIFFERENCE_SIDE,
  differenceColour,
  differenceGrid,
  differenceShare,
  targetAt,
} from "../../src/core/difference.ts";
import { profileOf } from "../../src/core/measure/profile.ts";
import type { Task } from "../../src/generated/contract.ts";
import { TOLERANCES_OFF } from "../../src/generated/contract.ts";

const SIZE = 4096;
const slope = {
  side: 65,
  data: Float32Array.from({ length: 65 * 65 }, (_, i) => 10 * (i % 65)),
};

describe("difference (SPEC L109)", () => {
  it("is none within the tolerance, and full five tolerances off", () => {
    expect([0, 20, -20].map((off) => differenceShare(off, 20))).toEqual([0.5, 0.5, 0.5]);
    expect(differenceShare(20 * TOLERANCES_OFF, 20)).toBe(1);
    expect(differenceShare(-1e9, 20)).toBe(0);
    expect(differenceShare(60, 20)).toBeCloseTo(0.8);
  });

  it("is read off the target at every place", () => {
    expect(targetAt(slope, SIZE, 64, 999)).toBeCloseTo(10);
    expect(targetAt(slope, SIZE, -50, 9e9)).toBe(0);
    const grid = differenceGrid((x) => (x / 64) * 10 + (x > 2048 ? 100 : 0), slope, SIZE, 20);
    expect(grid.values[10]).toBeCloseTo(0.5);
    expect(grid.values[DIFFERENCE_SIDE - 1]).toBe(1);
  });

  it("has red for too high and blue for too low, and nothing where it is as asked", () => {
    const [high, none, low] = [1, 0.5, 0].map(differenceColour);
    expect(high![0]).toBeGreaterThan(high![2]);
    expect(low![2]).toBeGreaterThan(low![0]);
    expect([high![3] > 0.8, none![3], low![3] > 0.8]).toEqual([true, 0, true]);
  });

  it("has the colours of the shader", () => {
    const shader = readFileSync("../shaders/wgsl/overlay/difference.wgsl", "utf8");
    expect(shader).toContain("core/difference.ts");
    expect(shader).toContain("fn difference_tint");
  });
});

describe("contour lines (SPEC L110)", () => {
  it("of a slope are straight, one a level", () => {
    const lines = contourLines(slope, SIZE, 100);
    expect(lines.map((line) => line.levelM)).toEqual(
      [0, 100, 200, 300, 400, 500, 600].filter((z) => z > 0 || lines[0]!.levelM === 0),
    );
    for (const { levelM, points } of lines)
      for (let i = 0; i < points.length; i += 2) expect(points[i]).toBeCloseTo((levelM / 10) * 64, 3);
  });

  it("of a hill are closed, and cross no other", () => {
    const hill = {
      side: 65,
      data: Float32Array.from(
        { length: 65 * 65 },
        (_, i) => 300 - Math.hypot((i % 65) - 32.1, Math.floor(i / 65) - 31.7) * 12,
      ),
    };
    const lines = contourLines(hill, SIZE, 50).filter((line) => line.levelM > 0);
    expect(lines.map((line) => line.levelM)).toEqual([50, 100, 150, 200, 250]);
    for (const { points } of lines) expect([points[0], points[1]]).toEqual([points.at(-2), points.at(-1)]);
  });

  it("are few, however small the interval", () => {
    expect(new Set(contourLines(slope, SIZE, 0.01).map((line) => line.levelM)).size).toBeLessThanOrEqual(60);
  });
});

const TASK: Task = {
  title: "Keep dry",
  text: "One.\n\nTwo.",
  goal: { type: "area", level_m: 8, at_least_m2: 4e6, dry: true },
  difference: true,
};

describe("the file of a task (SPEC L111)", () => {
  it("is read as it was written", () => {
    expect(readTask(writeTask({ task: TASK, pictures: ["AAAA"] }, SIZE), SIZE)).toEqual({
      task: TASK,
      pictures: ["AAAA"],
    });
  });

  it.each([
    ["{", "is not a task"],
    ['{"format":"esker-terrain"}', "is not a task"],
    [JSON.stringify({ format: "esker-task", version: 2, task: TASK }), "newer Esker"],
    [JSON.stringify({ format: "esker-task", version: 1, task: { goal: { type: "win" } } }), "is not a task"],
    [" ".repeat(300_000), "is not a task"],
  ])("says what is wrong with %.40s", (text, words) => {
    expect(() => readTask(text, SIZE)).toThrow(words);
  });

  it("says for which terrain a target was made", () => {
    const target = { size_m: 8192, level: 0, low_m: 0, step_m: 1, data: "AAAA" };
    const task: Task = { ...TASK, goal: { type: "terrain", target, tolerance_m: 5 } };
    expect(() => readTask(writeTask({ task, pictures: [] }, 8192), SIZE)).toThrow(
      "8.192 km wide; this one is 4.096 km wide",
    );
  });
});

describe("writing a task (SPEC L112)", () => {
  it("begins with what there is, and ends with it", () => {
    expect(new TaskDraft(TASK, [], SIZE).finish()).toEqual(TASK);
    expect(new TaskDraft(null, [], SIZE).finish()?.goal).toBeNull();
  });

  it.each([
    ["terrain", LACKS.target],
    ["contours", LACKS.target],
    ["profile", LACKS.line],
    ["volume", LACKS.point],
    ["slope", LACKS.path],
    ["watershed", LACKS.point],
  ] as const)("says what a goal of %s lacks", (kind, words) => {
    const draft = new TaskDraft(null, [], SIZE);
    draft.kind.value = kind;
    expect(draft.finish()).toBeNull();
    expect(draft.wrong.value).toBe(words);
  });

  it("takes the ground as a target, and keeps it while numbers change", async () => {
    const draft = new TaskDraft(null, [], SIZE);
    draft.kind.value = "terrain";
    await draft.take(() => slope);
    draft.set({ toleranceM: 7 });
    const goal = draft.finish()?.goal;
    expect(goal).toMatchObject({ type: "terrain", tolerance_m: 7, target: { level: 0, size_m: SIZE } });
    draft.kind.value = "contours";
    expect(draft.finish()).toBeNull();
  });

  it("takes the ground along a line, anew when the line is another", async () => {
    const draft = new TaskDraft(null, [], SIZE);
    draft.kind.value = "profile";
    draft.choose([
      [0, 100],
      [4096, 100],
    ]);
    await draft.take(() => slope);
    const goal = draft.finish()?.goal;
    expect(goal).toMatchObject({ type: "profile", first: [0, 100], last: [4096, 100] });
    expect(goal?.type === "profile" && [goal.heights[0], goal.heights.at(-1)]).toEqual([0, 640]);
    draft.choose([[1, 1]]);
    expect(draft.finish()).toBeNull();
  });

  it("keeps what was there when a file is none", () => {
    const draft = new TaskDraft(TASK, [], SIZE);
    draft.open("nothing");
    expect(draft.wrong.value).toContain("is not a task");
    expect(draft.finish()).toEqual(TASK);
  });

  it("says each goal in words", () => {
    expect(goalWords(TASK.goal!)).toBe("Keep 4 km² dry when the sea stands at 8 m. Behind a dyke counts.");
  });
});

describe("the section of a task (SPEC L113)", () => {
  const goal = { first: [0, 0] as [number, number], last: [1000, 0] as [number, number], heights: [0, 100, 0] };

  it("knows what is asked on its line, and nothing beside it", () => {
    expect([0, 250, 500, 1000].map((x) => alongProfile(goal, x, 0, 1))).toEqual([0, 50, 100, 0]);
    expect([alongProfile(goal, 500, 9, 1), alongProfile(goal, 1200, 0, 1)]).toEqual([null, null]);
  });

  it("paints where the ground is above and below", () => {
    const profile = profileOf(
      [
        [0, 0],
        [1000, 0],
      ],
      () => 50,
      10,
    );
    if (!("height" in profile)) throw new Error("no profile");
    const asked = Float64Array.from(profile.x, (x) => alongProfile(goal, x, 0, 1)!);
    const chart = chartOf(profile, { width: 400, height: 200, asked });
    expect(chart.asked).toMatch(/^M/);
    expect(chart.tooHigh.split("Z").length).toBeGreaterThan(10);
    expect(chart.tooLow.split("Z").length).toBeGreaterThan(10);
    expect([chart.tooHigh, chart.tooLow].join("")).not.toMatch(/NaN/);
    expect(chartOf(profile, { width: 400, height: 200 }).tooHigh).toBe("");
  });
});
