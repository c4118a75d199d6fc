/** Levels without a fixed end (SPEC R50 to R53): asked for where somebody looks, bounded, expected before they are made. */

import { beforeAll, describe, expect, it } from "vitest";
import type { CameraState, TerrainSettings } from "../../src/core/types.ts";
import { Atlas, type Resident } from "../../src/gpu/atlas/atlas.ts";
import { finestLevel } from "../../src/tiles/detail/detail.ts";
import { expectation } from "../../src/tiles/detail/synthetic.ts";
import { recordColumn, recordLevel, recordRow, recordSlot } from "../../src/tiles/patches/records.ts";
import { type Cut, Selection } from "../../src/tiles/patches/selection.ts";
import { alpineField, FieldView, lookAt, PLAIN_CHANNELS } from "../gpu/world.ts";

const SIZE = 4096;
const FINEST = 13;
const SOLVED = 3;
const SETTINGS = { detail: 1, rule: "landscape" } as TerrainSettings;

beforeAll(() => {
  const flags = new Proxy({}, { get: () => 1 });
  Object.assign(globalThis, { GPUTextureUsage: flags, GPUBufferUsage: flags });
});

function device(): GPUDevice {
  const made = () => ({ destroy() {} });
  const queue = { writeBuffer() {} };
  const limits = { maxStorageBufferBindingSize: 2 ** 27 };
  return { limits, createTexture: made, createBuffer: made, queue } as unknown as GPUDevice;
}

/** What a device would measure: detail that halves with every level on ground that is linear within a cell. */
class Bench {
  readonly selection = new Selection(FINEST);
  readonly atlas: Atlas;
  readonly ground: (x: number, y: number) => number;
  /** Tiles enter as their parents' surface. */
  fades = false;

  constructor(
    readonly view: FieldView,
    slots: number,
    private readonly noiseM = 1.6,
  ) {
    const { tree } = this.selection;
    this.atlas = new Atlas(device(), (l, x, y, on) => tree.setUsable(l, x, y, on, this.fades && l > SOLVED), slots);
    this.selection.tree.expect(expectation(SIZE, SETTINGS, PLAIN_CHANNELS));
    const side = 64 << SOLVED;
    const at = (col: number, row: number): number => {
      const [x, y] = [Math.min(col >> 6, (1 << SOLVED) - 1), Math.min(row >> 6, (1 << SOLVED) - 1)];
      return view.tile(SOLVED, x, y)!.heights[(row - 64 * y) * 65 + col - 64 * x]!;
    };
    this.ground = (x, y) =>
      at(Math.min(side, Math.round((x / SIZE) * side)), Math.min(side, Math.round((y / SIZE) * side)));
  }

  /** One frame: refresh, select, admit, select again; then figures of what entered. */
  frame(camera: CameraState, limit = 64, tau = 1.5): { cut: Cut; entered: Resident[] } {
    this.atlas.refresh(this.view);
    const entered: Resident[] = [];
    for (;;) {
      const cut = this.selection.select(this.view, camera, tau, this.atlas);
      const more = this.atlas.admit(cut.requests, limit - entered.length);
      entered.push(...more);
      if (more.length > 0) continue;
      this.measure(entered);
      return { cut, entered };
    }
  }

  settle(camera: CameraState): { cut: Cut; made: number } {
    for (let made = 0, frames = 0; ; frames += 1) {
      const { cut, entered } = this.frame(camera);
      made += entered.length;
      if (entered.length === 0) return { cut, made };
      expect(frames).toBeLessThan(60);
    }
  }

  private measure(residents: readonly Resident[]): void {
    for (const { level, x, y } of residents) {
      const figures = new Float32Array(64);
      const w = SIZE / 4 / 2 ** level;
      const noise = this.noiseM * 2 ** -level;
      for (let sub = 0; sub < 16; sub += 1) {
        let low = 1e9;
        let high = -1e9;
        for (let i = 0; i < 9; i += 1) {
          const h = this.ground(
            (4 * x + (sub & 3) + (i % 3) / 2) * w,
            (4 * y + (sub >> 2) + Math.floor(i / 3) / 2) * w,
          );
          low = Math.min(low, h - noise);
          high = Math.max(high, h + noise);
        }
        figures.set([low, high, noise, noise / 2], 4 * sub);
      }
      this.selection.tree.measure(level, x, y, figures, 0);
    }
  }
}

