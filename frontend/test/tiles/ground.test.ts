/** SPEC T19: heights and picking against brute force. */

import fc from "fast-check";
import { describe, expect, test } from "vitest";
import type { Ground, Ray, Vec3 } from "../../src/core/types.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { frame, tileOf } from "./frames.ts";

const SIZE = 1024;
const hills = (x: number, y: number) =>
  60 * Math.sin(x / 83) * Math.cos(y / 71) + 9 * Math.sin(x / 11) + 25 * Math.exp(-((x - 600) ** 2) / 900);

/** Levels 0 and 1 everywhere, levels 2 and 3 in one corner: neighbours of different levels meet. */
function mixed(height = hills): TileStore {
  const store = new TileStore(SIZE, 3);
  store.apply(frame("LEVEL", 0, [tileOf(0, 0, 0, 1, height, SIZE)]));
  const one = [0, 1, 2, 3].map((i) => tileOf(1, i & 1, i >> 1, 1, height, SIZE));
  store.apply(frame("LEVEL", 1, one));
  store.apply(
    frame(
      "FILL",
      2,
      [0, 1, 2].map((x) => tileOf(2, x, 1, 1, height, SIZE)),
    ),
  );
  store.apply(
    frame(
      "FILL",
      3,
      [2, 3].map((x) => tileOf(3, x, 2, 1, height, SIZE)),
    ),
  );
  return store;
}

const store = mixed();
const ground = store.freeze();

/** First crossing found by tiny steps, refined by bisection: plain and slow. */
function bruteForce(g: Ground, ray: Ray, length: number): Vec3 | null {
  const at = (t: number): Vec3 => [
    ray.origin[0] + t * ray.dir[0],
    ray.origin[1] + t * ray.dir[1],
    ray.origin[2] + t * ray.dir[2],
  ];
  const inside = ([x, y]: Vec3) => x >= 0 && y >= 0 && x <= g.sizeM && y <= g.sizeM;
  const above = (p: Vec3) => p[2] - g.heightAt(p[0], p[1]);
  const step = 0.05 / Math.hypot(...ray.dir);
  let last: number | null = null;
  for (let t = 0; t < length; t += step) {
    const p = at(t);
    if (!inside(p)) {
      if (last !== null) return null;
      continue;
    }
    if (above(p) < 0) {
      if (last === null) return null;
      let [low, high] = [last, t];
      for (let i = 0; i < 60; i++) {
        const mid = (low + high) / 2;
        if (above(at(mid)) < 0) high = mid;
        else low = mid;
      }
      return at(high);
    }
    last = t;
  }
  return null;
}

describe("heightAt", () => {
  test("is the sample at samples and bilinear between them, in the finest tile that covers the point", () => {
    const t = store.tile(3, 2, 2)!;
    const spacing = SIZE / 512;
    const [x, y] = [(128 + 10) * spacing, (128 + 20) * spacing];
    const h = (r: number, c: number) => t.heights[r * 65 + c]!;
    expect(ground.heightAt(x, y)).toBe(h(20, 10));
    expect(ground.heightAt(x + spacing / 2, y)).toBeCloseTo((h(20, 10) + h(20, 11)) / 2, 4);
    expect(ground.heightAt(x + spacing / 4, y + spacing / 2)).toBeCloseTo(
      (3 * (h(20, 10) + h(21, 10)) + h(20, 11) + h(21, 11)) / 8,
      4,
    );
    const coarse = store.tile(1, 1, 1)!;
    expect(ground.heightAt(SIZE / 2, SIZE / 2)).toBe(coarse.heights[0]);
  });

  test("is clamped outside the domain", () => {
    expect(ground.heightAt(-50, 300)).toBe(ground.heightAt(0, 300));
    expect(ground.heightAt(2000, 5000)).toBe(ground.heightAt(SIZE, SIZE));
    expect(ground.heightAt(SIZE, SIZE)).toBe(store.tile(1, 1, 1)!.heights[65 * 65 - 1]);
  });

  test("is 0 while nothing is held", () => {
    expect(new TileStore(SIZE, 3).ground.heightAt(3, 4)).toBe(0);
  });
});

