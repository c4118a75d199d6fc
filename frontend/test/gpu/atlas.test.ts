/** Slots, uploads and residency (SPEC R10, R11): a recording device stands in for the GPU; no drawing here. */

import { beforeAll, describe, expect, it } from "vitest";
import type { Tile } from "../../src/core/types.ts";
import { assembleSlot, BORDER, SLOT_TEXELS } from "../../src/gpu/apron.ts";
import { Atlas, NEW_TILES_PER_FRAME } from "../../src/gpu/atlas.ts";
import { FieldView, filteredField } from "./world.ts";

beforeAll(() => {
  const flags = new Proxy({}, { get: () => 1 });
  Object.assign(globalThis, { GPUTextureUsage: flags, GPUBufferUsage: flags });
});

interface Upload {
  origin: number[];
  data: Float32Array;
}

function recorder(): { device: GPUDevice; uploads: Upload[] } {
  const uploads: Upload[] = [];
  const device = {
    createTexture: () => ({ destroy() {} }),
    createBuffer: () => ({ destroy() {} }),
    queue: {
      writeTexture: (to: { origin: number[] }, data: Float32Array) =>
        uploads.push({ origin: to.origin, data: data.slice() }),
      writeBuffer() {},
    },
  };
  return { device: device as unknown as GPUDevice, uploads };
}

function requests(view: FieldView, level: number): { level: number; x: number; y: number }[] {
  return [...view.tiles()].filter((t) => t.level <= level).map(({ level: l, x, y }) => ({ level: l, x, y }));
}

function neighbourOf(view: FieldView, tile: Tile): (dx: number, dy: number) => Tile | undefined {
  return (dx, dy) => view.tile(tile.level, tile.x + dx, tile.y + dy);
}

const at = (slot: Float32Array, col: number, row: number): number => slot[(row + BORDER) * SLOT_TEXELS + col + BORDER]!;

describe("slots", { timeout: 60_000 }, () => {
  const view = new FieldView(4096, 2, (x, y) => 0.1 * x - 0.03 * y + ((x * y) % 97));

  it("R10: the border is the neighbours' samples", () => {
    const tile = view.tile(2, 1, 1)!;
    const slot = new Float32Array(SLOT_TEXELS ** 2);
    assembleSlot(tile, neighbourOf(view, tile), slot);
    const east = view.tile(2, 2, 1)!;
    const southWest = view.tile(2, 0, 0)!;
    expect(at(slot, 66, 10)).toBe(east.heights[10 * 65 + 2]);
    expect(at(slot, -2, -1)).toBe(southWest.heights[63 * 65 + 62]);
    expect(at(slot, 30, 40)).toBe(tile.heights[40 * 65 + 30]);
  });

  it("R10: without neighbours the border goes on with the slope of the edge", () => {
    const slope = new FieldView(4096, 0, (x, y) => 2 * x + 5 * y);
    const tile = slope.tile(0, 0, 0)!;
    const slot = new Float32Array(SLOT_TEXELS ** 2);
    assembleSlot(tile, () => undefined, slot);
    expect(at(slot, -2, 20)).toBeCloseTo(2 * -128 + 5 * 20 * 64, 2);
    expect(at(slot, 66, 66)).toBeCloseTo(7 * 66 * 64, 1);
  });

  it("R10: tiles that disagree on a shared edge still get the same samples there", () => {
    const bumped = (tile: Tile, by: number): Tile => ({ ...tile, heights: tile.heights.map((h) => h + by) });
    const tiles = new Map<string, Tile>();
    for (const [i, [x, y]] of (
      [
        [0, 0],
        [1, 0],
        [0, 1],
        [1, 1],
      ] as const
    ).entries()) {
      tiles.set(`${x}/${y}`, bumped(view.tile(1, x, y)!, 10 * i));
    }
    const slots = new Map<string, Float32Array>();
    for (const [name, tile] of tiles) {
      const slot = new Float32Array(SLOT_TEXELS ** 2);
      assembleSlot(tile, (dx, dy) => tiles.get(`${tile.x + dx}/${tile.y + dy}`), slot);
      slots.set(name, slot);
    }
    for (let k = 0; k <= 64; k += 1) {
      expect(at(slots.get("0/0")!, 64, k)).toBe(at(slots.get("1/0")!, 0, k));
      expect(at(slots.get("0/0")!, k, 64)).toBe(at(slots.get("0/1")!, k, 0));
      expect(at(slots.get("0/1")!, 64, k)).toBe(at(slots.get("1/1")!, 0, k));
    }
    expect(at(slots.get("1/1")!, 0, 0)).toBe(at(slots.get("0/0")!, 64, 64));
  });
});

