// SPEC U12
import { describe, expect, it } from "vitest";
import { hexColour, inkOn, strokeColour } from "../../src/app/view/colours.ts";
import {
  cursorVisuals,
  insidePoints,
  type People,
  reliefOf,
  shapeOf,
  strokeVisuals,
} from "../../src/app/view/scene.ts";
import type { Ground } from "../../src/core/types.ts";
import { type Doc, fromDocument, fullStroke } from "../../src/doc/document.ts";
import type { Member, MemberPresence, Stroke } from "../../src/generated/contract.ts";
import { contrast, parseColour } from "../ui/contrast.ts";

function stroke(id: string, change: Partial<Stroke> = {}): Stroke {
  return fullStroke({
    id,
    kind: "profile",
    first: [0, 0, 10],
    last: [100, 0, 10],
    curve: [
      [0, 0],
      [0.5, 40],
      [1, 0],
    ],
    ...change,
  });
}

function doc(...strokes: Stroke[]): Doc {
  return fromDocument({
    id: "t",
    clock: 1,
    settings: { size_m: 1000 } as Doc["settings"],
    strokes,
    deleted: [],
    layers: [],
    deleted_layers: [],
  });
}

const member = (client: string, colour: string): Member => ({
  client,
  colour,
  name: client,
  role: "edit",
  person: "p",
  conducts: false,
  pen: false,
});
const presence = (client: string, change: Partial<MemberPresence> = {}): MemberPresence => ({
  client,
  cursor: null,
  tool: "",
  stroke: null,
  eye: null,
  target: null,
  ...change,
});
const flat: Ground = { sizeM: 1000, heightAt: (x) => x / 10, solvedAt: () => 5, raycast: () => null };
const nobody: People = { members: [], presences: new Map(), me: "me", myColour: "#00ff00" };
const still = { tool: "draw" as const, selection: null, hovered: null, drawing: null };

describe("strokes as they are drawn", () => {
  it("are blue for mountains and crevices, red for plateaus", () => {
    const crevice = stroke("c", {
      curve: [
        [0, 0],
        [0.5, -40],
        [1, 0],
      ],
    });
    const [m, c, p] = strokeVisuals(doc(stroke("m"), crevice, stroke("p", { kind: "level" })), still, nobody, flat);
    expect(m!.colour).toEqual(strokeColour("profile", false));
    expect(c!.colour).toEqual(strokeColour("profile", true));
    for (const blue of [m!, c!]) expect(blue.colour[2]).toBeGreaterThan(blue.colour[0]);
    expect(p!.colour[0]).toBeGreaterThan(p!.colour[2]);
    expect([...m!.points]).toEqual([0, 0, 10, 50, 0, 50, 100, 0, 10]);
  });

  it("wear the author's colour while under way, mine while I draw", () => {
    const people: People = {
      ...nobody,
      members: [member("ana", "#ff8000")],
      presences: new Map([["ana", presence("ana", { stroke: "a" })]]),
    };
    const [a, b, c] = strokeVisuals(
      doc(stroke("a"), stroke("b"), stroke("c")),
      { ...still, drawing: "b" },
      people,
      flat,
    );
    expect(a).toMatchObject({ live: true, colour: hexColour("#ff8000") });
    expect(b).toMatchObject({ live: true, colour: hexColour("#00ff00") });
    expect(c!.live).toBe(false);
  });

  it("step back once finished, unless selected, pointed at or under way: the land comes first", () => {
    const people: People = {
      ...nobody,
      members: [member("ana", "#ff8000")],
      presences: new Map([["ana", presence("ana", { stroke: "live" })]]),
    };
    const all = doc(
      ...["calm", "chosen", "under", "live"].map((id) => stroke(id, { finished: true })),
      stroke("begun"),
    );
    const shown = (tool: "select" | "draw" | "paint", clear = false) =>
      strokeVisuals(all, { ...still, tool, clear, selection: "chosen", hovered: "under" }, people, flat);
    const alphas = (...how: Parameters<typeof shown>) => shown(...how).map((s) => s.colour[3]);
    expect(alphas("select")).toEqual([0.2, 1, 1, 1, 1]);
    expect(alphas("draw")).toEqual([0.12, 1, 1, 1, 1]);
    // U636: who wants to see them well does, and they are no hairlines then.
    expect(alphas("select", true)).toEqual([0.5, 1, 1, 1, 1]);
    expect(shown("draw").map((s) => s.calm)).toEqual([true, false, false, false, false]);
    expect(shown("draw", true).map((s) => s.calm)).toEqual([false, false, false, false, false]);
  });

  it("lose what lies outside the domain by more than 2 % of its size", () => {
    const far = stroke("far", {
      first: [-100, 500, 0],
      last: [1100, 500, 0],
      curve: [-1, 0, 0.07, 0.5, 0.93, 1, 2].map((u) => [u, 0]),
    });
    const [seen] = strokeVisuals(doc(far), still, nobody, flat);
    expect([...seen!.points].filter((_, i) => i % 3 === 0).map(Math.round)).toEqual([-16, 500, 1016]);
    const { points } = shapeOf(stroke("s"));
    expect(insidePoints(points, 1000)).toBe(points);
    expect(insidePoints(new Float32Array([0, 1021, 0, 0, 1019, 0]), 1000)).toEqual(new Float32Array([0, 1019, 0]));
  });

  it("are left out while hidden, unless selected, and while they are no line yet", () => {
    const hidden = stroke("h", { hidden: true });
    expect(strokeVisuals(doc(hidden, stroke("dot", { curve: [[0, 0]] })), still, nobody, flat)).toEqual([]);
    expect(strokeVisuals(doc(hidden), { ...still, selection: "h" }, nobody, flat)).toMatchObject([
      { id: "h", selected: true },
    ]);
  });

  it("keep their points as long as the stroke does", () => {
    const s = stroke("s");
    expect(shapeOf(s).points).toBe(shapeOf(s).points);
    expect(reliefOf(s)).toBe(40);
  });
});

describe("cursors", () => {
  it("are those of the others that point at the ground", () => {
    const people: People = {
      members: [member("me", "#111111"), member("ana", "#ff8000"), member("bo", "#0000ff")],
      presences: new Map([
        ["me", presence("me", { cursor: [1, 1, 1] })],
        ["ana", presence("ana", { cursor: [2, 3, 4] })],
        ["bo", presence("bo")],
      ]),
      me: "me",
      myColour: "#111111",
    };
    expect(cursorVisuals(people)).toEqual([{ position: [2, 3, 4], colour: hexColour("#ff8000"), radiusPx: 9 }]);
  });
});

describe("colours", () => {
  it("are read from hex, and grey when unreadable", () => {
    expect(hexColour("#ff0080")).toEqual([1, 0, 128 / 255, 1]);
    expect(hexColour("tomato")).toEqual([0.5, 0.5, 0.5, 1]);
  });

  it("carry the ink that reads on them", () => {
    expect(inkOn("#ffffff")).toBe("#000000");
    expect(inkOn("#7c4dd6")).toBe("#ffffff");
  });

  it("are read on any ground: 4.5 : 1 at least (WCAG 1.4.3)", () => {
    for (let i = 0; i < 512; i++) {
      const [r, g, b] = [(i >> 6) & 7, (i >> 3) & 7, i & 7].map((v) => Math.round((v * 255) / 7));
      const hex = `#${[r, g, b].map((v) => v!.toString(16).padStart(2, "0")).join("")}`;
      expect(contrast(parseColour(hex), parseColour(inkOn(hex))), hex).toBeGreaterThan(4.5);
    }
  });
});
