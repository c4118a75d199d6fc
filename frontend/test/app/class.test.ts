// @vitest-environment happy-dom
// A whole class on one terrain, and what a newcomer is told (SPEC U37-U39).
import { getIconLibrary } from "@awesome.me/webawesome/dist/components/icon/library.js";
import { signal } from "@preact/signals-core";
import type { LitElement } from "lit";
import { afterEach, describe, expect, it, vi } from "vitest";
import { DRAWN_ON, DRAWN_ON_MAP, hintWords } from "../../src/app/words/hints.ts";
import { fullStroke } from "../../src/doc/document.ts";
import type { Member, Stroke } from "../../src/generated/contract.ts";
import "../../src/ui/controls/icon-library.ts";
import "../../src/ui/bars/people.ts";
import { type Store, setFlag } from "../../src/app/device/storage.ts";
import type { Stage } from "../../src/app/view/stage.ts";

afterEach(() => {
  document.body.innerHTML = "";
});

function member(i: number): Member {
  return {
    client: `c${i}`,
    name: `Pupil ${String(29 - i).padStart(2, "0")}`,
    colour: "#2b8a3e",
    role: "edit",
  } as Member;
}

describe("many people (SPEC U37)", () => {
  it("have a list by name; a click in it follows", async () => {
    const follow = vi.fn();
    const members = Array.from({ length: 30 }, (_, i) => member(i));
    const element = Object.assign(document.createElement("esk-people"), {
      client: "c0",
      members: signal(members),
      me: signal({ name: "Me" }),
      people: signal({ myColour: "#7c4dd6" }),
      following: signal("c7"),
    }) as unknown as LitElement;
    element.addEventListener("follow", (e) => follow((e as CustomEvent<string>).detail));
    document.body.append(element);
    await element.updateComplete;
    const root = element.renderRoot;
    const circles = root.querySelectorAll(".other").length;
    expect(root.querySelector(".more")!.textContent!.trim()).toBe(`+${29 - circles}`);
    const items = [...root.querySelectorAll("wa-dropdown-item")];
    const names = items.map((i) => i.textContent!.trim());
    expect(names.length).toBe(29);
    expect(names).toEqual([...names].sort());
    expect(items.filter((i) => (i as HTMLElement & { checked: boolean }).checked).length).toBe(1);
    root
      .querySelector("wa-dropdown")!
      .dispatchEvent(new CustomEvent("wa-select", { detail: { item: { value: "c3" } } }));
    expect(follow).toHaveBeenCalledWith("c3");
  });
});

describe("hints (SPEC U39)", () => {
  const ridge = fullStroke({
    id: "r",
    kind: "profile",
    first: [0, 0, 0],
    last: [100, 0, 0],
    curve: [
      [0, 0],
      [0.5, 40],
      [1, 0],
    ],
  });

  function stageWith(strokes: Stroke[], over: { tool?: string; following?: string; mode?: string } = {}) {
    const kept = new Map<string, string>();
    const store = { getItem: (k: string) => kept.get(k) ?? null, setItem: (k: string, v: string) => kept.set(k, v) };
    const stage = {
      session: {
        doc: { doc: signal({ strokes: new Map(strokes.map((s) => [s.id, s])), layers: new Map() }) },
        canEdit: signal(true),
        historyView: { active: signal(false) },
        store,
      },
      following: signal(over.following ?? null),
      input: {
        inputMode: signal("idle"),
        placing: signal(null),
        keyPen: { visual: signal(null) },
        selection: signal<string | null>(strokes[0]?.id ?? null),
        tool: signal(over.tool ?? "mountain"),
      },
      camera: { state: signal({ mode: over.mode ?? "orbit" }) },
    } as unknown as Stage;
    return { stage, store: store as unknown as Store };
  }

  it("lead from the empty land over the first stroke to drawing on, one at a time", () => {
    expect(hintWords(stageWith([]).stage, false)).toContain("Draw a line across the land");
    expect(hintWords(stageWith([], { tool: "select" }).stage, false)).toContain("Pick a tool");
    expect(hintWords(stageWith([], { mode: "map" }).stage, false)).toContain("map");
    expect(hintWords(stageWith([]).stage, true)).toBeNull();
    const { stage, store } = stageWith([ridge]);
    expect(hintWords(stage, false)).toContain("draw over the line");
    setFlag(store, DRAWN_ON);
    expect(hintWords(stage, false)).toBeNull();
  });

  it("say on the map that a curved line becomes a straight ridge, on any land, until one was drawn there (SPEC U351)", () => {
    const { stage, store } = stageWith([ridge, { ...ridge, id: "s" }], { mode: "map" });
    expect(hintWords(stage, false)).toContain("a curved line becomes a straight one");
    expect(hintWords(stageWith([], { mode: "map", tool: "crevice" }).stage, false)).toContain("straight");
    for (const tool of ["plateau", "paint", "select"])
      expect(hintWords(stageWith([ridge, { ...ridge, id: "s" }], { mode: "map", tool }).stage, false)).toBeNull();
    expect(hintWords(stageWith([ridge, { ...ridge, id: "s" }]).stage, false)).toBeNull();
    setFlag(store, DRAWN_ON_MAP);
    expect(hintWords(stage, false)).toBeNull();
  });

  it("are silent while one follows, with another tool, and once there is a landscape", () => {
    expect(hintWords(stageWith([], { following: "c1" }).stage, false)).toBeNull();
    expect(hintWords(stageWith([ridge], { tool: "plateau" }).stage, false)).toBeNull();
    expect(hintWords(stageWith([ridge, { ...ridge, id: "s" }]).stage, false)).toBeNull();
  });
});

describe("the component library's icons", () => {
  it("have proportions of their own: as wide as they look", () => {
    for (const name of ["default", "system"] as const) {
      const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      getIconLibrary(name)!.mutator!(svg, null as never);
      expect(svg.getAttribute("viewBox")).toBe("0 0 24 24");
    }
  });
});