const deepest = (cut: Cut): number => {
  let level = 0;
  for (let i = 0; i < cut.count; i += 1) level = Math.max(level, recordLevel(cut.records, i));
  return level;
};

describe("synthetic levels", () => {
  let view: FieldView;
  beforeAll(() => {
    const field = alpineField(0);
    view = new FieldView(SIZE, SOLVED, (x, y) => field(x, y, 0));
  });

  it("R50: the finest level has cells of a centimetre or a little less, whatever the size", () => {
    for (const size of [512, 4096, 20000]) {
      const cell = size / 64 / 2 ** finestLevel(size);
      expect(cell).toBeLessThanOrEqual(0.01);
      expect(cell).toBeGreaterThan(0.005);
    }
    expect(finestLevel(65536)).toBe(17);
    expect(finestLevel(4096)).toBe(FINEST);
  });

  it("R50: who stands on the ground sees the finest level, in a few frames, with fewer tiles than the atlas has", () => {
    const bench = new Bench(view, 512);
    const [x, y] = [1700, 2100];
    const eye = bench.ground(x, y) + 0.25;
    const { cut, made } = bench.settle(lookAt([x, y, eye], [x + 0.3, y + 0.1, eye - 0.2], 1024, 768, 50, 0.02, 40_000));
    expect(deepest(cut)).toBe(FINEST);
    expect(made).toBeLessThan(400);
    expect(cut.count).toBeLessThan(1200);
  });

  it("R53: ground on which nothing is added is asked for no further than its figures say", () => {
    const flat = new FieldView(SIZE, SOLVED, () => 0);
    const bench = new Bench(flat, 512, 1e-6);
    const { cut } = bench.settle(lookAt([2000, 2000, 2], [2003, 2003, 0], 1024, 768, 50, 0.02, 40_000));
    expect(deepest(cut)).toBeLessThanOrEqual(1);
    expect(bench.atlas.count).toBeLessThan(40);
  });

  it("R53: what was measured of a child outlives it: coming back asks for no tile twice without need", () => {
    const bench = new Bench(view, 160);
    const at = (x: number): CameraState => {
      const eye = bench.ground(x, 2100) + 40;
      return lookAt([x, 2100, eye], [x + 60, 2100, eye - 30], 800, 600, 50, 0.1, 40_000);
    };
    const first = bench.settle(at(1200)).made;
    bench.settle(at(3000));
    expect(bench.settle(at(1200)).made).toBeLessThanOrEqual(first);
  });

  it("R52: 300 frames of flight: the bound of the atlas holds, no patch lacks its tile, levels change by one", () => {
    const bench = new Bench(view, 256);
    bench.fades = true;
    let before = new Map<string, number>();
    let jumps = 0;
    let drawn = 0;
    for (let i = 0; i < 300; i += 1) {
      const x = 900 + 1.5 * i;
      const y = 1500 + 60 * Math.sin(i / 60);
      const eye = bench.ground(x, y) + 6 + 60 * (1 + Math.cos(i / 40));
      bench.selection.tree.advance(0.15);
      const { cut } = bench.frame(lookAt([x, y, eye], [x + 30, y + 9, eye - 12], 640, 480, 50, 0.1, 40_000));
      expect(bench.atlas.count).toBeLessThanOrEqual(256);
      const now = new Map<string, number>();
      for (let k = 0; k < cut.count; k += 1) {
        const level = recordLevel(cut.records, k);
        const [col, row] = [recordColumn(cut.records, k) >> 6, recordRow(cut.records, k) >> 6];
        expect(bench.atlas.slot(level, col, row)).toBe(recordSlot(cut.records, k));
        const key = [level, recordColumn(cut.records, k), recordRow(cut.records, k)].join();
        now.set(key, level);
      }
      // A patch that was drawn is drawn again, or its parent or children are: never two levels at once.
      for (const [key, level] of before) {
        const [, col, row] = key.split(",").map(Number) as [number, number, number];
        for (const l of [level - 2, level + 2]) {
          if (l < 0) continue;
          const k = [l, l < level ? (col >> 6) << 4 : col * 4, l < level ? (row >> 6) << 4 : row * 4].join();
          // In the first frames figures have not come yet.
          if (now.has(k) && i > 3) jumps += 1;
        }
      }
      drawn += cut.count;
      before = now;
    }
    // Two levels at once only where figures came that say otherwise than the guess.
    expect(jumps).toBeLessThan(drawn / 2000);
    expect(bench.selection.tree.capacity).toBeLessThanOrEqual(1024);
  });
});
