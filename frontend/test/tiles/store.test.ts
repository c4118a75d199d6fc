/** SPEC T16, T17, T18: the store shows frames whole, moves fine tiles along, and never opens a seam. */

import { effect } from "@preact/signals-core";
import { describe, expect, test } from "vitest";
import { predictMetres } from "../../src/core/predict.ts";
import type { Tile } from "../../src/core/types.ts";
import { FrameKind } from "../../src/generated/contract.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { all, frame, LEVELS, SIZE_M, seams, sessionFrames, tileOf } from "./frames.ts";

const flat = () => 0;
const bump = (x: number, y: number) => 40 * Math.exp(-((x - 300) ** 2 + (y - 200) ** 2) / 20_000);

/** Levels 0 to 2 of one ground. */
function filled(height: (x: number, y: number) => number): TileStore {
  const store = new TileStore(SIZE_M, LEVELS);
  for (let level = 0; level <= 2; level++) store.apply(frame("LEVEL", level, all(level, 1, height)));
  return store;
}

function samplesOf(store: TileStore, level: number): Tile[] {
  return [...store.tiles()].filter((t) => t.level === level);
}

describe("a session from the server", () => {
  test("no seam at any step of an interrupted session, whatever lags (T17)", () => {
    const store = new TileStore(SIZE_M, LEVELS);
    let previews = 0;
    for (const f of sessionFrames("interrupted")) {
      store.apply(f);
      expect(seams(store)).toEqual([]);
      previews += [...store.tiles()].filter((t) => !t.exact).length;
    }
    expect(previews).toBeGreaterThan(20);
  });

  test("ends exact, with the samples that were sent last (T17)", () => {
    const store = new TileStore(SIZE_M, LEVELS);
    const last = new Map<string, { samples: Int32Array; version: number }>();
    for (const f of sessionFrames("interrupted")) {
      store.apply(f);
      for (const t of f.tiles) last.set(`${f.level}/${t.x}/${t.y}`, t);
    }
    expect(store.size).toBe(85);
    for (const t of store.tiles()) {
      const sent = last.get(`${t.level}/${t.x}/${t.y}`)!;
      const quantum = SIZE_M / (64 * 2 ** t.level) / 256;
      expect(t.exact).toBe(true);
      expect(t.version).toBe(sent.version);
      expect(t.heights.every((h, i) => h === Math.fround(sent.samples[i]! * quantum))).toBe(true);
    }
  });

  test("holds what the decoder holds (T10)", () => {
    for (const name of ["session", "interrupted"]) {
      const store = new TileStore(SIZE_M, LEVELS);
      const held = new Set<string>();
      for (const f of sessionFrames(name)) {
        store.apply(f);
        for (const d of f.drops)
          for (const key of held) {
            const [level, x, y] = key.split("/").map(Number) as [number, number, number];
            const shift = level - f.level;
            if (shift >= 0 && x >> shift === d.x && y >> shift === d.y) held.delete(key);
          }
        for (const t of f.tiles) held.add(`${f.level}/${t.x}/${t.y}`);
        expect(new Set([...store.tiles()].map((t) => `${t.level}/${t.x}/${t.y}`))).toEqual(held);
      }
    }
  });
});

