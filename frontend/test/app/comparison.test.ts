// SPEC L156, L157, L158
// @vitest-environment happy-dom
import { signal } from "@preact/signals-core";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { Scene, SceneRenderer } from "../../src/core/types.ts";
import { TILE_SAMPLES } from "../../src/generated/contract.ts";
import type { TileStore } from "../../src/tiles/store.ts";
import { SETTINGS } from "../settings.ts";

class FakeRenderer implements SceneRenderer {
  readonly lost = new Promise<string>(() => {});
  readonly description = "a stand-in";
  readonly software = false;
  scenes: Scene[] = [];
  destroyed = false;

  constructor(
    readonly kind: SceneRenderer["kind"],
    readonly canvas: HTMLCanvasElement,
  ) {
    made.push(this);
  }
  render(scene: Scene) {
    this.scenes.push(scene);
    return { patches: 0, triangles: 0, selectMs: 0, cpuMs: 0, uploads: 0, busy: false };
  }
  destroy(): void {
    this.destroyed = true;
  }
}

let made: FakeRenderer[] = [];
let hasWebGpu = true;

class NoWebGpu extends Error {}

vi.mock("../../src/gpu/index.ts", () => ({
  NoWebGpu,
  createRenderer: async (canvas: HTMLCanvasElement) => {
    if (!hasWebGpu) throw new NoWebGpu("This browser has no WebGPU; the map view is shown instead.");
    return new FakeRenderer("webgpu", canvas);
  },
  createMapRenderer: (canvas: HTMLCanvasElement) => new FakeRenderer("map", canvas),
}));

const { Comparison } = await import("../../src/app/lesson/comparison.ts");
const { ViewChoices } = await import("../../src/app/device/view-choices.ts");

const SIZE_M = 4096;
const SIDE_PX = { width: 600, height: 400 };

/** A copy whose ground is level at a height west of its middle, and at zero east of it. */
function side(heightM: number) {
  const ground = {
    sizeM: SIZE_M,
    heightAt: (x: number) => (x < SIZE_M / 2 ? heightM : 0),
    raycast: () => null,
  };
  const root = { heights: new Float32Array(TILE_SAMPLES * TILE_SAMPLES) };
  const tiles = {
    sizeM: SIZE_M,
    ground,
    revision: signal(0),
    freeze: () => ground,
    tile: () => root,
  } as unknown as TileStore;
  const viewport = document.createElement("div");
  Object.defineProperties(viewport, {
    clientWidth: { value: SIDE_PX.width },
    clientHeight: { value: SIDE_PX.height },
  });
  viewport.getBoundingClientRect = () => new DOMRect(0, 0, SIDE_PX.width, SIDE_PX.height);
  document.body.append(viewport);
  return { tiles, settings: signal({ ...SETTINGS, size_m: SIZE_M, detail: 1, erosion: 0.5 }), viewport };
}

let frames: FrameRequestCallback[] = [];
let clock = 0;

/** Draws what is due. */
function frame(): void {
  const due = frames;
  frames = [];
  clock += 16;
  for (const run of due) run(clock);
}

async function stand(...heights: [number, number]) {
  const sides = [side(heights[0]), side(heights[1])] as const;
  const kept = new Map<string, string>();
  const view = new ViewChoices({
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => void kept.set(key, value),
  } as never);
  const comparison = new Comparison(sides, view);
  await comparison.start();
  frame();
  return { comparison, sides, last: () => made.map((renderer) => renderer.scenes.at(-1)!) };
}

beforeEach(() => {
  made = [];
  frames = [];
  hasWebGpu = true;
  vi.stubGlobal("requestAnimationFrame", (run: FrameRequestCallback) => frames.push(run));
  vi.stubGlobal("cancelAnimationFrame", () => {
    frames = [];
  });
});

afterEach(() => {
  vi.unstubAllGlobals();
  document.body.replaceChildren();
});

function pointer(type: string, at: { x: number; y: number; id?: number; touch?: boolean }): PointerEvent {
  return new PointerEvent(type, {
    clientX: at.x,
    clientY: at.y,
    pointerId: at.id ?? 1,
    pointerType: at.touch ? "touch" : "mouse",
    button: 0,
    bubbles: true,
  });
}

