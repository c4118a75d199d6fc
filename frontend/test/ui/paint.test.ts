// SPEC U24, U25
// @vitest-environment happy-dom
import { signal } from "@preact/signals-core";
import { afterEach, describe, expect, it, vi } from "vitest";
import { Camera } from "../../src/core/camera/camera.ts";
import type { Ground, Scene, Vec3 } from "../../src/core/types.ts";
import { fullStroke } from "../../src/doc/document.ts";
import { MAX_DETAIL, MAX_EROSION, type Paint, type Stroke } from "../../src/generated/contract.ts";
import { toolDefaults } from "../../src/input/defaults.ts";
import { PAINT_CHANNELS, radiusRange } from "../../src/input/tools/painttool.ts";
import type { EskLegend } from "../../src/ui/panels/legend.ts";
import "../../src/ui/panels/legend.ts";
import type { EskOverlay } from "../../src/ui/panels/overlay.ts";
import { brushRim } from "../../src/ui/panels/overlay.ts";
import type { EskPaintForm, PaintChange } from "../../src/ui/panels/paint-form.ts";
import "../../src/ui/panels/paint-form.ts";
import { type People, strokeVisuals } from "../../src/app/view/scene.ts";
import { kindWord } from "../../src/app/words/kind-word.ts";
import { paintName, paintWords, SUBSTANCES } from "../../src/app/words/paints.ts";
import type { EskRange } from "../../src/ui/controls/range-field.ts";
import { detailWords, erosionWords, holdWords } from "../../src/ui/panels/terrain-panel.ts";

vi.mock("@awesome.me/webawesome/dist/components/slider/slider.js", () => ({ default: class {} }));
vi.mock("@awesome.me/webawesome/dist/components/switch/switch.js", () => ({ default: class {} }));

async function put<T extends HTMLElement & { updateComplete: Promise<boolean> }>(
  tag: string,
  fields: object,
): Promise<T> {
  const element = Object.assign(document.createElement(tag), fields) as T;
  document.body.append(element);
  await element.updateComplete;
  return element;
}

const all = <E extends HTMLElement>(element: HTMLElement, selector: string): E[] => [
  ...element.shadowRoot!.querySelectorAll<E>(selector),
];

afterEach(() => {
  document.body.replaceChildren();
});

const snow: Paint = { channel: "snow", value: 0.8, radius_m: 100 };

describe("the paint form", () => {
  async function form(paint: Paint = snow): Promise<{ element: EskPaintForm; changes: PaintChange[] }> {
    const element = await put<EskPaintForm>("esk-paint-form", { paint, sizeM: 4096 });
    const changes: PaintChange[] = [];
    element.addEventListener("change", (e) => changes.push((e as CustomEvent<PaintChange>).detail));
    return { element, changes };
  }

  it("offers every channel, one stop for Tab, arrows go round", async () => {
    const { element, changes } = await form();
    const radios = all(element, ".channel");
    expect(radios.map((r) => r.textContent!.trim())).toEqual(PAINT_CHANNELS.map((c) => SUBSTANCES[c].title));
    expect(radios.map((r) => r.getAttribute("tabindex"))).toEqual(["0", "-1", "-1", "-1", "-1", "-1", "-1"]);
    radios[3]!.click();
    await element.updateComplete;
    all(element, ".channel")[3]!.dispatchEvent(
      new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true, cancelable: true }),
    );
    expect(changes.map((c) => c.paint.channel)).toEqual(["wetness", "grass"]);
    expect(changes.every((c) => c.settled && c.paint.radius_m === 100 && c.paint.value === 0.8)).toBe(true);
  });

  it("keeps the strength when it turns from adding to removing, and the sign when the strength changes", async () => {
    const { element, changes } = await form();
    all(element, "esk-segmented")[0]!.dispatchEvent(new CustomEvent("pick", { detail: "remove" }));
    await element.updateComplete;
    const [strength] = all<EskRange>(element, "esk-range");
    expect(strength!.value).toBe(80);
    strength!.dispatchEvent(new CustomEvent("value", { detail: 30 }));
    strength!.dispatchEvent(new CustomEvent("settle", { detail: 30 }));
    expect(changes.map((c) => [c.paint.value, c.settled])).toEqual([
      [-0.8, true],
      [-0.3, false],
      [-0.3, true],
    ]);
  });

  it("offers the radii that the brush can have", async () => {
    const { element, changes } = await form();
    const [, radius] = all<EskRange>(element, "esk-range");
    expect([radius!.min, radius!.max]).toEqual([...radiusRange(4096)]);
    radius!.dispatchEvent(new CustomEvent("settle", { detail: 250 }));
    expect(changes.at(-1)!.paint).toEqual({ ...snow, radius_m: 250 });
  });
});

describe("words", () => {
  it("say what each paint does, more and less", () => {
    const seen = PAINT_CHANNELS.flatMap((channel) =>
      [1, -1].map((value) => paintWords({ channel, value, radius_m: 1 })),
    );
    expect(new Set(seen).size).toBe(14);
    expect(paintName(snow)).toBe("Snow");
    expect(paintName({ ...snow, channel: "grass", value: -0.5 })).toBe("Less meadow");
    expect(kindWord(painted())).toBe("Snow");
  });

  it("say what each strength of the detail looks like", () => {
    const seen = [0, 0.4, 1, 2, MAX_DETAIL].map(detailWords);
    expect(new Set(seen).size).toBe(5);
    expect(detailWords(0)).toMatch(/^None/);
    expect(new Set([0, 0.4, 1, MAX_EROSION].map(erosionWords)).size).toBe(4);
    expect(new Set([1, 0.6, 0].map(holdWords)).size).toBe(3);
  });
});