describe("moving along with the parents (T17)", () => {
  test("a changed parent moves its descendants by the codec's prediction of its change", () => {
    const store = filled(bump);
    const before = store.tile(1, 0, 0)!;
    const root = store.tile(0, 0, 0)!;
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 2, (x, y) => 2 * bump(x, y))]));
    const after = store.tile(1, 0, 0)!;
    expect(after.exact).toBe(false);
    expect(after.version).toBe(1);
    const change = store.tile(0, 0, 0)!.heights.map((h, i) => h - root.heights[i]!);
    const moved = new Float32Array(65 * 65);
    predictMetres(change, 0, 0, moved);
    expect(after.heights).toEqual(before.heights.map((h, i) => h + moved[i]!));
    expect(Math.max(...after.subMax)).toBe(Math.max(...after.heights));
    expect(Math.min(...after.subMin)).toBe(Math.min(...after.heights));
    // The grandchildren follow too: the top of the bump is nearly twice as high on the finest level held.
    expect(store.ground.heightAt(300, 200)).toBeCloseTo(80, 0);
    expect(seams(store)).toEqual([]);
  });

  test("the level's own frame ends the preview, also when it carries nothing", () => {
    const store = filled(bump);
    const own = samplesOf(store, 1).map((t) => t.heights);
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 2, (x, y) => bump(x, y) + 5)]));
    expect(samplesOf(store, 1).every((t) => !t.exact)).toBe(true);
    store.apply(frame("LEVEL", 1, []));
    expect(samplesOf(store, 1).every((t) => t.exact)).toBe(true);
    expect(samplesOf(store, 1).map((t) => t.heights)).toEqual(own);
    // Level 2 was moved by level 0 and is moved back: its parent shows again what it showed when level 2 was exact.
    expect(samplesOf(store, 2).every((t) => t.exact)).toBe(true);
  });

  test("many previews leave no drift", () => {
    const store = filled(bump);
    const own = samplesOf(store, 2).map((t) => t.heights.slice());
    for (let i = 1; i <= 25; i++) {
      store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, i + 1, (x, y) => bump(x, y) + 7.3 * Math.sin(i + x / 90))]));
    }
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 99, bump)]));
    expect(samplesOf(store, 2).map((t) => t.heights)).toEqual(own);
    expect(samplesOf(store, 2).every((t) => t.exact)).toBe(true);
  });

  test("tiles that the change does not reach keep their object and stamp (T18)", () => {
    const store = filled(flat);
    const far = store.tile(2, 3, 3)!;
    const sibling = store.tile(1, 1, 1)!;
    const near = store.tile(2, 0, 0)!;
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 2, (x, y) => (x < 200 && y < 200 ? 10 : 0))]));
    expect(store.tile(2, 3, 3)).toBe(far);
    expect(store.tile(1, 1, 1)).toBe(sibling);
    expect(store.tile(2, 0, 0)!.stamp).toBe(store.stamp);
    expect(near.heights.every((h) => h === 0)).toBe(true);
  });

  test("the error of a moved tile is its distance to what its parent draws now", () => {
    const store = filled(bump);
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 2, (x, y) => -bump(x, y))]));
    for (const t of samplesOf(store, 1)) {
      const parent = store.tile(0, 0, 0)!;
      const p = (r: number, c: number) => parent.heights[(32 * t.y + r) * 65 + 32 * t.x + c]!;
      let worst = 0;
      for (let r = 0; r < 65; r++)
        for (let c = 0; c < 65; c++) {
          const [r0, r1, c0, c1] = [r >> 1, (r + 1) >> 1, c >> 1, (c + 1) >> 1];
          worst = Math.max(
            worst,
            Math.abs(t.heights[r * 65 + c]! - (p(r0, c0) + p(r0, c1) + p(r1, c0) + p(r1, c1)) / 4),
          );
        }
      expect(Math.max(...t.subError)).toBeCloseTo(worst, 5);
    }
  });
});

test("a flat tile that is sent again over another parent has that one's error", () => {
  const store = filled(flat);
  const again = { ...tileOf(1, 1, 1, 2, flat), subError: new Uint32Array(16).fill(512) };
  store.apply(frame("LEVEL", 1, [again]));
  expect(store.tile(1, 1, 1)!.subError[3]).toBeCloseTo((512 * SIZE_M) / 128 / 256, 5);
});

