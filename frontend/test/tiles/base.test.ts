/** SPEC T47 to T49: what is drawn is offsets plus base, whole, without a seam, whichever of the two is late. */

import { describe, expect, test } from "vitest";
import { predictMetres } from "../../src/core/predict.ts";
import { keyLevel, parentKey, tileKey } from "../../src/core/tilekey.ts";
import type { DecodedFrame, DecodedTile, Tile } from "../../src/core/types.ts";
import { Channel } from "../../src/generated/contract.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { all, frame, LEVELS, SIZE_M, seams, sessionFrames, tileOf } from "./frames.ts";

type Height = (x: number, y: number) => number;

const flat = () => 0;
const bump: Height = (x, y) => 40 * Math.exp(-((x - 300) ** 2 + (y - 200) ** 2) / 20_000);
/** No parent predicts it. */
const rough: Height = (x, y) => 700 + 0.2 * x + 6 * Math.sin(x / 5.3) * Math.cos(y / 7.1);
const base = (
  kind: "LEVEL" | "FILL",
  level: number,
  tiles: readonly DecodedTile[],
  drops: { x: number; y: number }[] = [],
) => frame(kind, level, tiles, drops, Channel.BASE);

/** Levels 0 to 2 of offsets, then of a base. */
function filled(offset: Height, under: Height | null): TileStore {
  const store = new TileStore(SIZE_M, LEVELS);
  for (let level = 0; level <= 2; level++) store.apply(frame("LEVEL", level, all(level, 1, offset)));
  if (under) for (let level = 0; level <= 2; level++) store.apply(base("LEVEL", level, all(level, 1, under)));
  return store;
}

const quantum = (level: number) => SIZE_M / (64 * 2 ** level) / 256;
const keyOf = (t: Tile) => tileKey(t.level, t.x, t.y);

/** What a tile must show: both parts in whole quanta. */
function expected(t: Tile, offset: Height, under: Height): Float32Array {
  const [a, b] = [tileOf(t.level, t.x, t.y, 1, offset).samples, tileOf(t.level, t.x, t.y, 1, under).samples];
  const q = quantum(t.level);
  return Float32Array.from(a, (v, i) => Math.fround(v * q) + Math.fround(b[i]! * q));
}

describe("a session from the server", () => {
  test("no seam at any step, and the parent of what is drawn is drawn, while a base comes, moves and goes", () => {
    const store = new TileStore(SIZE_M, 4, 3);
    let moved = 0;
    for (const f of sessionFrames("based")) {
      store.apply(f);
      expect(seams(store)).toEqual([]);
      const keys = new Set([...store.tiles()].map(keyOf));
      for (const key of keys) expect(keyLevel(key) === 0 || keys.has(parentKey(key))).toBe(true);
      moved += [...store.tiles()].filter((t) => !t.exact).length;
    }
    expect(moved).toBeGreaterThan(50);
  });

  test("shows the same whether anybody looked in between or not", () => {
    const [watched, left] = [new TileStore(SIZE_M, 4, 3), new TileStore(SIZE_M, 4, 3)];
    const steps = sessionFrames("based");
    steps.forEach((f, i) => {
      for (const store of [watched, left]) store.apply(f);
      const tiles = new Map([...watched.tiles()].map((t) => [keyOf(t), t]));
      if (i % 3 < 2 && i < steps.length - 1) return;
      expect([...left.tiles()].length).toBe(tiles.size);
      for (const t of left.tiles()) {
        const other = tiles.get(keyOf(t))!;
        expect([t.exact, t.version]).toEqual([other.exact, other.version]);
        expect(t.heights.every((v, k) => v === other.heights[k])).toBe(true);
        expect(t.subError).toEqual(other.subError);
      }
    });
    const store = filled(bump, rough);
    const before = store.tile(2, 1, 1)!.subError.slice();
    store.apply(
      base(
        "LEVEL",
        1,
        all(1, 2, (x, y) => rough(x, y) + 9),
      ),
    );
    store.apply(base("LEVEL", 2, []));
    const after = store.tile(2, 1, 1)!;
    expect(after.exact).toBe(true);
    expect(after.subError[5]! - before[5]!).toBeGreaterThan(5);
  });

  test("ends with the sum of what was sent last, to the bit", () => {
    const frames = sessionFrames("based");
    const until = frames.findLastIndex((f) => f.channel === Channel.BASE && f.clock === 4) + 2;
    const store = new TileStore(SIZE_M, 4, 3);
    const last = new Map<number, Map<string, Int32Array>>([
      [Channel.HEIGHT, new Map()],
      [Channel.BASE, new Map()],
    ]);
    for (const f of frames.slice(0, until)) {
      store.apply(f);
      for (const t of f.tiles) last.get(f.channel)!.set(`${f.level}/${t.x}/${t.y}`, t.samples);
    }
    let refined = 0;
    for (const t of store.tiles()) {
      const [a, b] = [Channel.HEIGHT, Channel.BASE].map((c) => last.get(c)!.get(`${t.level}/${t.x}/${t.y}`)!);
      const q = quantum(t.level);
      expect(t.exact).toBe(true);
      expect(t.heights.every((h, i) => h === Math.fround(Math.fround(a![i]! * q) + Math.fround(b![i]! * q)))).toBe(
        true,
      );
      if (t.level > 3) refined += 1;
    }
    expect(refined).toBeGreaterThan(0);
  });
});

