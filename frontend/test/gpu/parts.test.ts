/** The parts of the renderer that need no device (SPEC R15, R16, R18, R19). */

import view from "@shaders/wgsl/view.wgsl?raw";
import { describe, expect, it, vi } from "vitest";
import type { Scene, StrokeVisual } from "../../src/core/types.ts";
import { NO_LAKE } from "../../src/generated/contract.ts";
import { NoWebGpu, openGpu } from "../../src/gpu/device.ts";
import { baseHeight, sunDirection } from "../../src/gpu/frame.ts";
import { StructWriter, structLayout } from "../../src/gpu/layout.ts";
import { contourInterval } from "../../src/gpu/looks.ts";
import { hillshade, shadeTile } from "../../src/gpu/map/shade.ts";
import { soilLevel } from "../../src/gpu/passes/instances.ts";
import { PITCH, patchIndices } from "../../src/gpu/passes/patches.ts";
import { RibbonBuilder, strokeStyle } from "../../src/gpu/passes/ribbons.ts";
import { STONES_SIZE, stoneTexels } from "../../src/gpu/passes/stones.ts";
import { QualityControl } from "../../src/gpu/quality.ts";
import { samePicture } from "../../src/gpu/scenediff.ts";
import { NOISE_SIZE, noiseMipmaps } from "../../src/gpu/synthesis/noise.ts";
import { FieldView, lookAt, PLAIN_CHANNELS } from "./world.ts";

/** rgba of stones at (0, 0), (17, 300), (255, 511), (400, 33); tests/render/test_picture.py has them too. */
const STONE_TEXELS = [
  [84, 138, 123, 103],
  [25, 158, 125, 115],
  [255, 120, 114, 138],
  [83, 254, 166, 119],
];

describe("layout", () => {
  it("R18: follows the alignment rules of WGSL", () => {
    const layout = structLayout("struct A { a: f32, b: vec3f, c: f32, d: vec2f, e: u32, f: array<vec4f, 3>, };", "A");
    expect(layout.offsets).toEqual({ a: 0, b: 16, c: 28, d: 32, e: 40, f: 48 });
    expect(layout.size).toBe(96);
  });

  it("R18: reads the view uniform and refuses what it does not know", () => {
    const layout = structLayout(view, "View");
    expect(layout.offsets.eye).toBe(64);
    expect(layout.size % 16).toBe(0);
    expect(() => new StructWriter(layout).set("nothing", 1)).toThrow("no field");
    expect(() => structLayout("struct A { a: f64 };", "A")).toThrow("unknown WGSL type");
    expect(() => structLayout(view, "Nowhere")).toThrow("no struct");
  });
});

describe("patch mesh", () => {
  it("covers 16 x 16 cells with triangles of one winding and one diagonal", () => {
    const indices = patchIndices();
    expect(indices.length).toBe(16 * 16 * 6);
    let area = 0;
    for (let i = 0; i < indices.length; i += 3) {
      const [a, b, c] = [indices[i]!, indices[i + 1]!, indices[i + 2]!].map((v) => [
        v % PITCH,
        Math.floor(v / PITCH),
      ]) as [number[], number[], number[]];
      const twice = (b[0]! - a[0]!) * (c[1]! - a[1]!) - (c[0]! - a[0]!) * (b[1]! - a[1]!);
      expect(twice).toBe(1);
      area += twice / 2;
    }
    expect(area).toBe(256);
  });

  it("R66: lists new vertices together: SwiftShader shades four indices at a time when the first is not among 64", () => {
    const indices = patchIndices();
    let runs = 0;
    for (let batch = 0; batch < indices.length; batch += 3 * 128) {
      const part = indices.subarray(batch, batch + 3 * 128);
      const cache = new Int32Array(64).fill(-1);
      part.forEach((vertex, i) => {
        if (cache[vertex % 64] === vertex) return;
        runs += 1;
        for (let k = Math.min(i + 3, part.length - 1); k >= i; k -= 1) cache[part[k]! % 64] = part[k]!;
      });
    }
    expect(runs).toBeLessThanOrEqual(112);
  });
});

