// SPEC U21, U22
// @vitest-environment happy-dom
import { signal } from "@preact/signals-core";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { CameraState, SceneRenderer } from "../../src/core/types.ts";

/** A renderer whose device the test takes away. */
class FakeRenderer implements SceneRenderer {
  readonly lost: Promise<string>;
  lose: (reason: string) => void = () => {};
  destroyed = false;
  readonly description: string;
  readonly software = false;

  constructor(
    readonly kind: SceneRenderer["kind"],
    readonly canvas: HTMLCanvasElement,
  ) {
    this.description = kind;
    this.lost = new Promise((done) => {
      this.lose = done;
    });
    made.push(this);
  }
  render(): never {
    throw new Error("nothing is drawn here");
  }
  destroy(): void {
    this.destroyed = true;
  }
}

let made: FakeRenderer[] = [];
/** Why the next requests for a 3D view fail. */
let refusals: Error[] = [];

class NoWebGpu extends Error {}

vi.mock("../../src/gpu/index.ts", () => ({
  NoWebGpu,
  createRenderer: async (canvas: HTMLCanvasElement) => {
    const refusal = refusals.shift();
    if (refusal) throw refusal;
    return new FakeRenderer("webgpu", canvas);
  },
  createMapRenderer: (canvas: HTMLCanvasElement) => new FakeRenderer("map", canvas),
}));

const { Graphics, MOST_LOSSES, RETRY_MS } = await import("../../src/app/view/graphics.ts");
const { QualityChoice, TAU_PX } = await import("../../src/app/device/quality-choice.ts");

function stand() {
  const viewport = document.createElement("div");
  const state = signal<Pick<CameraState, "mode" | "width" | "height">>({ mode: "fly", width: 300, height: 200 });
  const said: string[] = [];
  let opened = 0;
  let clock = 0;
  const graphics = new Graphics({
    viewport,
    camera: {
      state,
      setMode: (mode) => {
        state.value = { ...state.value, mode };
      },
    },
    say: (text) => said.push(text),
    onOpened: () => {
      opened += 1;
    },
    now: () => clock,
  });
  return {
    graphics,
    viewport,
    state,
    said,
    opened: () => opened,
    later: (ms: number) => {
      clock += ms;
    },
  };
}

const last = (): FakeRenderer => made.at(-1)!;
const settle = (): Promise<unknown> => vi.advanceTimersByTimeAsync(3000);

beforeEach(() => {
  vi.useFakeTimers();
  made = [];
  refusals = [];
  vi.spyOn(console, "warn").mockImplementation(() => {});
});
afterEach(() => {
  vi.useRealTimers();
  vi.restoreAllMocks();
});

describe("a lost graphics device", () => {
  it("U21: is replaced over the same view, on another canvas, and the page says so", async () => {
    const { graphics, viewport, state, opened } = stand();
    await graphics.open();
    const first = last();
    first.lose("driver");
    await settle();
    expect(first.destroyed).toBe(true);
    expect(made.length).toBe(2);
    expect(graphics.renderer).toBe(last());
    expect(last().kind).toBe("webgpu");
    expect(last().canvas).not.toBe(first.canvas);
    expect([...viewport.querySelectorAll("canvas")]).toEqual([last().canvas]);
    expect(last().canvas.width).toBe(300);
    expect(state.value.mode).toBe("fly");
    expect(opened()).toBe(2);
    expect(graphics.notice.value).toMatchObject({ retry: false });
    expect(graphics.notice.value?.text).toContain("open again");
    await vi.advanceTimersByTimeAsync(10_000);
    expect(graphics.notice.value).toBeNull();
    graphics.dispose();
  });

  it("U21: is asked for again while the browser has none yet", async () => {
    const { graphics } = stand();
    await graphics.open();
    refusals = [new NoWebGpu("none yet"), new Error("lost while opening")];
    last().lose("crash");
    await vi.advanceTimersByTimeAsync(RETRY_MS[1] - 1);
    expect(graphics.renderer).toBeNull();
    await settle();
    expect(graphics.renderer?.kind).toBe("webgpu");
    graphics.dispose();
  });

  it("U21: the map stands in when there is no other, and the 3D view returns to where it was", async () => {
    const { graphics, state } = stand();
    await graphics.open();
    refusals = RETRY_MS.map(() => new NoWebGpu("No device."));
    last().lose("crash");
    await settle();
    expect(graphics.renderer?.kind).toBe("map");
    expect(state.value.mode).toBe("map");
    expect(graphics.reason.value).toBe("No device.");
    expect(graphics.notice.value?.retry).toBe(true);
    const map = last();
    await graphics.retry();
    expect(map.destroyed).toBe(true);
    expect(graphics.renderer?.kind).toBe("webgpu");
    expect(state.value.mode).toBe("fly");
    expect(graphics.reason.value).toBeNull();
    graphics.dispose();
  });

  it("U21: too many losses in a minute bring the map; spread over an hour they do not", async () => {
    const calm = stand();
    await calm.graphics.open();
    for (let i = 0; i < 3 * MOST_LOSSES; i += 1) {
      calm.later(61_000);
      last().lose("sleep");
      await settle();
      expect(calm.graphics.renderer?.kind).toBe("webgpu");
    }
    calm.graphics.dispose();
    const wild = stand();
    await wild.graphics.open();
    for (let i = 0; i <= MOST_LOSSES; i += 1) {
      expect(wild.graphics.renderer?.kind).toBe("webgpu");
      wild.later(1000);
      last().lose("crash");
      await settle();
    }
    expect(wild.graphics.renderer?.kind).toBe("map");
    await wild.graphics.retry();
    expect(wild.graphics.renderer?.kind).toBe("webgpu");
    wild.graphics.dispose();
  });

  it("U21: nothing is opened for a page that has gone", async () => {
    const { graphics } = stand();
    await graphics.open();
    const first = last();
    graphics.dispose();
    first.lose("closed");
    await settle();
    expect(made.length).toBe(1);
    expect(first.destroyed).toBe(true);
  });
});

describe("the quality of a device", () => {
  const store = (): Storage & { values: Map<string, string> } => {
    const values = new Map<string, string>();
    return {
      values,
      getItem: (key: string) => values.get(key) ?? null,
      setItem: (key: string, value: string) => void values.set(key, value),
    } as unknown as Storage & { values: Map<string, string> };
  };

  it("U22: is kept on this device; what is not known counts as automatic", () => {
    const kept = store();
    const choice = new QualityChoice(kept);
    expect(choice.mode.value).toBe("automatic");
    choice.choose("fine");
    expect(new QualityChoice(kept).mode.value).toBe("fine");
    kept.setItem("esker.quality", "splendid");
    expect(new QualityChoice(kept).mode.value).toBe("automatic");
  });

  it("U22: finer choices ask for smaller errors", () => {
    expect(TAU_PX.fine).toBeLessThan(TAU_PX.balanced);
    expect(TAU_PX.balanced).toBeLessThan(TAU_PX.fast);
    expect(TAU_PX.automatic).toBe(TAU_PX.balanced);
  });
});