describe("a comparison of two copies", () => {
  it("moves both pictures by pointer, fingers, wheel and keys on either (L156)", async () => {
    const { comparison, sides, last } = await stand(100, 300);
    const [left, right] = [sides[0].viewport, sides[1].viewport];
    const moves: [string, () => void][] = [
      ["a drag on the left", () => drag(left)],
      ["a drag on the right", () => drag(right)],
      ["the wheel", () => void right.dispatchEvent(new WheelEvent("wheel", { deltaY: -20, cancelable: true }))],
      ["two fingers", () => pinch(left)],
      ["an arrow key", () => void window.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }))],
      ["a turning key", () => void window.dispatchEvent(new KeyboardEvent("keydown", { key: ".", code: "Period" }))],
    ];
    for (const [what, move] of moves) {
      const before = last()[0]!.camera;
      move();
      frame();
      const [one, other] = last().map((scene) => scene.camera);
      expect(one, what).not.toEqual(before);
      expect(other, what).toBe(one);
    }
    comparison.dispose();
  });

  it("shows each copy's own ground without made-up detail, and takes no pen (L156)", async () => {
    const { comparison, sides, last } = await stand(100, 300);
    expect(last().map((scene) => scene.tiles)).toEqual(sides.map(({ tiles }) => tiles));
    for (const { strokes, ghost, settings } of last())
      expect([strokes, ghost, settings.detail, settings.erosion]).toEqual([[], null, 0, 0]);
    sides[1].settings.value = { ...sides[1].settings.value, look: "paper" };
    frame();
    expect(last().map(({ settings }) => settings.look)).toEqual(["natural", "paper"]);
    comparison.dispose();
  });

  it("shows on each side where it is higher and lower than the other (L157)", async () => {
    const { comparison, last } = await stand(100, 300);
    comparison.overlay.value = "difference";
    frame();
    const [left, right] = last();
    expect([left!.overlay, right!.overlay]).toEqual(["difference", "difference"]);
    // West of the middle the left one is 200 m lower, which is more than a tenth of the relief: full colours.
    expect([left!.influence!.values[0], right!.influence!.values[0]]).toEqual([0, 1]);
    expect(left!.influence!.values.at(-1)).toBe(0.5);
    expect(comparison.difference.value!.fullM).toBe(30);
    comparison.overlay.value = "none";
    frame();
    expect(last().map((scene) => scene.overlay)).toEqual(["none", "none"]);
    comparison.dispose();
  });

  it("shows two maps and says why where there is no WebGPU (L158)", async () => {
    hasWebGpu = false;
    const { comparison, last } = await stand(100, 300);
    expect(made.map(({ kind }) => kind)).toEqual(["map", "map"]);
    expect(comparison.reason.value).toContain("no WebGPU");
    frame();
    expect(last().map((scene) => scene.camera.mode)).toEqual(["map", "map"]);
    comparison.camera.setMode("orbit");
    expect(comparison.camera.state.value.mode).toBe("map");
    comparison.dispose();
  });

  it("frees both devices and listens no more when it is closed (L158)", async () => {
    const { comparison, sides } = await stand(100, 300);
    comparison.dispose();
    expect(made.map(({ destroyed }) => destroyed)).toEqual([true, true]);
    const before = comparison.camera.state.value;
    drag(sides[0].viewport);
    window.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    expect(comparison.camera.state.value).toBe(before);
    expect(frames).toEqual([]);
  });
});

function drag(on: HTMLElement): void {
  on.dispatchEvent(pointer("pointerdown", { x: 300, y: 200 }));
  on.dispatchEvent(pointer("pointermove", { x: 340, y: 190 }));
  on.dispatchEvent(pointer("pointerup", { x: 340, y: 190 }));
}

function pinch(on: HTMLElement): void {
  for (const [type, apart] of [
    ["pointerdown", 40],
    ["pointermove", 90],
    ["pointerup", 90],
  ] as const)
    for (const [id, way] of [
      [5, -1],
      [6, 1],
    ] as const)
      on.dispatchEvent(pointer(type, { x: 300 + way * apart, y: 200, id, touch: true }));
}
