/** SPEC T40, T41: the ground as it is drawn, against windows made at once and against brute force. */

import fc from "fast-check";
import { describe, expect, test } from "vitest";
import type { Ground, Ray, Vec3 } from "../../src/core/types.ts";
import { TILE_CELLS } from "../../src/generated/contract.ts";
import { Biases } from "../../src/tiles/detail/biases.ts";
import { BLOCK_CELLS, BLOCK_SIDE, DetailField, finestLevel } from "../../src/tiles/detail/detail.ts";
import { detailOf, RULES } from "../../src/tiles/detail/subdivide.ts";
import { heightsOfTiles } from "../../src/tiles/patches/guide.ts";
import type { RuleSettings } from "../../src/tiles/rules/rule.ts";
import { siteOf } from "../../src/tiles/rules/rule.ts";
import { ShownGround } from "../../src/tiles/shown.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { frame, tileOf } from "./frames.ts";
import { channelsOf, type SiteVector, unpacked, vectors } from "./synthesis.ts";

const SIZE = 1024;
const SOLVED = 2;
const hills = (x: number, y: number): number =>
  160 * Math.exp(-((x - 480) ** 2 + (y - 560) ** 2) / 40_000) + 20 * Math.sin(x / 83) * Math.cos(y / 71);

const settings = (over: Partial<RuleSettings> = {}): RuleSettings => ({
  size_m: SIZE,
  seed: 7,
  sea_level_m: null,
  look: "natural",
  detail: 1,
  rule: "landscape",
  ...over,
});

/** Levels 0 to 2 everywhere; level 3 in one corner, a little higher than the others think. */
function held(): TileStore {
  const store = new TileStore(SIZE, 6, SOLVED);
  for (let level = 0; level <= SOLVED; level++) {
    const n = 2 ** level;
    const tiles = Array.from({ length: n * n }, (_, k) => tileOf(level, k % n, Math.floor(k / n), 1, hills, SIZE));
    store.apply(frame("LEVEL", level, tiles));
  }
  const fine = [
    [2, 2],
    [3, 2],
    [2, 3],
  ] as const;
  const lifted = (x: number, y: number): number => hills(x, y) + 3 * Math.sin(x / 9) ** 2;
  store.apply(
    frame(
      "FILL",
      3,
      fine.map(([x, y]) => tileOf(3, x, y, 1, lifted, SIZE)),
    ),
  );
  return store;
}

const store = held();
const heightOf = heightsOfTiles((l, x, y) => store.tile(l, x, y));

function shown(over: Partial<RuleSettings> = {}, channels = channelsOf()): { ground: ShownGround; field: DetailField } {
  const field = new DetailField(settings(over), channels, heightOf, SOLVED);
  return { ground: new ShownGround(store.freeze(), SOLVED, field), field };
}

describe("a block of detail", () => {
  test("is what the twin makes of that window at once, on every level, and neighbours share their edges", () => {
    const painted = channelsOf({
      amplitude: [
        [0, 4],
        [2, 9],
      ],
      roughness: [
        [0, 1],
        [0.3, 0.7],
      ],
      snow: [
        [1, -1],
        [0, 0.4],
      ],
    });
    const { field } = shown({}, painted);
    const recipe = {
      site: siteOf(settings()),
      rule: RULES.landscape,
      biases: new Biases(painted, siteOf(settings())),
      guide: field.recipe.guide,
    };
    for (let level = 0; level <= 12; level++) {
      const n = (TILE_CELLS / BLOCK_CELLS) * 2 ** level;
      for (const [u, v] of [
        [0, 0],
        [0.43, 0.61],
        [1, 0.5],
      ] as const) {
        const [x, y] = [Math.min(n - 1, Math.floor(u * n)), Math.min(n - 1, Math.floor(v * n))];
        const block = field.block(level, x, y)!;
        const plain = detailOf(block.area, recipe as never, false)!;
        expect([...block.d]).toEqual([...plain.d]);
        expect([...block.snow]).toEqual([...plain.snow]);
        if (x + 1 === n) continue;
        const east = field.block(level, x + 1, y)!;
        const shared = (of: Float64Array, from: number): number[] =>
          [...of].filter((_, k) => k % BLOCK_SIDE >= from && k % BLOCK_SIDE < from + BLOCK_SIDE - BLOCK_CELLS);
        expect(shared(block.d, BLOCK_CELLS)).toEqual(shared(east.d, 0));
      }
    }
  });

  test("is not there while level 0 is not held", () => {
    const field = new DetailField(settings(), channelsOf(), () => undefined, SOLVED);
    expect(field.block(3, 1, 2)).toBeNull();
    expect(field.attributesAt(5, 5, 3)).toBeNull();
  });
});