describe("quality", () => {
  it("R15: slow frames lower the resolution step by step, rest restores it", () => {
    const control = new QualityControl(false);
    for (let i = 0; i < 20; i += 1) {
      control.next(16 * i, true);
      control.measured(90);
    }
    const now = 320;
    const slow = control.next(now, true);
    expect(slow.scale).toBe(0.5);
    expect(slow.tauFactor).toBeGreaterThan(1);
    expect(control.pending).toBe(true);
    expect(control.next(now + 1000, false)).toEqual({ scale: 1, tauFactor: 1 });
    expect(control.pending).toBe(false);
  });

  it("R15: fast frames on a GPU stay at full quality", () => {
    const control = new QualityControl(false);
    for (let i = 0; i < 20; i += 1) {
      expect(control.next(i * 16, true)).toEqual({ scale: 1, tauFactor: 1 });
      control.measured(6);
    }
  });

  it("R46: when the lowest resolution is still too slow the ground gets coarser, and finer again first", () => {
    const control = new QualityControl(false);
    let seen = { scale: 1, tauFactor: 1 };
    const run = (frames: number, ms: number): void => {
      for (let i = 0; i < frames; i += 1) {
        seen = control.next(0, true);
        control.measured(ms);
      }
    };
    run(30, 90);
    expect(seen).toEqual({ scale: 0.5, tauFactor: 5 });
    run(3, 8);
    expect(seen.scale).toBe(0.5);
    expect(seen.tauFactor).toBeLessThan(5);
    run(30, 8);
    expect(seen).toEqual({ scale: 1, tauFactor: 1 });
  });

  it("R46: a chosen quality holds its error bound, however slow frames are", () => {
    for (const software of [true, false]) {
      const control = new QualityControl(software);
      for (const [mode, scale] of [
        ["fast", 0.5],
        ["balanced", 0.75],
        ["fine", 1],
      ] as const) {
        control.mode = mode;
        for (let i = 0; i < 30; i += 1) {
          expect(control.next(i, true)).toEqual({ scale, tauFactor: 1 });
          control.measured(300);
        }
        expect(control.next(5000, false)).toEqual({ scale: 1, tauFactor: 1 });
      }
      control.mode = "automatic";
      // What frames took meanwhile said nothing about the automatic mode.
      expect(control.next(6000, true)).toEqual(new QualityControl(software).next(0, true));
    }
  });

  it("R15: a CPU adapter starts low", () => {
    expect(new QualityControl(true).next(0, true)).toEqual({ scale: 0.75, tauFactor: 2 });
  });
});

function scene(): Scene {
  const stroke: StrokeVisual = {
    id: "a",
    kind: "profile",
    points: Float32Array.of(0, 0, 0, 10, 0, 0),
    colour: [1, 0, 0, 1],
    selected: false,
    hovered: false,
    live: false,
  };
  return {
    camera: lookAt([0, 0, 10], [10, 10, 0], 100, 80),
    tiles,
    channels: PLAIN_CHANNELS,
    settings: {
      size_m: 64,
      edition: 1,
      title: "",
      reach_m: null,
      border: "free",
      sea_level_m: null,
      lakes_m: null,
      rivers: 0,
      wetness: 1,
      seed: 1,
      look: "natural",
      detail: 1,
      rule: "landscape",
      erosion: 0,
      erosion_scale: 10,
      hold: 1,
      sun_azimuth_deg: 100,
      sun_elevation_deg: 30,
      place: null,
      task: null,
      task_pictures: [],
    },
    strokes: [stroke],
    ghost: null,
    cursors: [{ position: [1, 2, 3], colour: [0, 1, 0, 1], radiusPx: 9 }],
    tauPx: 1.5,
    time: 0,
    overlay: "none",
    showStrokes: true,
  };
}
const tiles = new FieldView(64, 0, () => 0);

describe("scene comparison", () => {
  it("R15: the same values built anew, at another time, are the same picture", () => {
    expect(samePicture(scene(), 1, { ...scene(), time: 9 }, 1)).toBe(true);
  });

  it("R15: what shows makes a difference", () => {
    const a = scene();
    const b = scene();
    const stroke = b.strokes[0]!;
    const changes: Partial<Scene>[] = [
      { camera: lookAt([0, 0, 11], [10, 10, 0], 100, 80) },
      { settings: { ...b.settings, look: "paper" } },
      { settings: { ...b.settings, sea_level_m: 0 } },
      { strokes: [] },
      { strokes: [{ ...stroke, selected: true }] },
      { strokes: [{ ...stroke, points: Float32Array.of(0, 0, 0, 10, 0, 1) }] },
      { cursors: [{ ...b.cursors[0]!, position: [1, 2, 4] }] },
      { overlay: "slope" },
      { showStrokes: false },
      { tauPx: 2 },
    ];
    for (const change of changes) expect(samePicture(a, 1, { ...b, ...change }, 1)).toBe(false);
    expect(samePicture(a, 1, b, 2)).toBe(false);
  });
});

