/** Patches hidden by the ground in front of them (SPEC R47). */

import { beforeAll, describe, expect, it } from "vitest";
import type { CameraState, Vec3 } from "../../src/core/types.ts";
import { Surfaces } from "../../src/tiles/lakes/lakes.ts";
import { frontToBack, Horizon } from "../../src/tiles/patches/occlusion.ts";
import { RECORD_WORDS } from "../../src/tiles/patches/records.ts";
import { type Cut, Selection } from "../../src/tiles/patches/selection.ts";
import { type DrawnPatch, drawnPatch, rasterise, samplesOf } from "../gpu/drawn.ts";
import { FieldView, filteredField, lookAt, mapCamera, random } from "../gpu/world.ts";

const SIZE = 4096;
const LEVELS = 4;
const WIDTH = 1024;
const HEIGHT = 768;
/** Views, from three places, with and without a sea, of two grounds: each combination once. */
const ROUNDS = 12;

const slots = { slot: (): number => 0, touch: (): void => {} };

function ready(view: FieldView): Selection {
  const selection = new Selection(view.levels);
  for (const tile of view.tiles()) selection.tree.setUsable(tile.level, tile.x, tile.y, true);
  return selection;
}

/** Names of the drawn patches and the patches themselves. */
function drawn(view: FieldView, cut: Cut): Map<string, DrawnPatch> {
  const height = samplesOf(view);
  const out = new Map<string, DrawnPatch>();
  for (let i = 0; i < cut.count; i += 1)
    out.set(cut.records.slice(i * RECORD_WORDS, i * RECORD_WORDS + 2).join(), drawnPatch(cut, i, view.sizeM, height));
  return out;
}

function heightAt(view: FieldView, x: number, y: number): number {
  const n = 64 << LEVELS;
  return samplesOf(view)(LEVELS, Math.round((x / SIZE) * n), Math.round((y / SIZE) * n));
}

type Place = "ground" | "air" | "outside";

/** A view from near the ground, from the air or from outside of the domain. */
function camera(place: Place, next: () => number, view: FieldView): CameraState {
  const angle = next() * 2 * Math.PI;
  const along: Vec3 = [Math.cos(angle), Math.sin(angle), 0];
  if (place === "outside") {
    const eye: Vec3 = [2048 - 3600 * along[0], 2048 - 3600 * along[1], 300 + 900 * next()];
    return lookAt(eye, [2048, 2048, 0], WIDTH, HEIGHT, 45);
  }
  const x = SIZE * (0.1 + 0.8 * next());
  const y = SIZE * (0.1 + 0.8 * next());
  const up = place === "ground" ? 40 + 40 * next() : 300 + 500 * next();
  const eye: Vec3 = [x, y, heightAt(view, x, y) + up];
  const down = place === "ground" ? 0.2 * (next() - 0.5) : 0.3 + 0.4 * next();
  return lookAt(eye, [x + along[0], y + along[1], eye[2] - down], WIDTH, HEIGHT, 50);
}