describe("composing (T47)", () => {
  test("heights are the sum, bounds and errors those of the sum", () => {
    const store = filled(bump, rough);
    for (const t of store.tiles()) {
      expect(t.heights).toEqual(expected(t, bump, rough));
      expect(Math.max(...t.subMax)).toBe(Math.max(...t.heights));
      expect(Math.min(...t.subMin)).toBe(Math.min(...t.heights));
      if (t.level === 0) continue;
      const parent = store.tile(t.level - 1, t.x >> 1, t.y >> 1)!;
      const p = (r: number, c: number) => parent.heights[(32 * (t.y & 1) + r) * 65 + 32 * (t.x & 1) + c]!;
      let worst = 0;
      for (let r = 0; r < 65; r++)
        for (let c = 0; c < 65; c++) {
          const [r0, r1, c0, c1] = [r >> 1, (r + 1) >> 1, c >> 1, (c + 1) >> 1];
          const drawn = (p(r0, c0) + p(r0, c1) + p(r1, c0) + p(r1, c1)) / 4;
          worst = Math.max(worst, Math.abs(t.heights[r * 65 + c]! - drawn));
        }
      expect(Math.max(...t.subError)).toBeCloseTo(worst, 3);
    }
    expect(store.ground.heightAt(300, 200)).toBeCloseTo(bump(300, 200) + rough(300, 200), -1);
  });

  test("without strokes or without a base nothing is copied", () => {
    const store = filled(flat, rough);
    const [root] = store.tiles();
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 2, flat)]));
    expect(store.tile(0, 0, 0)!.heights).toBe(root!.heights);
    const zero = filled(bump, flat);
    const plain = filled(bump, null);
    for (const t of plain.tiles()) expect(zero.tile(t.level, t.x, t.y)!.heights).toEqual(t.heights);
  });

  test("a stroke leaves the objects of tiles that it does not reach alone, and so does a base (T18)", () => {
    const store = filled(flat, rough);
    const far = store.tile(2, 3, 3)!;
    const near = store.tile(2, 0, 0)!;
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 2, (x, y) => (x < 200 && y < 200 ? 10 : 0))]));
    expect(store.tile(2, 3, 3)).toBe(far);
    expect(store.tile(2, 0, 0)).not.toBe(near);
    expect(store.tile(2, 0, 0)!.stamp).toBe(store.stamp);
    store.apply(base("LEVEL", 2, [tileOf(2, 1, 1, 2, flat)]));
    expect(store.tile(2, 3, 3)).toBe(far);
    expect(store.tile(2, 1, 1)!.heights[2000]).toBeLessThan(40);
  });

  test("while its level lags, the base moves along with its parent; its LEVEL frame puts it right (T17)", () => {
    const store = filled(bump, rough);
    const before = store.tile(2, 1, 1)!;
    store.apply(base("LEVEL", 0, [tileOf(0, 0, 0, 2, (x, y) => rough(x, y) + 100)]));
    const during = store.tile(2, 1, 1)!;
    expect(during.exact).toBe(false);
    expect(during.heights[2112]! - before.heights[2112]!).toBeCloseTo(100, 1);
    expect(seams(store)).toEqual([]);
    store.apply(base("LEVEL", 1, []));
    store.apply(base("LEVEL", 2, []));
    expect(store.tile(2, 1, 1)!.exact).toBe(true);
    expect(store.tile(2, 1, 1)!.heights).toEqual(before.heights);
  });

  test("one step of the revision a frame; a frozen ground stays; clear forgets both streams", () => {
    const store = filled(bump, rough);
    const [stamp, frozen] = [store.stamp, store.freeze()];
    store.apply(base("LEVEL", 0, [tileOf(0, 0, 0, 2, flat)]));
    expect(store.stamp).toBe(stamp + 1);
    expect(frozen.heightAt(500, 500)).toBeGreaterThan(700);
    expect(store.ground.heightAt(500, 500)).toBeLessThan(100);
    store.clear();
    expect(store.size).toBe(0);
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 1, bump)]));
    expect(store.tile(0, 0, 0)!.heights).toEqual(filled(bump, null).tile(0, 0, 0)!.heights);
  });

  test("is settled when both streams are", () => {
    const store = new TileStore(SIZE_M, LEVELS, 0);
    const [offset, under] = [frame("LEVEL", 0, all(0, 1, bump)), base("LEVEL", 0, all(0, 1, rough))];
    store.apply({ ...offset, settled: true });
    store.apply(under);
    expect(store.settled).toBe(false);
    store.apply({ ...under, settled: true });
    expect(store.settled).toBe(true);
    store.apply({ ...base("LEVEL", 1, all(1, 1, rough)), settled: true });
    expect([store.size, store.baseSize]).toEqual([1, 5]);
  });
});

