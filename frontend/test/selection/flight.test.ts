/** A flight of 300 frames: what is drawn never jumps (SPEC R48). */

import { describe, expect, it } from "vitest";
import type { CameraState, TileView, Vec3 } from "../../src/core/types.ts";
import { recordColumn, recordLevel, recordRow } from "../../src/tiles/patches/records.ts";
import { type Cut, Selection } from "../../src/tiles/patches/selection.ts";
import { samplesOf, shownVertex } from "../gpu/drawn.ts";
import { craggyField, lookAt, random, SparseView } from "../gpu/world.ts";

const SIZE = 4096;
const LEVELS = 6;
const SOLVED = 3;
const FRAMES = 300;
const TAU = 1.5;
const HEIGHT = 600;
/** Vertices of this level are even vertices of all patches of finer levels: never snapped, so what is drawn there is plain. */
const LATTICE = 1;
const SIDE = 64 << LATTICE;

const slots = { slot: (): number => 0, touch: (): void => {} };

/** Where every lattice point is drawn: height and level by point, from one cut. */
function surface(view: TileView, cut: Cut, points: readonly number[]): Map<number, { z: number; level: number }> {
  const height = samplesOf(view);
  const patches = new Map<string, number>();
  for (let i = 0; i < cut.count; i += 1) {
    const { records } = cut;
    patches.set([recordLevel(records, i), recordColumn(records, i) >> 4, recordRow(records, i) >> 4].join("/"), i);
  }
  const out = new Map<number, { z: number; level: number }>();
  for (const point of points) {
    for (let level = LEVELS; level > LATTICE; level -= 1) {
      const [column, row] = [(point % SIDE) << (level - LATTICE), Math.floor(point / SIDE) << (level - LATTICE)];
      const patch = patches.get([level, column >> 4, row >> 4].join("/"));
      if (patch === undefined) continue;
      out.set(point, { z: shownVertex(cut, patch, column & 15, row & 15, height), level });
      break;
    }
  }
  return out;
}

/** Low over the hills, round a bend and up at the end. */
function pose(frame: number, ground: (x: number, y: number) => number): CameraState {
  const angle = frame / 110;
  const x = 2048 + 1100 * Math.cos(angle);
  const y = 2048 + 1100 * Math.sin(angle);
  const eye: Vec3 = [x, y, ground(x, y) + 60 + 2 * Math.max(0, frame - 200)];
  const target: Vec3 = [eye[0] - 300 * Math.sin(angle), eye[1] + 300 * Math.cos(angle), eye[2] - 90];
  return lookAt(eye, target, 800, HEIGHT, 45);
}

describe("a flight", () => {
  it("R48: between frames nothing jumps by more than the error bound, while tiles come and go and levels change", () => {
    const field = craggyField(3, SIZE);
    const view = new SparseView(SIZE, LEVELS, SOLVED, field);
    const selection = new Selection(LEVELS);
    const next = random(2);
    const points = Array.from({ length: 600 }, () => Math.floor(next() * SIDE) * SIDE + Math.floor(next() * SIDE));
    const inUse = new Set<string>();
    const hold = (fade: boolean): void => {
      for (const { level, x, y } of view.tiles()) {
        const name = `${level}/${x}/${y}`;
        if (!inUse.has(name)) selection.tree.setUsable(level, x, y, true, fade && level > SOLVED);
        inUse.add(name);
      }
    };
    hold(false);
    const perRadian = HEIGHT / 2 / Math.tan(Math.PI / 8);
    let last = new Map<number, { z: number; level: number }>();
    const worst = { jump: 0, compared: 0, changes: 0, refined: 0 };
    for (let frame = 0; frame < FRAMES; frame += 1) {
      const camera = pose(frame, (x, y) => field(x, y, SOLVED));
      if (frame % 75 === 5) {
        // What a server sends: finer tiles round the place ahead.
        view.refineAround(camera.target[0], camera.target[1], (level) => (level === SOLVED + 1 ? 2 : 3));
        hold(true);
      }
      selection.tree.advance(16 / 350);
      const now = surface(view, selection.select(view, camera, TAU, slots), points);
      for (const [point, { z, level }] of now) {
        const before = last.get(point);
        if (before === undefined) continue;
        const [x, y] = [((point % SIDE) / SIDE) * SIZE, (Math.floor(point / SIDE) / SIDE) * SIZE];
        const away = Math.hypot(x - camera.eye[0], y - camera.eye[1], z - camera.eye[2]);
        worst.jump = Math.max(worst.jump, (Math.abs(z - before.z) * perRadian) / away);
        worst.compared += 1;
        if (before.level !== level) worst.changes += 1;
        if (level > SOLVED) worst.refined += 1;
      }
      last = now;
    }
    expect(worst.compared).toBeGreaterThan(15_000);
    expect(worst.changes).toBeGreaterThan(120);
    expect(worst.refined).toBeGreaterThan(1500);
    expect(worst.jump).toBeGreaterThan(0.05);
    expect(worst.jump).toBeLessThan(TAU / 3);
  });
});