describe("ribbons", () => {
  it("joins lines with gaps: a segment for each pair of points, none between lines", () => {
    const builder = new RibbonBuilder();
    const style = { colour: [1, 1, 1, 1], halfWidthPx: 1, haloPx: 0, hiddenOpacity: 0.3 } as const;
    builder.add(Float32Array.of(0, 0, 0, 3, 4, 0, 3, 4, 12), style);
    builder.add(Float32Array.of(9, 9, 9), style);
    builder.add(Float32Array.of(50, 0, 0, 51, 0, 0), style);
    expect(builder.points).toBe(9);
    const starts = Array.from({ length: builder.points }, (_, i) => builder.data[12 * i + 11]);
    expect(starts).toEqual([0, 1, 1, 0, 0, 0, 1, 0, 0]);
    expect(builder.data[12 * 3 + 3]).toBe(17);
    // Instance i draws from point i + 1 to i + 2: the last flag that counts is that of point n - 3.
    expect(builder.instances).toBe(6);
  });
});

describe("figures", () => {
  it("the sun stands where the settings say: azimuth clockwise from north", () => {
    expect(sunDirection(90, 0.5)[0]).toBeGreaterThan(0.99);
    expect(sunDirection(0, 45)[1]).toBeCloseTo(Math.SQRT1_2);
    expect(Math.hypot(...sunDirection(200, 33))).toBeCloseTo(1);
  });

  it("the block's foot lies below all ground and does not creep", () => {
    for (let low = -500; low < 500; low += 7) expect(baseHeight(low, 4096)).toBeLessThan(low - 0.019 * 4096);
    expect(baseHeight(-1, 4096)).toBe(baseHeight(-6, 4096));
  });

  it("contours come at 1, 2 or 5 times a power of ten", () => {
    for (const relief of [3, 47, 220, 880, 5000]) {
      const every = contourInterval(relief);
      expect([1, 2, 5, 10]).toContain(Math.round(every / 10 ** Math.floor(Math.log10(every) + 1e-9)));
      expect(relief / every).toBeGreaterThan(9);
      expect(relief / every).toBeLessThan(25);
    }
  });

  it("the noise tiles, has the wanted spread and fades to its mean", () => {
    const levels = noiseMipmaps();
    const finest = levels[0]!;
    expect(levels).toHaveLength(Math.log2(NOISE_SIZE) + 1);
    let mean = 0;
    let seam = 0;
    let inner = 0;
    for (let r = 0; r < NOISE_SIZE; r += 1) {
      const at = (c: number): number => finest[4 * (r * NOISE_SIZE + c)]!;
      seam += Math.abs(at(0) - at(NOISE_SIZE - 1));
      inner += Math.abs(at(100) - at(101));
      for (let c = 0; c < NOISE_SIZE; c += 1) mean += at(c);
    }
    expect(mean / NOISE_SIZE ** 2).toBeCloseTo(127.5, -1);
    expect(seam).toBeLessThan(2.5 * inner);
    expect(Math.abs(levels.at(-1)![0]! - 128)).toBeLessThan(6);
  });

  it("R64: the stones tile, lean no way on the whole, and are those of the reference", () => {
    const texels = stoneTexels();
    expect(texels).toHaveLength(4 * STONES_SIZE ** 2);
    const at = (row: number, col: number): number[] =>
      Array.from(texels.subarray(4 * (row * STONES_SIZE + col), 4 * (row * STONES_SIZE + col) + 4), (v) =>
        Math.round(255 * v),
      );
    expect([at(0, 0), at(17, 300), at(255, 511), at(400, 33)]).toEqual(STONE_TEXELS);
    let [seam, inner, lean] = [0, 0, 0];
    for (let r = 0; r < STONES_SIZE; r += 1) {
      seam += Math.abs(at(r, 0)[0]! - at(r, STONES_SIZE - 1)[0]!);
      inner += Math.abs(at(r, 100)[0]! - at(r, 101)[0]!);
      for (let c = 0; c < STONES_SIZE; c += 1) lean += texels[4 * (r * STONES_SIZE + c) + 2]! - 0.5;
    }
    expect(seam).toBeLessThan(2 * inner);
    expect(Math.abs(lean / STONES_SIZE ** 2)).toBeLessThan(0.005);
  });
});

describe("the map", () => {
  it("R16: slopes to the north-west are lit, those to the south-east are in shade", () => {
    const flat = hillshade(0, 0);
    expect(hillshade(0.5, -0.5)).toBeGreaterThan(flat);
    expect(hillshade(-0.5, 0.5)).toBeLessThan(0.6 * flat);
  });

  it("R16: draws sea below the level, land above, and no line over flat ground at a round height", () => {
    const style = {
      look: "natural",
      sizeM: 4096,
      seaM: 0,
      lakes: null,
      contourM: 20,
      contours: true,
      slope: false,
    } as const;
    const slot = new Float32Array(69 * 69).fill(0);
    const out = new Uint8ClampedArray(64 * 64 * 4);
    const root = { level: 0, x: 0, y: 0 };
    shadeTile(slot, root, 64, { ...style, seaM: null }, out);
    const plain = [...out.subarray(0, 4)];
    expect(plain[1]).toBeGreaterThan(180);
    slot.fill(-40);
    shadeTile(slot, root, 64, style, out);
    expect(out[2]).toBeGreaterThan(out[0]! + 20);
    // A lake in the south-west alone, 10 m above the ground there.
    const heights = new Float32Array(9).fill(-40);
    const levels = Float32Array.from([-30, -30, NO_LAKE, -30, -30, NO_LAKE, NO_LAKE, NO_LAKE, NO_LAKE]);
    shadeTile(slot, root, 64, { ...style, seaM: null, lakes: { side: 3, heights, levels, samples: new Map() } }, out);
    const blue = (row: number, col: number): number => out[4 * (64 * row + col) + 2]! - out[4 * (64 * row + col)]!;
    expect(blue(60, 4)).toBeGreaterThan(20);
    expect(blue(4, 4)).toBeLessThan(0);
    expect(blue(60, 60)).toBeLessThan(0);
  });
});