describe("the horizon", () => {
  const eye = lookAt([0, 0, 0], [1, 0, 0], 400, 300, 60);
  const begun = (): Horizon => {
    const horizon = new Horizon();
    horizon.begin(eye, true);
    return horizon;
  };

  it("R47: hides what lies below and behind ground, not what stands out over it or beside it", () => {
    const horizon = begun();
    expect(horizon.hides(300, -20, 40, 5)).toBe(false);
    horizon.add(100, -50, 100, 10);
    expect(horizon.hides(300, -20, 40, 14)).toBe(true);
    expect(horizon.hides(300, -20, 40, 16)).toBe(false);
    expect(horizon.hides(300, 190, 40, 5)).toBe(false);
    // Below the eye: a low sill hides what lies deeper behind it.
    const low = begun();
    low.add(100, -50, 100, -10);
    expect(low.hides(300, -20, 40, -35)).toBe(true);
    expect(low.hides(300, -20, 40, -33)).toBe(false);
  });

  it("R47: two patches that meet inside of a column hide it together, a gap between them does not", () => {
    // They meet along a ray that is not the border of a column; the gap is much narrower than a column.
    const aside = lookAt([0, 0, 0], [1, 0.0004, 0], 400, 300, 60);
    const wall = (gap: number): Horizon => {
      const horizon = new Horizon();
      horizon.begin(aside, true);
      for (let y = -60; y < 60; y += 20) horizon.add(100, y + (y >= 0 ? gap : 0), 20, 10);
      return horizon;
    };
    expect(wall(0).hides(200, -30, 60, 5)).toBe(true);
    expect(wall(0.01).hides(200, -30, 60, 5)).toBe(false);
  });

  it("R47: nothing is hidden from below the ground, in maps, straight down, and beside or behind the eye", () => {
    for (const [state, above] of [
      [eye, false],
      [mapCamera([0, 0, 0], 300, 400, 300), true],
      [lookAt([0, 0, 500], [1, 0, 0], 400, 300, 60), true],
    ] as const) {
      const horizon = new Horizon();
      horizon.begin(state, above);
      horizon.add(100, -50, 20, 10);
      expect(horizon.hides(200, -20, 40, -100)).toBe(false);
    }
    const horizon = begun();
    horizon.add(-10, -50, 100, 10);
    expect(horizon.hides(200, -20, 40, -100)).toBe(false);
    expect(horizon.hides(-300, -20, 40, -100)).toBe(false);
  });

  it("R47: cells come before those that they can hide", () => {
    const order = frontToBack(4, 400, 130, 90);
    expect(new Set(order).size).toBe(16);
    expect(order[0]).toBe(1);
    // Rays step from cell to cell; each must come later than the one before.
    let wrong = 0;
    for (let k = 0; k < 360; k += 1) {
      let last = -1;
      for (let r = 0; r < 500; r += 1) {
        const x = 130 + r * Math.cos(k);
        const y = 90 + r * Math.sin(k);
        if (x < 0 || y < 0 || x >= 400 || y >= 400) break;
        const at = order.indexOf(Math.floor(y / 100) * 4 + Math.floor(x / 100));
        if (at < last) wrong += 1;
        last = at;
      }
    }
    expect(wrong).toBe(0);
  });
});

describe("hidden patches", () => {
  let views: FieldView[];
  beforeAll(() => {
    views = [5, 8].map((seed) => new FieldView(SIZE, LEVELS, filteredField(seed, 700)));
  });

  it("R47: none of them would show in a pixel, over random views from the ground, the air and outside", () => {
    const next = random(31);
    let ground = 0;
    const saved: Record<Place, [number, number]> = { ground: [0, 0], air: [0, 0], outside: [0, 0] };
    for (let round = 0; round < ROUNDS; round += 1) {
      const view = views[round % 2]!;
      const place = (["ground", "air", "outside"] as const)[round % 3]!;
      const state = camera(place, next, view);
      const sea = round % 4 === 0 ? 0 : Number.NEGATIVE_INFINITY;
      const tau = place === "outside" ? 6 : 2;
      const selection = ready(view);
      const kept = new Set(drawn(view, selection.select(view, state, tau, slots, 1, new Surfaces(null, sea))).keys());
      selection.occlusion = false;
      const all = drawn(view, selection.select(view, state, tau, slots, 1, new Surfaces(null, sea)));
      expect([...kept].filter((name) => !all.has(name))).toEqual([]);
      const names = [...all.keys()];
      const front = rasterise([...all.values()], state, { width: 256, height: 192, base: -500 });
      const seen = (index: number): boolean => index >= 0 && !kept.has(names[index]!);
      expect(front.filter(seen).length).toBe(0);
      ground += front.filter((index) => index >= 0).length;
      saved[place][0] += all.size;
      saved[place][1] += kept.size;
    }
    expect(ground).toBeGreaterThan(0.8 * ROUNDS * 256 * 192 * 0.4);
    const share = (place: Place): number => 1 - saved[place][1] / saved[place][0];
    expect(share("ground")).toBeGreaterThan(0.25);
  });
});
