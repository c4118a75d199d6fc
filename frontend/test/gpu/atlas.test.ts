/** Slots, uploads and residency (SPEC R10, R11): a recording device stands in for the GPU; no drawing here. */

import { beforeAll, describe, expect, it } from "vitest";
import { assembleBordered, assembleSlot, BORDER, SLOT_AREA, SLOT_TEXELS } from "../../src/gpu/atlas/apron.ts";
import { Atlas, type Resident } from "../../src/gpu/atlas/atlas.ts";
import { craggyField, FieldView, filteredField, SparseView } from "./world.ts";

beforeAll(() => {
  const flags = new Proxy({}, { get: () => 1 });
  Object.assign(globalThis, { GPUTextureUsage: flags, GPUBufferUsage: flags });
});

interface Upload {
  slot: number;
  data: Float32Array;
}

/** A device that remembers what was written to the grounds. */
function recorder(bindingSize = 2 ** 27): { device: GPUDevice; uploads: Upload[] } {
  const uploads: Upload[] = [];
  const device = {
    limits: { maxStorageBufferBindingSize: bindingSize },
    createTexture: () => ({ destroy() {} }),
    createBuffer: ({ label }: { label: string }) => ({ label, destroy() {} }),
    queue: {
      writeBuffer(to: { label: string }, offset: number, data: Float32Array) {
        if (to.label === "atlas grounds") uploads.push({ slot: offset / (8 * SLOT_AREA), data: data.slice() });
      },
    },
  };
  return { device: device as unknown as GPUDevice, uploads };
}

function requests(view: FieldView, level: number): { level: number; x: number; y: number }[] {
  return [...view.tiles()].filter((t) => t.level <= level).map(({ level: l, x, y }) => ({ level: l, x, y }));
}

const heldBy =
  (view: FieldView, level: number, x: number, y: number) =>
  (dx: number, dy: number): Float32Array | undefined =>
    view.tile(level, x + dx, y + dy)?.heights;

/** Base of a sample; guide is the same where both are held. */
const at = (slot: Float32Array, col: number, row: number): number =>
  slot[2 * ((row + BORDER) * SLOT_TEXELS + col + BORDER) + 1]!;