describe("atlas", { timeout: 60_000 }, () => {
  it("R11: all resident tiles that changed are uploaded in one frame, and only those", () => {
    const view = new FieldView(4096, 3, filteredField(1, 50));
    const { device, uploads } = recorder();
    const atlas = new Atlas(device, 3, () => {});
    atlas.refresh(view);
    atlas.admit(requests(view, 3), 1000);
    expect(atlas.count).toBe(85);
    uploads.length = 0;
    expect(atlas.refresh(view)).toHaveLength(0);
    view.change(filteredField(2, 50));
    expect(atlas.refresh(view)).toHaveLength(85);
    expect(uploads).toHaveLength(85);
  });

  it("R11: a tile that appears renews the border of its neighbours in the same frame", () => {
    const have = new Set(["0/0/0", "1/0/0"]);
    const view = new FieldView(
      4096,
      1,
      (x) => x * x * 1e-3,
      (l, x, y) => have.has(`${l}/${x}/${y}`),
    );
    const { device } = recorder();
    const atlas = new Atlas(device, 1, () => {});
    atlas.refresh(view);
    atlas.admit(requests(view, 1), 100);
    have.add("1/1/0");
    view.change((x) => x * x * 1e-3);
    const changed = atlas.refresh(view);
    expect(changed.map((r) => `${r.level}/${r.x}/${r.y}`).sort()).toEqual(["0/0/0", "1/0/0"]);
  });

  it("R11: new tiles are rationed, the root has slot 0, the memory bound holds, what is used stays", () => {
    const view = new FieldView(4096, 5, () => 0);
    const { device } = recorder();
    const usable = new Set<string>();
    const atlas = new Atlas(
      device,
      5,
      (l, x, y, on) => (on ? usable.add(`${l}/${x}/${y}`) : usable.delete(`${l}/${x}/${y}`)),
      256,
    );
    const all = requests(view, 5);
    atlas.refresh(view);
    expect(atlas.admit(all, NEW_TILES_PER_FRAME)).toHaveLength(16);
    expect(atlas.slot(0, 0, 0)).toBe(0);
    for (let frame = 0; frame < 60; frame += 1) {
      atlas.refresh(view);
      atlas.touch(1, 1, 1);
      atlas.touch(0, 0, 0);
      // A viewer who moves over the ground: other tiles each frame.
      const moved = all.slice(21 + frame * 16, 21 + frame * 16 + 16);
      atlas.admit(moved, NEW_TILES_PER_FRAME);
    }
    expect(usable.size).toBeLessThanOrEqual(256);
    expect(usable.has("0/0/0")).toBe(true);
    expect(usable.has("1/1/1")).toBe(true);
    expect(usable.has("5/0/0")).toBe(false);
    expect(new Set([...atlas.residents()].map((r) => r.slot)).size).toBe(usable.size);
  });

  it("R11: a tile that the store dropped leaves", () => {
    const view = new FieldView(4096, 1, () => 0);
    const { device } = recorder();
    const atlas = new Atlas(device, 1, () => {});
    atlas.refresh(view);
    atlas.admit(requests(view, 1), 100);
    view.drop(1, 1, 0);
    atlas.refresh(view);
    expect([...atlas.residents()].some((r) => r.level === 1 && r.x === 1 && r.y === 0)).toBe(false);
  });

  it("R25: ground that changed has moved; tiles that come or go have moved nothing", () => {
    const have = new Set(["0/0/0", "1/0/0"]);
    const view = new FieldView(
      4096,
      1,
      () => 0,
      (l, x, y) => have.has(`${l}/${x}/${y}`),
    );
    const { device } = recorder();
    const atlas = new Atlas(device, 1, () => {});
    atlas.refresh(view);
    expect(atlas.groundMoved).toBe(false);
    view.drop(1, 0, 0);
    atlas.refresh(view);
    expect(atlas.groundMoved).toBe(false);
    view.change((x) => x);
    atlas.refresh(view);
    expect(atlas.groundMoved).toBe(true);
    atlas.refresh(view);
    expect(atlas.groundMoved).toBe(false);
  });
});
