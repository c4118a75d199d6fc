/** Levels that are held only where somebody looks (SPEC R20 to R22): restriction, weights, memory, entrances. */

import { describe, expect, it } from "vitest";
import type { CameraState, Vec3 } from "../../src/core/types.ts";
import { TILE_CELLS } from "../../src/generated/contract.ts";
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

/** What meets at a point of the finest lattice: levels, and the least and greatest weight on the finest and the coarsest. */
interface Meeting {
  finest: number;
  coarsest: number;
  readonly fine: [number, number];
  readonly coarse: [number, number];
}

/** Points of the finest lattice at the corners of the drawn patches, with what meets there. */
function meetings(cut: readonly Leaf[]): Map<number, Meeting> {
  const found = new Map<number, Meeting>();
  const side = (TILE_CELLS << LEVELS) + 1;
  for (const { level, px, py, corners } of cut) {
    const w = 1 << (LEVELS - level);
    for (let corner = 0; corner < 4; corner += 1) {
      const key = (py + (corner >> 1)) * w * side + (px + (corner & 1)) * w;
      const weight = corners[corner]!;
      const met = found.get(key);
      if (met === undefined) {
        found.set(key, { finest: level, coarsest: level, fine: [weight, weight], coarse: [weight, weight] });
        continue;
      }
      note(met.fine, weight, level - met.finest);
      note(met.coarse, weight, met.coarsest - level);
      met.finest = Math.max(met.finest, level);
      met.coarsest = Math.min(met.coarsest, level);
    }
  }
  return found;
}

/** Takes a weight in where its level counts (`beyond` is 0), and begins with it where its level counts more. */
function note(range: [number, number], weight: number, beyond: number): void {
  if (beyond < 0) return;
  range[0] = beyond > 0 ? weight : Math.min(range[0], weight);
  range[1] = beyond > 0 ? weight : Math.max(range[1], weight);
}

/** At how many points levels meet. Throws where they lie more than one apart, or where weights do not agree. */
function checkMeetings(cut: readonly Leaf[]): number {
  let mixed = 0;
  for (const met of meetings(cut).values()) {
    const { finest, coarsest, fine, coarse } = met;
    const apart = finest - coarsest;
    const agree = apart === 0 ? fine[0] === fine[1] : fine[0] === 255 && coarse[1] === 0 && fine[1] === 255;
    if (apart > 1 || !agree) throw new Error(`patches do not agree: ${JSON.stringify(met)}`);
    mixed += 2 * apart;
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
        expect(cut.filter(({ level, px, py }) => view.tile(level, px >> 2, py >> 2) === undefined)).toEqual([]);
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