function painted(change: Partial<Stroke> = {}): Stroke {
  return fullStroke({
    id: "p",
    kind: "paint",
    first: [100, 100, 0],
    last: [300, 100, 0],
    curve: [
      [0, 0],
      [1, 0],
    ],
    paint: snow,
    finished: true,
    ...change,
  });
}

describe("lines of paint", () => {
  const ground: Ground = { sizeM: 1000, heightAt: () => 9, solvedAt: () => 5, raycast: () => null };
  const nobody: People = { members: [], presences: new Map(), me: "me", myColour: "#00ff00" };
  const doc = { settings: { size_m: 1000 }, strokes: new Map([["p", painted()]]) } as never;
  const marks = { selection: null, hovered: null, drawing: null };

  it("show with the brush; with Select when pointed at or selected; never while land is drawn", () => {
    const shown = (over: object) => strokeVisuals(doc, { ...marks, tool: "select", ...over }, nobody, ground).length;
    expect(shown({ tool: "paint" })).toBe(1);
    expect(shown({})).toBe(0);
    expect(shown({ hovered: "p" })).toBe(1);
    expect(shown({ selection: "p" })).toBe(1);
    expect(shown({ tool: "draw" })).toBe(0);
  });

  it("lie on the solved ground from afar and on the shown one in hand, the same array while nothing changes", () => {
    const points = (over: object) =>
      strokeVisuals(doc, { ...marks, tool: "paint", ...over }, nobody, ground)[0]!.points;
    const calm = points({});
    expect(calm.length).toBeGreaterThan(3 * 40);
    expect(new Set([...calm].filter((_, i) => i % 3 === 2))).toEqual(new Set([5]));
    expect(points({})).toBe(calm);
    const held = points({ selection: "p" });
    expect(new Set([...held].filter((_, i) => i % 3 === 2))).toEqual(new Set([9]));
    expect(strokeVisuals(doc, { ...marks, tool: "paint" }, nobody, { ...ground })[0]!.points).not.toBe(calm);
  });
});

/** What the overlay and the legend show. */
function shown(paint: Paint, cursor: Vec3 | null, tool = "paint", overlay: Scene["overlay"] = "snow") {
  const camera = new Camera(4096);
  camera.resize(800, 600);
  const defaults = toolDefaults(4096);
  defaults.paint.value = paint;
  const ground: Ground = { sizeM: 4096, heightAt: (x) => x / 100, raycast: () => null };
  return {
    camera,
    paint: defaults.paint,
    cursor: signal(cursor),
    overlay: signal(overlay),
    meets: signal([]),
    ground: { ...ground, attributesAt: () => ({ snow: 0.62, wet: 0.1, grass: 0.2, forest: 0.3, foam: 0.5, h: 1 }) },
    channels: { revision: signal(1), valueAt: () => -0.25, amplitude: { side: 2, values: new Float32Array(4) } },
    input: {
      tool: signal(tool),
      ink: signal(null),
      handles: signal([]),
      keyPen: { visual: signal(null) },
    },
    canEdit: signal(true),
    choices: { exaggeration: 1 },
    automaticM: signal(20),
    marked: signal(null),
    doc: signal(null),
    people: signal({ members: [], presences: new Map(), me: "me", myColour: "#000000" }),
  };
}

describe("the ring of the brush", () => {
  it("has the true radius on the ground, all round", () => {
    const rim = brushRim([500, 400, 0], 80, { sizeM: 1000, heightAt: (x, y) => x + y, raycast: () => null });
    for (const [x, y, z] of rim) {
      expect(Math.hypot(x - 500, y - 400)).toBeCloseTo(80, 9);
      expect(z).toBeCloseTo(x + y, 9);
    }
  });

  it("is drawn with the brush in hand, over the ground, in the colour of what it paints, dashed where it takes away", async () => {
    const rims = async (...args: Parameters<typeof shown>) => {
      const element = await put<EskOverlay>("esk-overlay", shown(...args));
      const found = all(element, ".rim");
      element.remove();
      return found;
    };
    const at: Vec3 = [2000, 2000, 20];
    const [under, ring] = await rims(snow, at);
    expect(under).toBeDefined();
    expect(ring!.getAttribute("stroke")).toBe(SUBSTANCES.snow.colour);
    expect(ring!.classList.contains("less")).toBe(false);
    expect(ring!.getAttribute("d")!.split("L").length).toBeGreaterThan(30);
    expect((await rims({ ...snow, value: -1 }, at))[1]!.classList.contains("less")).toBe(true);
    expect(await rims(snow, null)).toEqual([]);
    expect(await rims(snow, at, "select")).toEqual([]);
  });
});

describe("the legend of a painted channel", () => {
  it("tells what paint asks for under the cursor, and what comes of it", async () => {
    const element = await put<EskLegend>("esk-legend", shown(snow, [1, 2, 3]));
    const text = element.shadowRoot!.textContent!.replace(/\s+/g, " ");
    expect(text).toContain("Painted snow");
    expect(text).toContain("Paint here−25 %");
    expect(text).toContain("Snow here62 %");
    expect(element.hasAttribute("hidden")).toBe(false);
    const levels = await put<EskLegend>("esk-legend", shown(snow, [1, 2, 3], "paint", "patches"));
    expect(levels.shadowRoot!.textContent).toContain("Levels of detail");
    const plain = await put<EskLegend>("esk-legend", shown(snow, [1, 2, 3], "paint", "none"));
    expect(plain.hasAttribute("hidden")).toBe(true);
  });
});