describe("a base that comes late (T48)", () => {
  test("while no tile of a level has one, all of it stand on what is predicted: full detail at once", () => {
    const store = filled(bump, null);
    store.apply(base("LEVEL", 0, all(0, 1, rough)));
    expect([...store.tiles()].length).toBe(21);
    expect(seams(store)).toEqual([]);
    const plain = filled(bump, null);
    const offsets = plain.tile(0, 0, 0)!.heights;
    const under = store.tile(0, 0, 0)!.heights.map((h, i) => h - offsets[i]!);
    const predicted = new Float32Array(65 * 65);
    predictMetres(under, 1, 0, predicted);
    const offset = plain.tile(1, 1, 0)!.heights;
    const found = store.tile(1, 1, 0)!;
    expect(found.exact).toBe(false);
    expect(found.heights.every((h, i) => Math.abs(h - offset[i]! - predicted[i]!) < 1e-3)).toBe(true);
  });

  test("once some have one, the others and all below them wait for theirs", () => {
    const store = filled(bump, null);
    const steps: DecodedFrame[] = [
      base("LEVEL", 0, all(0, 1, rough)),
      base("FILL", 1, [tileOf(1, 0, 0, 1, rough), tileOf(1, 1, 1, 1, rough)]),
    ];
    for (const step of steps) store.apply(step);
    expect(seams(store)).toEqual([]);
    expect(store.tile(1, 1, 0)).toBeUndefined();
    expect(store.tile(2, 3, 0)).toBeUndefined();
    expect(store.tile(2, 3, 3)).toBeDefined();
    expect([...store.tiles()].length).toBe(1 + 2 + 8);
    expect(store.freeze().tile(2, 3, 0)).toBeUndefined();
    expect(store.size).toBe(21);
    store.apply(base("FILL", 1, [tileOf(1, 1, 0, 1, rough), tileOf(1, 0, 1, 1, rough)]));
    expect([...store.tiles()].length).toBe(21);
    expect(seams(store)).toEqual([]);
    store.apply(base("LEVEL", 2, all(2, 1, rough)));
    for (const t of store.tiles()) expect(t.heights).toEqual(expected(t, bump, rough));
  });

  test("a tile whose base is dropped is not drawn until it comes again", () => {
    const store = filled(bump, rough);
    store.apply(base("LEVEL", 2, [], [{ x: 1, y: 1 }]));
    expect(store.tile(2, 1, 1)).toBeUndefined();
    expect(store.tile(2, 1, 2)).toBeDefined();
    store.apply(base("FILL", 2, [tileOf(2, 1, 1, 2, rough)]));
    expect(store.tile(2, 1, 1)!.heights).toEqual(expected(store.tile(2, 1, 1)!, bump, rough));
  });

  test("an offset tile that comes before its base waits", () => {
    const store = filled(bump, rough);
    store.apply(base("FILL", 3, [tileOf(3, 0, 0, 1, rough)]));
    store.apply(frame("FILL", 3, [tileOf(3, 1, 0, 1, bump), tileOf(3, 0, 0, 1, bump)]));
    expect(store.tile(3, 0, 0)).toBeDefined();
    expect(store.tile(3, 1, 0)).toBeUndefined();
    store.apply(base("FILL", 3, [tileOf(3, 1, 0, 1, rough)]));
    expect(seams(store)).toEqual([]);
    expect(store.tile(3, 1, 0)).toBeDefined();
  });
});