describe("heightAt", () => {
  test("adds the detail of the wanted cells to the held samples", () => {
    const { ground, field } = shown();
    const cell = SIZE / (TILE_CELLS * 2 ** 3);
    for (const [i, j] of [
      [150, 140],
      [200, 170],
      [161, 201],
    ] as const) {
      const tile = store.tile(3, i >> 6, j >> 6)!;
      const base = tile.heights[(j & 63) * 65 + (i & 63)]!;
      const block = field.block(3, i >> 3, j >> 3)!;
      const d = block.d[((j & 7) + 2) * BLOCK_SIDE + (i & 7) + 2]!;
      expect(ground.heightAt(i * cell, j * cell)).toBeCloseTo(base + d, 4);
      expect(ground.solvedAt(i * cell, j * cell)).toBe(base);
    }
  });

  test("is the solved ground where there is no detail, whatever cells are asked for", () => {
    for (const over of [{ detail: 0 }, { rule: "plain" as const }]) {
      const { ground } = shown(over);
      for (const [x, y] of [
        [300, 700],
        [10, 900],
        [480, 560],
      ] as const) {
        expect(ground.heightAt(x, y)).toBeCloseTo(store.ground.heightAt(x, y), 4);
        expect(Math.abs(ground.heightAt(x, y, 0.02) - store.ground.heightAt(x, y))).toBeLessThan(0.1);
      }
    }
  });

  test("goes on to a centimetre, in steps that become small", () => {
    const { ground } = shown();
    const [x, y] = [433, 611];
    const steps = Array.from({ length: 14 }, (_, k) => ground.heightAt(x, y, 16 / 2 ** k));
    const moves = steps.slice(1).map((z, k) => Math.abs(z - steps[k]!));
    expect(Math.max(...moves.slice(9))).toBeLessThan(0.02);
    expect(Math.abs(ground.heightAt(x, y, 1e-9) - steps.at(-1)!)).toBeLessThan(0.02);
    expect(finestLevel(4096)).toBe(13);
    expect(finestLevel(65536)).toBe(17);
  });

  test("is clamped outside the domain, and 0 while nothing is held", () => {
    const { ground } = shown();
    expect(ground.heightAt(-50, 300)).toBe(ground.heightAt(0, 300));
    expect(ground.heightAt(2000, 5000)).toBe(ground.heightAt(SIZE, SIZE));
    const empty = new TileStore(SIZE, 6, SOLVED);
    const none = new ShownGround(
      empty.freeze(),
      SOLVED,
      new DetailField(settings(), channelsOf(), () => undefined, SOLVED),
    );
    expect(none.heightAt(3, 4)).toBe(0);
    expect(none.heightAt(3, 4, 0.1)).toBe(0);
    expect(none.raycast({ origin: [5, 5, 100], dir: [0, 0, -1] })).toBeNull();
  });
});

describe("heights of all languages", () => {
  /** The levels of a site's vectors as held tiles. */
  function storeOf(site: SiteVector): TileStore {
    const tiles = new TileStore(site.size_m, 17, site.solved);
    site.quanta.forEach((quanta, level) => {
      const side = TILE_CELLS * 2 ** level + 1;
      const cell = site.size_m / (side - 1);
      const at = (v: number): number => Math.round(v / cell);
      const height = (x: number, y: number): number => (quanta[at(y) * side + at(x)]! * cell) / 256;
      const n = 2 ** level;
      const all = Array.from({ length: n * n }, (_, k) =>
        tileOf(level, k % n, Math.floor(k / n), 1, height, site.size_m),
      );
      tiles.apply(frame("LEVEL", level, all));
    });
    return tiles;
  }

  test("base and detail are those of the vectors, at every level, with every rule", () => {
    let compared = 0;
    let worst = 0;
    for (const site of vectors.sites.filter((s) => !s.cyclic)) {
      const tiles = storeOf(site);
      const of = heightsOfTiles((l, x, y) => tiles.tile(l, x, y));
      const field = new DetailField(site, channelsOf(site.channels), of, site.solved);
      const ground = new ShownGround(tiles.freeze(), site.solved, field);
      for (const { level, window, base, state } of vectors.places.filter((p) => p.site === site.name)) {
        if (level > field.finest) continue;
        const cell = site.size_m / (TILE_CELLS * 2 ** level);
        const [r0, r1, c0, c1] = window;
        const { d } = unpacked(state);
        for (let j = Math.max(0, r0), n = TILE_CELLS * 2 ** level; j < Math.min(r1, n); j++)
          for (let i = Math.max(0, c0); i < Math.min(c1, n); i++) {
            const k = (j - r0) * (c1 - c0) + i - c0;
            // Half a cell finer than asked for would be the next level; what is left out is a tenth of a cell.
            const found = ground.heightAt(i * cell, j * cell, cell);
            worst = Math.max(worst, Math.abs(found - base[k]! - d[k]!) / (0.11 * cell + 2e-3));
            compared++;
          }
      }
    }
    expect(compared).toBeGreaterThan(1000);
    expect(worst).toBeLessThan(1);
  });
});