describe("contours on the map (SPEC N21, N22, N23)", () => {
  const style = {
    look: "natural",
    sizeM: 4096,
    seaM: null,
    lakes: null,
    contourM: 20,
    contours: true,
    slope: false,
  } as const;
  const whole = (share: number) => ({ side: 2, values: new Float32Array(4).fill(share) });
  /** A plain on which the detail wavers about 20 m, the height of a contour. */
  const noisy = Float32Array.from({ length: 69 * 69 }, (_, i) => 20 + 0.8 * Math.sin(i * 12.9898));
  const slope = Float32Array.from({ length: 69 * 69 }, (_, i) => (i % 69) * 8);
  const shade = (slot: Float32Array, over: object): Uint8ClampedArray => {
    const out = new Uint8ClampedArray(128 * 128 * 4);
    shadeTile(slot, { level: 0, x: 0, y: 0 }, 128, { ...style, ...over }, out);
    return out;
  };
  const inked = (slot: Float32Array, over: object): number => {
    const [plain, lines] = [shade(slot, { ...over, contours: false }), shade(slot, over)];
    return lines.reduce((sum, v, i) => sum + Math.abs(v - plain[i]!), 0);
  };

  it("are not drawn where the solved ground is flat, and as ever where it rises", () => {
    expect(inked(noisy, {})).toBeGreaterThan(10_000);
    expect(inked(noisy, { contourShares: whole(0) })).toBe(0);
    expect(inked(slope, { contourShares: whole(1) })).toBe(inked(slope, {}));
  });

  it("follow the interval, and are wider for projectors", () => {
    expect(inked(slope, { contourM: 100 })).toBeLessThan(0.6 * inked(slope, { contourM: 40 }));
    expect(inked(slope, { contourM: 100, lineScale: 1.7 })).toBeGreaterThan(1.2 * inked(slope, { contourM: 100 }));
  });
});

describe("opening a device", () => {
  const canvas = {} as HTMLCanvasElement;

  it("R19: says that a secure page is needed", async () => {
    vi.stubGlobal("isSecureContext", false);
    await expect(openGpu(canvas)).rejects.toThrow(/https/);
    vi.unstubAllGlobals();
  });

  it("R19: says that the browser has no WebGPU, and that no device was found", async () => {
    vi.stubGlobal("isSecureContext", true);
    vi.stubGlobal("navigator", {});
    await expect(openGpu(canvas)).rejects.toBeInstanceOf(NoWebGpu);
    const asked: unknown[] = [];
    vi.stubGlobal("navigator", {
      gpu: {
        requestAdapter: async (options: { featureLevel?: string }) => {
          asked.push(options.featureLevel);
          return null;
        },
      },
    });
    await expect(openGpu(canvas)).rejects.toThrow(/no graphics device/);
    expect(asked).toEqual(["core", "compatibility"]);
    vi.unstubAllGlobals();
  });
});

describe("up close", () => {
  it("U636: calm lines are hairlines of which nothing shows behind hills", () => {
    const line: StrokeVisual = {
      id: "a",
      kind: "profile",
      points: new Float32Array(6),
      colour: [1, 1, 1, 0.2],
      selected: false,
      hovered: false,
      live: false,
    };
    const [calm, clear] = [strokeStyle({ ...line, calm: true }, 1), strokeStyle(line, 1)];
    expect(calm.halfWidthPx).toBeLessThan(clear.halfWidthPx);
    expect([calm.hiddenOpacity, clear.hiddenOpacity > 0]).toEqual([0, true]);
    expect(strokeStyle({ ...line, hovered: true }, 1).halfWidthPx).toBeGreaterThan(clear.halfWidthPx);
  });

  it("R613: what grows is read on the level whose samples are about eight metres apart", () => {
    expect([512, 4096, 4097, 65536, 1].map(soilLevel)).toEqual([0, 3, 3, 7, 0]);
  });
});