describe("frames are shown whole (T16)", () => {
  test("a subscriber never sees a seam and is told once a frame", () => {
    const store = filled(flat);
    const seen: number[] = [];
    const stop = effect(() => {
      seen.push(store.revision.value);
      expect(seams(store)).toEqual([]);
    });
    for (let i = 2; i < 6; i++) {
      for (let level = 0; level <= 2; level++) {
        store.apply(
          frame(
            "LEVEL",
            level,
            all(level, i, (x, y) => i * bump(x, y)),
          ),
        );
      }
    }
    stop();
    expect(seen.length).toBe(13);
    expect(seen).toEqual([...seen].sort((a, b) => a - b));
  });

  test("a frozen ground and a tile taken before stay as they were", () => {
    const store = filled(flat);
    const frozen = store.freeze();
    const tile = store.tile(2, 1, 1)!;
    store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 2, () => 30)]));
    expect(frozen.heightAt(300, 300)).toBe(0);
    expect(tile.heights[0]).toBe(0);
    expect(store.ground.heightAt(300, 300)).toBeCloseTo(30, 1);
    expect(store.freeze()).not.toBe(frozen);
    expect(store.freeze()).toBe(store.freeze());
  });

  test("a dropped tile takes its descendants along; clear forgets all", () => {
    const store = filled(bump);
    store.apply(frame("LEVEL", 1, [], [{ x: 0, y: 0 }]));
    expect(store.tile(1, 0, 0)).toBeUndefined();
    expect(store.tile(2, 1, 1)).toBeUndefined();
    expect(store.tile(2, 2, 0)).toBeDefined();
    expect(store.size).toBe(21 - 5);
    const stamp = store.stamp;
    store.clear();
    expect(store.size).toBe(0);
    expect(store.stamp).toBeGreaterThan(stamp);
    expect(store.ground.heightAt(10, 10)).toBe(0);
  });

  test("FILL adds tiles and confirms nothing", () => {
    const store = filled(bump);
    store.apply(frame("LEVEL", 1, [tileOf(1, 0, 0, 2, (x, y) => bump(x, y) + 3)]));
    expect(store.tile(2, 0, 0)!.exact).toBe(false);
    store.apply({ ...frame("FILL", 2, []), kind: FrameKind.FILL });
    expect(store.tile(2, 0, 0)!.exact).toBe(false);
    store.apply(frame("FILL", 3, [tileOf(3, 7, 7, 1, bump)]));
    expect(store.tile(3, 7, 7)!.exact).toBe(true);
  });
});

describe("settled (T16)", () => {
  const level = (at: number, settled: boolean) => ({ ...frame("LEVEL", at, all(at, 1, flat)), settled });

  test("while the last frame of some level was a preview, the ground is not", () => {
    const store = new TileStore(SIZE_M, LEVELS, 2);
    for (let at = 0; at <= 2; at++) store.apply(level(at, true));
    expect(store.settled).toBe(true);
    store.apply(level(1, false));
    expect(store.settled).toBe(false);
    store.apply(level(2, true));
    expect(store.settled).toBe(false);
    store.apply(level(1, true));
    expect(store.settled).toBe(true);
  });

  test("a level of which all was dropped is as final as the tiles that fill it again", () => {
    const store = new TileStore(SIZE_M, LEVELS, 2);
    for (let at = 0; at <= 2; at++) store.apply(level(at, true));
    const tiles = all(2, 1, flat);
    store.apply({ ...frame("LEVEL", 2, [], tiles), settled: false });
    expect(store.settled).toBe(true);
    store.apply({ ...frame("FILL", 2, tiles), settled: true });
    expect(store.settled).toBe(true);
    store.apply({ ...frame("LEVEL", 2, [], tiles), settled: true });
    store.apply({ ...frame("FILL", 2, tiles), settled: false });
    expect(store.settled).toBe(false);
  });

  test("refined levels and levels that were never sent do not count; a new connection begins anew", () => {
    const store = new TileStore(SIZE_M, LEVELS, 2);
    expect(store.settled).toBe(true);
    store.apply(level(0, false));
    store.apply(level(3, false));
    store.clear();
    expect(store.settled).toBe(true);
    store.apply(level(3, false));
    expect(store.settled).toBe(true);
  });
});
