/** Levels that are held only where somebody looks (SPEC R20 to R22): restriction, weights, memory, entrances. */

import { describe, expect, it } from "vitest";
import type { CameraState, Vec3 } from "../../src/core/types.ts";
import { PatchTree } from "../../src/tiles/patches/patchtree.ts";
import { recordColumn, recordLevel, recordRow } from "../../src/tiles/patches/records.ts";
import { type Cut, Selection } from "../../src/tiles/patches/selection.ts";
import { craggyField, lookAt, random, SparseView } from "../gpu/world.ts";

const SIZE = 65536;
const LEVELS = 10;
const slots = { slot: (level: number, x: number, y: number) => (level * 7 + x * 3 + y) & 0xfff, touch() {} };

interface Leaf {
  readonly level: number;
  readonly px: number;
  readonly py: number;
  readonly corners: readonly number[];
}

function leaves(cut: Cut): Leaf[] {
  return Array.from({ length: cut.count }, (_, i) => {
    const d = cut.records[4 * i + 3]!;
    return {
      level: recordLevel(cut.records, i),
      px: recordColumn(cut.records, i) / 16,
      py: recordRow(cut.records, i) / 16,
      corners: [0, 8, 16, 24].map((shift) => (d >>> shift) & 255),
    };
  });
}

/** A view down on a place of a terrain whose fine levels are held around it. */
function place(seed: number, holes = 0.2): { view: SparseView; camera: CameraState; at: Vec3 } {
  const next = random(seed);
  const at: Vec3 = [next() * SIZE, next() * SIZE, 0];
  const view = new SparseView(SIZE, LEVELS, 3, craggyField(seed, SIZE));
  view.refineAround(at[0], at[1], (level) => (next() < holes ? 0 : level > 7 ? 1 : 2));
  const eye: Vec3 = [at[0] + 12, at[1] - 25, view.heightAt(at[0], at[1]) + 14];
  return { view, camera: lookAt(eye, [at[0], at[1], eye[2] - 14], 800, 600, 60, 0.1, 400_000), at };
}

function ready(view: SparseView, fade = false): Selection {
  const selection = new Selection(view.levels);
  for (const { level, x, y } of view.tiles()) selection.tree.setUsable(level, x, y, true, fade && level > view.solved);
  return selection;
}

/** Points of the finest lattice at the corners of the drawn patches, with the patches that meet there. */
function meetings(cut: readonly Leaf[]): Map<string, { leaf: Leaf; weight: number }[]> {
  const found = new Map<string, { leaf: Leaf; weight: number }[]>();
  for (const leaf of cut) {
    const w = 1 << (LEVELS - leaf.level);
    for (let corner = 0; corner < 4; corner += 1) {
      const key = `${(leaf.px + (corner & 1)) * w} ${(leaf.py + (corner >> 1)) * w}`;
      found.set(key, [...(found.get(key) ?? []), { leaf, weight: leaf.corners[corner]! }]);
    }
  }
  return found;
}

function checkMeetings(cut: readonly Leaf[]): number {
  let mixed = 0;
  for (const met of meetings(cut).values()) {
    const finest = Math.max(...met.map((m) => m.leaf.level));
    const coarsest = Math.min(...met.map((m) => m.leaf.level));
    expect(finest - coarsest).toBeLessThanOrEqual(1);
    for (const level of new Set(met.map((m) => m.leaf.level))) {
      const weights = new Set(met.filter((m) => m.leaf.level === level).map((m) => m.weight));
      expect(weights.size).toBe(1);
      if (coarsest < finest) {
        mixed += 1;
        expect([...weights]).toEqual([level === finest ? 255 : 0]);
      }
    }
  }
  return mixed;
}

describe("sparse levels", () => {
  it("R20: patches of level 10 are drawn where tiles are held, and weights agree wherever patches meet", () => {
    let deepest = 0;
    let mixed = 0;
    for (let seed = 1; seed <= 12; seed += 1) {
      const { view, camera } = place(seed);
      const selection = ready(view);
      for (const tau of [0.3, 1.5]) {
        const cut = leaves(selection.select(view, camera, tau, slots));
        for (const { level, px, py } of cut) expect(view.tile(level, px >> 2, py >> 2)).toBeDefined();
        mixed += checkMeetings(cut);
        deepest = Math.max(deepest, ...cut.map((leaf) => leaf.level));
      }
    }
    expect(deepest).toBe(LEVELS);
    expect(mixed).toBeGreaterThan(200);
  });

  it("R21: pages follow what is held; those of dropped tiles serve again", () => {
    const tree = new PatchTree(LEVELS);
    const view = new SparseView(SIZE, LEVELS, 3, () => 0);
    view.refineAround(SIZE / 3, SIZE / 5, () => 2);
    tree.sync(view);
    const held = [...view.tiles()].length;
    expect(tree.pages).toBe(held);
    const { capacity } = tree;
    for (let round = 0; round < 8; round += 1) {
      view.forgetRefined();
      tree.sync(view);
      expect(tree.pages).toBe(85);
      view.refineAround(SIZE * (0.1 + 0.1 * round), SIZE * 0.5, () => 2);
      tree.sync(view);
    }
    expect(tree.pages).toBe([...view.tiles()].length);
    expect(tree.capacity).toBe(capacity);
  });

  it("R21: usable tiles keep their page until the atlas lets go", () => {
    const tree = new PatchTree(4);
    tree.setUsable(4, 3, 5, true);
    tree.sync({ sizeM: SIZE, levels: 4, solved: 4, stamp: 1, tile: () => undefined, tiles: () => [] });
    expect(tree.pages).toBe(5);
    tree.setUsable(4, 3, 5, false);
    tree.sync({ sizeM: SIZE, levels: 4, solved: 4, stamp: 2, tile: () => undefined, tiles: () => [] });
    expect(tree.pages).toBe(1);
  });

  it("R22: a tile enters as its parent's surface and is not split before it has; weights agree at every moment", () => {
    const { view, camera } = place(3, 0);
    const selection = ready(view, true);
    const solved = leaves(selection.select(view, camera, 0.3, slots));
    // The first refined level enters, none below it yet, and each of its patches shows its parent.
    const entering = solved.filter((leaf) => leaf.level > view.solved);
    expect(entering.length).toBeGreaterThan(0);
    expect(Math.max(...solved.map((leaf) => leaf.level))).toBe(view.solved + 1);
    expect(entering.every((leaf) => leaf.corners.every((c) => c === 255))).toBe(true);
    let last = 255;
    for (const share of [0.3, 0.3, 0.3]) {
      expect(selection.tree.advance(share)).toBe(true);
      const cut = leaves(selection.select(view, camera, 0.3, slots));
      checkMeetings(cut);
      const least = Math.min(...cut.filter((leaf) => leaf.level > view.solved).flatMap((leaf) => leaf.corners));
      expect(least).toBeLessThanOrEqual(last);
      last = least;
    }
    expect(selection.tree.advance(0.3)).toBe(false);
    const done = leaves(selection.select(view, camera, 0.3, slots));
    expect(done).toEqual(leaves(ready(view).select(view, camera, 0.3, slots)));
    expect(Math.max(...done.map((leaf) => leaf.level))).toBe(LEVELS);
  });
});
