// @vitest-environment happy-dom
// Lines stay quiet until somebody wants them; the pen says what it measures (SPEC U311 to U313).
import { signal } from "@preact/signals-core";
import { render } from "lit";
import { describe, expect, it } from "vitest";
import { QuietStrokes } from "../../src/app/view/quiet-strokes.ts";
import { type People, strokeVisuals } from "../../src/app/view/scene.ts";
import { SUBSTANCES } from "../../src/app/words/paints.ts";
import { penWords } from "../../src/app/words/pen-words.ts";
import type { Ground } from "../../src/core/types.ts";
import { type Doc, fromDocument, fullStroke } from "../../src/doc/document.ts";
import type { PaintChannel, Stroke } from "../../src/generated/contract.ts";
import { brushPattern } from "../../src/ui/controls/brush-look.ts";

const flat: Ground = { sizeM: 4096, heightAt: () => 0, raycast: () => null };
const nobody: People = { members: [], presences: new Map(), me: "me", myColour: "#00ff00" };

function stroke(id: string, change: Partial<Stroke> = {}): Stroke {
  return fullStroke({
    id,
    kind: "profile",
    first: [1000, 1000, 10],
    last: [2900, 1000, 30],
    curve: [
      [0, 0],
      [0.5, 420],
      [1, 0],
    ],
    ...change,
  });
}

function doc(...strokes: Stroke[]): Doc {
  const settings = { size_m: 4096 } as Doc["settings"];
  return fromDocument({ id: "t", clock: 1, settings, strokes, deleted: [], layers: [], deleted_layers: [] });
}

function hands() {
  return { tool: signal("select"), selection: signal<string | null>(null), hovered: signal<string | null>(null) };
}

describe("the strokes of a terrain that was opened (SPEC U311)", () => {
  const still = { tool: "select" as const, selection: null, hovered: null, drawing: null };
  const both = doc(stroke("a", { finished: true }), stroke("b", { finished: true }));
  const shown = (marks: Parameters<typeof strokeVisuals>[1]): string[] =>
    strokeVisuals(both, marks, nobody, flat).map((s) => s.id);

  it("are not drawn while they are quiet, but for those that somebody holds", () => {
    expect(shown(still)).toEqual(["a", "b"]);
    expect(shown({ ...still, quiet: true })).toEqual([]);
    expect(shown({ ...still, quiet: true, hovered: "a" })).toEqual(["a"]);
    expect(shown({ ...still, quiet: true, selection: "b" })).toEqual(["b"]);
  });

  it.each([
    ["pointed at", (h: ReturnType<typeof hands>) => (h.hovered.value = "a")],
    ["selected", (h: ReturnType<typeof hands>) => (h.selection.value = "a")],
    ["a tool is taken", (h: ReturnType<typeof hands>) => (h.tool.value = "mountain")],
  ])("show from when one is %s", async (_, want) => {
    const quiet = new QuietStrokes();
    const h = hands();
    quiet.begin(h);
    expect(quiet.quiet.value).toBe(true);
    want(h);
    expect(quiet.quiet.value).toBe(false);
    await Promise.resolve();
    h.hovered.value = h.selection.value = null;
    expect(quiet.quiet.value).toBe(false);
  });

  it("show when all are asked for", () => {
    const quiet = new QuietStrokes();
    quiet.begin(hands());
    quiet.end();
    expect(quiet.quiet.value).toBe(false);
  });
});

describe("words beside the pen (SPEC U312)", () => {
  it("say height or depth and length, for every tool", () => {
    expect(penWords(stroke("m"))).toBe("420 m high, 1.9 km long");
    const sinks: Stroke["curve"] = [
      [0, 0],
      [0.4, -35],
      [0.5, -20],
    ];
    expect(penWords(stroke("c", { curve: sinks }))).toBe("35 m deep, 950 m long");
    const square: Stroke["curve"] = [
      [0, 0],
      [1, 0],
      [1, 1],
      [0, 1],
    ];
    expect(penWords(stroke("p", { kind: "level", last: [1300, 1000, 10], curve: square }))).toBe(
      "at 10.0 m, 900 m round",
    );
    const paint = { channel: "snow" as const, value: -0.5, radius_m: 60 };
    expect(
      penWords(
        stroke("s", {
          kind: "paint",
          paint,
          curve: [
            [0, 0],
            [1, 0],
          ],
        }),
      ),
    ).toBe("Less snow, 120 m wide, 1.9 km long");
    expect(penWords(stroke("x", { curve: [[0, 0]] }))).toBeNull();
  });
});

describe("the ring of the brush (SPEC U313)", () => {
  it("is filled with a pattern of each substance, in its colour", () => {
    const looks = (Object.keys(SUBSTANCES) as PaintChannel[]).map((channel) => {
      const box = document.createElement("div");
      render(brushPattern(channel), box);
      expect(box.innerHTML).toContain(`id="brush-${channel}"`);
      expect(box.innerHTML).toContain(SUBSTANCES[channel].colour);
      return box.querySelector("path")?.getAttribute("d");
    });
    expect(new Set(looks).size).toBe(looks.length);
  });
});