describe("raycast", () => {
  const point = fc.record({ x: fc.integer({ min: -200, max: 1224 }), y: fc.integer({ min: -200, max: 1224 }) });

  test("agrees with brute force on rays from above, near and far, in and out of the domain", () => {
    fc.assert(
      fc.property(point, fc.integer({ min: 90, max: 500 }), point, fc.integer({ min: -100, max: 90 }), (a, z, b, w) => {
        fc.pre(a.x !== b.x || a.y !== b.y);
        const ray: Ray = { origin: [a.x, a.y, z], dir: [(b.x - a.x) / 100, (b.y - a.y) / 100, (w - z) / 100] };
        const slow = bruteForce(ground, ray, 400);
        const fast = ground.raycast(ray);
        if (slow === null) {
          // A graze shorter than the brute-force step may be missed by it, never the other way round.
          if (fast !== null) expect(Math.abs(fast[2] - ground.heightAt(fast[0], fast[1]))).toBeLessThan(1e-3);
          return;
        }
        expect(fast).not.toBeNull();
        const distance = Math.hypot(slow[0] - a.x, slow[1] - a.y, slow[2] - z);
        const reached = Math.hypot(fast![0] - a.x, fast![1] - a.y, fast![2] - z);
        expect(reached).toBeLessThanOrEqual(distance + 1e-3);
        if (reached < distance - 0.2) expect(grazes(ground, fast!)).toBe(true);
        else expect(Math.abs(reached - distance)).toBeLessThan(0.06);
      }),
      { numRuns: 150, seed: 7 },
    );
  });

  test("hits are on the surface to 1e-6 of the distance where tiles of one level meet the ray", () => {
    const eye: Vec3 = [900, 900, 300];
    let hits = 0;
    for (let i = 0; i < 400; i++) {
      const dir: Vec3 = [-1 + i / 500, -0.4 - (i % 7) / 9, -0.45];
      const p = ground.raycast({ origin: eye, dir });
      if (!p) continue;
      hits++;
      const distance = Math.hypot(p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]);
      const off = Math.abs(p[2] - ground.heightAt(p[0], p[1]));
      if (off > 1e-6 * distance) expect(grazes(ground, p)).toBe(true);
    }
    expect(hits).toBeGreaterThan(300);
  });

  test("plumb and axis-parallel rays", () => {
    expect(ground.raycast({ origin: [100, 200, 900], dir: [0, 0, -2] })).toEqual([
      100,
      200,
      expect.closeTo(ground.heightAt(100, 200), 6),
    ]);
    expect(ground.raycast({ origin: [SIZE, SIZE, 900], dir: [0, 0, -1] })![2]).toBeCloseTo(
      ground.heightAt(SIZE, SIZE),
      6,
    );
    expect(ground.raycast({ origin: [0, 0, 900], dir: [0, 0, 1] })).toBeNull();
    const level = ground.raycast({ origin: [10, 512, 20], dir: [1, 0, 0] })!;
    expect(level[2]).toBe(20);
    expect(ground.heightAt(level[0] + 0.01, 512)).toBeGreaterThan(20);
    expect(ground.heightAt(level[0] - 0.01, 512)).toBeLessThan(20.01);
  });

  test("misses are null: the sky, beside the domain, through its side, and an empty store", () => {
    expect(ground.raycast({ origin: [500, 500, 200], dir: [1, 1, 0.2] })).toBeNull();
    expect(ground.raycast({ origin: [-500, -500, 200], dir: [-1, 0.5, -0.1] })).toBeNull();
    expect(ground.raycast({ origin: [-300, 500, -500], dir: [1, 0, 0.9] })).toBeNull();
    expect(new TileStore(SIZE, 3).ground.raycast({ origin: [5, 5, 100], dir: [0, 0, -1] })).toBeNull();
  });

  test("an eye below the ground looks out through it", () => {
    const x = 600;
    const y = 300;
    const under = ground.heightAt(x, y) - 4;
    const p = ground.raycast({ origin: [x, y, under], dir: [0.01, 0, 1] })!;
    expect(p[2]).toBeCloseTo(ground.heightAt(p[0], p[1]), 4);
  });

  test("a step between two levels is hit where it stands", () => {
    const g = new TileStore(SIZE, 1);
    const flat = (level: number, x: number, y: number, z: number) => tileOf(level, x, y, 1, () => z, SIZE);
    g.apply(frame("LEVEL", 0, [flat(0, 0, 0, 0)]));
    g.apply(frame("FILL", 1, [flat(1, 1, 0, 50), flat(1, 1, 1, 50)]));
    for (const dir of [
      [1, 0, 0],
      [0.31, 0.07, 0.001],
    ] as const) {
      const p = g.ground.raycast({ origin: [100, 200, 25], dir })!;
      expect(p[0]).toBeCloseTo(SIZE / 2, 9);
    }
    expect(g.ground.raycast({ origin: [100, 200, 55], dir: [1, 0, 0] })).toBeNull();
  });

  test("a spike thinner than a sub-patch is hit from any side", () => {
    const spike = (sx: number, sy: number) => (Math.hypot(sx - 400, sy - 400) < 9 ? 80 : 0);
    const g = mixed(spike).freeze();
    for (let i = 0; i < 32; i++) {
      const angle = (i / 32) * 2 * Math.PI;
      const origin: Vec3 = [400 + 300 * Math.cos(angle), 400 + 300 * Math.sin(angle), 40];
      const p = g.raycast({ origin, dir: [-Math.cos(angle), -Math.sin(angle), 0] })!;
      expect(Math.hypot(p[0] - 400, p[1] - 400)).toBeLessThan(20);
    }
  });
});

/** True beside a step in the surface, where two levels meet, or where the ray touches it. */
function grazes(g: Ground, p: Vec3): boolean {
  const here = g.heightAt(p[0], p[1]);
  const around = [-0.2, 0.2].flatMap((d) => [g.heightAt(p[0] + d, p[1]), g.heightAt(p[0], p[1] + d)]);
  const low = Math.min(here, ...around);
  const high = Math.max(here, ...around);
  return p[2] >= low - 0.05 && p[2] <= high + 0.05;
}