/** First crossing found by small steps on cells of one size, refined by bisection. */
function bruteForce(g: Ground, ray: Ray, cellM: number, length: number): Vec3 | null {
  const at = (t: number): Vec3 => [0, 1, 2].map((k) => ray.origin[k]! + t * ray.dir[k]!) as unknown as Vec3;
  const over = (p: Vec3): number => p[2] - g.heightAt(p[0], p[1], cellM);
  let last: number | null = null;
  for (let t = 0; t < length; t += 0.4) {
    const p = at(t);
    if (p[0] < 0 || p[1] < 0 || p[0] > SIZE || p[1] > SIZE) {
      if (last !== null) return null;
      continue;
    }
    if (over(p) < 0) {
      if (last === null) return null;
      let [low, high] = [last, t];
      for (let i = 0; i < 50; i++) {
        const mid = (low + high) / 2;
        if (over(at(mid)) < 0) high = mid;
        else low = mid;
      }
      return at(high);
    }
    last = t;
  }
  return null;
}

describe("raycast", () => {
  const place = fc.record({ x: fc.integer({ min: 20, max: 1000 }), y: fc.integer({ min: 20, max: 1000 }) });

  test("meets the ground that is drawn: agrees with brute force on cells of the same size", () => {
    const { ground } = shown({ detail: 2 });
    const cell = SIZE / (TILE_CELLS * 2 ** 4);
    let hits = 0;
    fc.assert(
      fc.property(place, fc.integer({ min: 30, max: 260 }), place, (a, z, b) => {
        const [dx, dy] = [b.x - a.x, b.y - a.y];
        fc.pre(Math.hypot(dx, dy) > 20);
        const top = ground.heightAt(a.x, a.y) + z;
        const raw: Vec3 = [dx, dy, ground.heightAt(b.x, b.y) - top];
        const n = Math.hypot(...raw);
        const dir: Vec3 = [raw[0] / n, raw[1] / n, raw[2] / n];
        const ray: Ray = { origin: [a.x, a.y, top], dir, spread: [cell / 2, 0] };
        const slow = bruteForce(ground, ray, cell, 1.5 * n);
        const fast = ground.raycast(ray);
        if (slow === null) return;
        hits++;
        expect(fast).not.toBeNull();
        const reached = Math.hypot(fast![0] - a.x, fast![1] - a.y, fast![2] - top);
        const wanted = Math.hypot(slow[0] - a.x, slow[1] - a.y, slow[2] - top);
        // Steps of the brute force may jump over a graze; nothing may be met later than it says.
        expect(reached).toBeLessThan(wanted + 0.3);
        expect(Math.abs(fast![2] - ground.heightAt(fast![0], fast![1], cell))).toBeLessThan(0.3);
      }),
      { numRuns: 14, seed: 11 },
    );
    expect(hits).toBeGreaterThan(8);
  });

  test("sees nothing but what a pixel shows: far rays are cheap, near ones meet centimetres", () => {
    const { ground } = shown();
    const [x, y] = [433, 611];
    const near = ground.raycast({
      origin: [x, y, ground.heightAt(x, y, 0.01) + 2],
      dir: [0, 0, -1],
      spread: [0, 1e-3],
    })!;
    expect(Math.abs(near[2] - ground.heightAt(x, y, 0.01))).toBeLessThan(0.01);
    const far = ground.raycast({ origin: [x, y, 4000], dir: [0, 0, -1], spread: [0, 1e-3] })!;
    expect(Math.abs(far[2] - ground.heightAt(x, y, 4))).toBeLessThan(0.5);
  });

  test("misses are null: the sky, beside the domain, and through its side", () => {
    const { ground } = shown();
    expect(ground.raycast({ origin: [500, 500, 300], dir: [1, 1, 0.2] })).toBeNull();
    expect(ground.raycast({ origin: [-500, -500, 200], dir: [-1, 0.5, -0.1] })).toBeNull();
    expect(ground.raycast({ origin: [-300, 500, -500], dir: [1, 0, 0.9] })).toBeNull();
  });
});