describe("slots", () => {
  const view = new FieldView(4096, 2, (x, y) => 0.1 * x - 0.03 * y + ((x * y) % 97));

  it("R10: the border is the neighbours' samples, guide and base alike", () => {
    const slot = new Float32Array(2 * SLOT_AREA);
    assembleSlot(heldBy(view, 2, 1, 1), slot);
    const east = view.tile(2, 2, 1)!;
    const southWest = view.tile(2, 0, 0)!;
    expect(at(slot, 66, 10)).toBe(east.heights[10 * 65 + 2]);
    expect(at(slot, -2, -1)).toBe(southWest.heights[63 * 65 + 62]);
    expect(at(slot, 30, 40)).toBe(view.tile(2, 1, 1)!.heights[40 * 65 + 30]);
    for (let i = 0; i < SLOT_AREA; i += 1) expect(slot[2 * i]).toBe(slot[2 * i + 1]);
  });

  it("R10: only what is held is written", () => {
    const tile = view.tile(2, 1, 1)!;
    const slot = new Float32Array(2 * SLOT_AREA).fill(-7777);
    assembleSlot((dx, dy) => (dx === -1 && dy === 0 ? view.tile(2, 0, 1)!.heights : undefined), slot);
    expect(at(slot, -1, 12)).toBe(view.tile(2, 0, 1)!.heights[12 * 65 + 63]);
    expect(at(slot, 0, 12)).toBe(tile.heights[12 * 65]);
    expect(at(slot, 1, 12)).toBe(-7777);
    expect(at(slot, -1, -1)).toBe(-7777);
  });

  it("R10: where nothing is made, the border goes on with the slope of the edge", () => {
    const slope = new FieldView(4096, 0, (x, y) => 2 * x + 5 * y);
    const slot = new Float32Array(SLOT_AREA);
    assembleBordered(slope.tile(0, 0, 0)!.heights, () => undefined, slot);
    const single = (col: number, row: number): number => slot[(row + BORDER) * SLOT_TEXELS + col + BORDER]!;
    expect(single(-2, 20)).toBeCloseTo(2 * -128 + 5 * 20 * 64, 2);
    expect(single(66, 66)).toBeCloseTo(7 * 66 * 64, 1);
  });

  it("R10: tiles that disagree on a shared edge still get the same samples there", () => {
    const tiles = new Map<string, Float32Array>();
    for (const [i, [x, y]] of (
      [
        [0, 0],
        [1, 0],
        [0, 1],
        [1, 1],
      ] as const
    ).entries()) {
      tiles.set(
        `${x}/${y}`,
        view.tile(1, x, y)!.heights.map((h) => h + 10 * i),
      );
    }
    const slots = new Map<string, Float32Array>();
    for (const name of tiles.keys()) {
      const [x, y] = name.split("/").map(Number) as [number, number];
      const slot = new Float32Array(2 * SLOT_AREA);
      assembleSlot((dx, dy) => tiles.get(`${x + dx}/${y + dy}`), slot);
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

const names = (residents: readonly Resident[]): string[] => residents.map((r) => `${r.level}/${r.x}/${r.y}`);

describe("atlas", () => {
  it("R11: all resident tiles that changed are uploaded in one frame, and only those", () => {
    const view = new FieldView(4096, 3, filteredField(1, 50));
    const { device, uploads } = recorder();
    const atlas = new Atlas(device, () => {});
    atlas.refresh(view);
    atlas.admit(requests(view, 3), 1000);
    expect(atlas.count).toBe(85);
    uploads.length = 0;
    expect(atlas.refresh(view)).toEqual({ remade: [], moved: [] });
    view.change(filteredField(2, 50));
    expect(atlas.refresh(view).remade).toHaveLength(85);
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
    const atlas = new Atlas(device, () => {});
    atlas.refresh(view);
    atlas.admit(requests(view, 1), 100);
    have.add("1/1/0");
    view.change((x) => x * x * 1e-3);
    expect(names(atlas.refresh(view).remade).sort()).toEqual(["0/0/0", "1/0/0"]);
  });

  it("R11: new tiles are rationed, the root has slot 0, the memory bound holds, what is used stays", () => {
    const view = new FieldView(4096, 5, () => 0);
    const { device } = recorder();
    const usable = new Set<string>();
    let left = 0;
    const atlas = new Atlas(
      device,
      (l, x, y, on) => {
        if (on) usable.add(`${l}/${x}/${y}`);
        else if (usable.delete(`${l}/${x}/${y}`)) left += 1;
      },
      256,
    );
    const all = requests(view, 5);
    atlas.refresh(view);
    expect(atlas.admit(all, 16)).toHaveLength(16);
    expect(atlas.slot(0, 0, 0)).toBe(0);
    for (let frame = 0; frame < 60; frame += 1) {
      atlas.refresh(view);
      atlas.touch(1, 1, 1);
      atlas.touch(0, 0, 0);
      // A viewer who moves over the ground: other tiles each frame.
      const moved = all.slice(21 + frame * 16, 21 + frame * 16 + 16);
      atlas.admit(moved, 16);
    }
    expect(usable.size).toBeLessThanOrEqual(256);
    expect(usable.has("0/0/0")).toBe(true);
    expect(usable.has("1/1/1")).toBe(true);
    expect(left).toBeGreaterThan(0);
    expect(new Set([...atlas.residents()].map((r) => r.slot)).size).toBe(usable.size);
  });

  it("R11: a tile that the store dropped leaves", () => {
    const view = new FieldView(4096, 1, () => 0);
    const { device } = recorder();
    const atlas = new Atlas(device, () => {});
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
    const atlas = new Atlas(device, () => {});
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

describe("synthetic tiles", () => {
  const SIZE = 65536;

  function scene(): { view: SparseView; atlas: Atlas; uploads: Upload[] } {
    const view = new SparseView(SIZE, 10, 2, craggyField(4, SIZE));
    const { device, uploads } = recorder();
    const atlas = new Atlas(device, () => {}, 128);
    atlas.refresh(view);
    const solved = [...view.tiles()].map(({ level, x, y }) => ({ level, x, y }));
    expect(atlas.admit(solved, 1000)).toHaveLength(21);
    return { view, atlas, uploads };
  }

  /** The chain of tiles over the domain's north-east corner region, level `from` to `to`. */
  const chain = (from: number, to: number): { level: number; x: number; y: number }[] =>
    Array.from({ length: to - from + 1 }, (_, i) => {
      const level = from + i;
      return { level, x: Math.floor(0.7 * 2 ** level), y: Math.floor(0.6 * 2 ** level) };
    });

  it("R50: above the solved levels any tile below a resident one can enter, and needs no upload", () => {
    const { atlas, uploads } = scene();
    uploads.length = 0;
    expect(atlas.admit([{ level: 5, x: 3, y: 3 }], 9)).toHaveLength(0);
    expect(atlas.admit(chain(3, 17), 99)).toHaveLength(15);
    expect(uploads).toHaveLength(0);
    const finest = [...atlas.residents()].find((r) => r.level === 17)!;
    expect(atlas.parentOf(finest).level).toBe(16);
    expect(finest.held).toBe(0);
  });

  it("R50: on the solved levels only what is held enters", () => {
    const { device } = recorder();
    const hole = new FieldView(
      4096,
      2,
      () => 0,
      (l, x) => l < 2 || x !== 1,
    );
    const atlas = new Atlas(device, () => {});
    atlas.refresh(hole);
    atlas.admit(requests(hole, 1), 99);
    expect(atlas.admit([{ level: 2, x: 1, y: 0 }], 9)).toHaveLength(0);
    expect(atlas.admit([{ level: 2, x: 0, y: 0 }], 9)).toHaveLength(1);
  });

  it("R51: a refined tile that comes moves itself, its neighbours and what lies below; detail stays", () => {
    const { view, atlas, uploads } = scene();
    const deep = chain(3, 8);
    atlas.admit(deep, 99);
    const beside = { ...deep[0]!, x: deep[0]!.x - 1 };
    atlas.admit([beside, { ...deep[0]!, x: deep[0]!.x - 3 }], 99);
    uploads.length = 0;
    const { level, x, y } = deep[0]!;
    view.hold(level, x, y);
    const { remade, moved } = atlas.refresh(view);
    expect(remade).toEqual([]);
    expect(names(moved).sort()).toEqual([...deep, beside].map((t) => `${t.level}/${t.x}/${t.y}`).sort());
    // Its own samples, and the two columns of its neighbour's border.
    expect(uploads).toHaveLength(2);
  });

  it("R51: solved ground that changes makes all below anew, parents first; lean, what nobody sees leaves instead", () => {
    const { view, atlas } = scene();
    atlas.admit(chain(3, 12), 99);
    view.change(craggyField(5, SIZE));
    const { remade } = atlas.refresh(view);
    expect(remade).toHaveLength(31);
    const order = new Map(remade.map((r, i) => [r, i]));
    for (const r of remade) if (r.level > 0) expect(order.get(atlas.parentOf(r))!).toBeLessThan(order.get(r)!);
    atlas.refresh(view);
    for (const { level, x, y } of [{ level: 0, x: 0, y: 0 }, ...chain(1, 4)]) atlas.touch(level, x, y);
    view.change(craggyField(6, SIZE));
    const lean = atlas.refresh(view, true).remade;
    expect(names(lean)).toEqual(["0/0/0", ...names(chain(1, 4) as Resident[])]);
    expect(atlas.count).toBe(5);
  });

  it("R51: new settings make everything anew", () => {
    const { view, atlas } = scene();
    atlas.admit(chain(3, 5), 99);
    atlas.remakeAll();
    expect(atlas.refresh(view).remade).toHaveLength(24);
    expect(atlas.refresh(view).remade).toHaveLength(0);
  });

  it("R52: no tile outlives its parent, whatever leaves first; a full atlas says so", () => {
    const { view, atlas } = scene();
    for (let round = 0; round < 60; round += 1) {
      atlas.refresh(view);
      const y = (round * 5) % 8;
      for (let level = 3; level < 9; level += 1)
        atlas.admit(
          Array.from({ length: 4 }, (_, x) => ({ level, x: (x + round) % 8, y })),
          64,
        );
      for (const r of atlas.residents()) expect(atlas.holds(atlas.parentOf(r))).toBe(true);
      expect(atlas.count).toBeLessThanOrEqual(128);
    }
    atlas.refresh(view);
    for (const r of atlas.residents()) atlas.touch(r.level, r.x, r.y);
    const many = Array.from({ length: 64 }, (_, i) => ({ level: 3, x: i % 8, y: i >> 3 }));
    atlas.admit(many, 64);
    expect(atlas.full).toBe(atlas.count === 128);
  });

  it("R52: no more slots than the device can bind", () => {
    const { device } = recorder(100 * SLOT_AREA * 16 + 5);
    expect(new Atlas(device, () => {}).capacity).toBe(100);
  });

  it("R54: a refined tile that comes or goes blends over, and all that touches it follows; without shares it is there", () => {
    const { view, atlas, uploads } = scene();
    const [first] = chain(3, 3);
    const { level, x, y } = first!;
    atlas.admit([first!, { level, x: x - 1, y }, ...chain(4, 5)], 9);
    const height = (): number =>
      uploads.filter((u) => u.slot === atlas.slot(level, x, y)).at(-1)!.data[2 * (30 * 69 + 30) + 1]!;
    view.hold(level, x, y);
    const stored = view.tile(level, x, y)!.heights[28 * 65 + 28]!;
    const way: number[] = [];
    for (let frame = 0; frame < 8; frame += 1) {
      uploads.length = 0;
      const { remade, moved } = atlas.refresh(view, false, 0.2);
      expect(remade).toHaveLength(0);
      if (frame < 5) {
        expect(names(moved).sort()).toEqual(
          [`3/${x - 1}/${y}`, `3/${x}/${y}`, ...names(chain(4, 5) as Resident[])].sort(),
        );
        way.push(height());
      } else expect(moved).toHaveLength(0);
    }
    expect(atlas.blending).toBe(false);
    expect(way.at(-1)).toBe(stored);
    const rest = way.map((h) => Math.abs(h - stored));
    for (let i = 1; i < rest.length; i += 1) expect(rest[i]!).toBeLessThan(rest[i - 1]!);
    view.drop(level, x, y);
    atlas.refresh(view, false, 0.25);
    expect(atlas.blending).toBe(true);
    expect([...atlas.residents()].find((r) => r.level === 3 && r.x === x)!.held & 16).toBe(16);
    for (let frame = 0; frame < 4; frame += 1) atlas.refresh(view, false, 0.25);
    expect(atlas.blending).toBe(false);
    expect([...atlas.residents()].find((r) => r.level === 3 && r.x === x)!.held).toBe(0);
    view.hold(level, x, y);
    uploads.length = 0;
    atlas.refresh(view);
    expect(atlas.blending).toBe(false);
    expect(height()).toBe(stored);
  });
});
