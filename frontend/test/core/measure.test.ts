// Instruments against shapes that one can work out (SPEC N1, N2, N8 to N13).
import { describe, expect, it } from "vitest";
import { type AreaFigures, CROSSES, measureArea, NO_AREA, TWO_POINTS } from "../../src/core/measure/area.ts";
import { areaM2, crossesItself, isImpossible, lengthM, type Place, simplified } from "../../src/core/measure/places.ts";
import {
  NO_HEIGHT,
  NO_LENGTH,
  NO_PLACE,
  ONE_POINT,
  type Profile,
  profileAt,
  profileOf,
} from "../../src/core/measure/profile.ts";

/** Numbers that look random and are the same each time. */
function* random(seed: number): Generator<number, never> {
  for (let s = seed >>> 0; ; ) {
    s = (Math.imul(s, 1664525) + 1013904223) >>> 0;
    yield s / 2 ** 32;
  }
}

const profile = (points: readonly Place[], z: (x: number, y: number) => number, step = 1): Profile => {
  const found = profileOf(points, z, step);
  if (isImpossible(found)) throw new Error(found.problem);
  return found;
};
const SIZE = 1024;
const QUESTION = { levelM: 0, sizeM: SIZE, finestCells: 1024 };
const area = (ring: readonly Place[], z: (x: number, y: number) => number, over: object = {}): AreaFigures => {
  const found = measureArea(ring, z, { ...QUESTION, ...over });
  if (isImpossible(found)) throw new Error(found.problem);
  return found;
};

describe("profile", () => {
  it("is exact on planes, whatever the line (SPEC N1, N2)", () => {
    const r = random(3);
    const next = (): number => r.next().value;
    for (let round = 0; round < 40; round++) {
      const [gx, gy, c] = [next() - 0.5, next() - 0.5, 100 * next()];
      const points: Place[] = Array.from({ length: 2 + Math.floor(4 * next()) }, () => [900 * next(), 900 * next()]);
      const found = profile(points, (x, y) => gx * x + gy * y + c, 5);
      const legs = points.slice(1).map((q, i) => {
        const p = points[i]!;
        return { run: Math.hypot(q[0] - p[0], q[1] - p[1]), rise: gx * (q[0] - p[0]) + gy * (q[1] - p[1]) };
      });
      expect(found.lengthM).toBeCloseTo(lengthM(points), 9);
      expect(found.gainM).toBeCloseTo(
        legs.reduce((s, l) => s + Math.max(0, l.rise), 0),
        6,
      );
      expect(found.lossM).toBeCloseTo(
        legs.reduce((s, l) => s + Math.max(0, -l.rise), 0),
        6,
      );
      expect(found.surfaceM).toBeCloseTo(
        legs.reduce((s, l) => s + Math.hypot(l.run, l.rise), 0),
        6,
      );
      expect(Math.abs(found.steepest.m)).toBeCloseTo(Math.max(...legs.map((l) => Math.abs(l.rise / l.run))), 6);
      const heights = points.map(([x, y]) => gx * x + gy * y + c);
      expect(found.max.m).toBeCloseTo(Math.max(...heights), 6);
      expect(found.min.m).toBeCloseTo(Math.min(...heights), 6);
      expect(found.corners).toHaveLength(points.length);
    }
  });

  it("finds the summit of a ridge to a step (SPEC N2)", () => {
    const found = profile(
      [
        [0, 0],
        [1000, 0],
      ],
      (x) => 300 - 0.5 * Math.abs(x - 412.3),
      4,
    );
    expect(Math.abs(found.max.at - 412.3)).toBeLessThanOrEqual(4);
    expect(300 - found.max.m).toBeLessThanOrEqual(2);
    expect(found.gainM - found.lossM).toBeCloseTo(found.height.at(-1)! - found.height[0]!, 9);
    expect(profileAt(found, 206).m).toBeCloseTo(300 - 0.5 * (412.3 - 206), 6);
    expect(profileAt(found, -5).x).toBe(0);
    expect(profileAt(found, 1e9).x).toBe(1000);
  });

  it("has its samples no farther apart than asked for, and a bounded number (SPEC N1)", () => {
    const found = profile(
      [
        [0, 0],
        [100, 0],
        [100, 7],
      ],
      () => 0,
      3,
    );
    for (let i = 1; i < found.distance.length; i++)
      expect(found.distance[i]! - found.distance[i - 1]!).toBeLessThanOrEqual(3 + 1e-9);
    expect(
      profile(
        [
          [0, 0],
          [1e6, 0],
        ],
        () => 0,
        0.01,
      ).distance.length,
    ).toBeLessThanOrEqual(2002);
  });

  it("says why there is none (SPEC N13)", () => {
    const of = (points: Place[], z: () => number = () => 0) => profileOf(points, z, 1);
    expect(of([])).toEqual({ problem: ONE_POINT });
    expect(of([[1, 1]])).toEqual({ problem: ONE_POINT });
    expect(
      of([
        [1, 1],
        [1, 1],
      ]),
    ).toEqual({ problem: NO_LENGTH });
    expect(
      of([
        [1, Number.NaN],
        [2, 2],
      ]),
    ).toEqual({ problem: NO_PLACE });
    expect(
      of([
        [1, Number.POSITIVE_INFINITY],
        [2, 2],
      ]),
    ).toEqual({ problem: NO_PLACE });
    expect(
      of(
        [
          [1, 1],
          [2, 2],
        ],
        () => Number.NaN,
      ),
    ).toEqual({ problem: NO_HEIGHT });
  });
});

describe("area", () => {
  const square: Place[] = [
    [100.3, 200.7],
    [400.9, 200.7],
    [400.9, 500.1],
    [100.3, 500.1],
  ];

  it("is exact on planes for any outline (SPEC N8, N9, N10)", () => {
    const r = random(11);
    const next = (): number => r.next().value;
    for (let round = 0; round < 12; round++) {
      const [gx, gy] = [next() - 0.5, next() - 0.5];
      const n = 3 + Math.floor(6 * next());
      const ring: Place[] = Array.from({ length: n }, (_, k) => {
        const [angle, away] = [(2 * Math.PI * (k + 0.6 * next())) / n, 80 + 250 * next()];
        return [500 + away * Math.cos(angle), 500 + away * Math.sin(angle)];
      });
      const z = (x: number, y: number): number => gx * x + gy * y + 2000;
      const found = area(ring, z);
      expect(found.areaM2).toBeCloseTo(areaM2(ring), 6);
      const slope = Math.hypot(gx, gy);
      expect(found.surfaceM2 / (areaM2(ring) * Math.hypot(1, slope))).toBeCloseTo(1, 9);
      expect(found.meanSlope).toBeCloseTo(slope, 9);
      // The mean of a plane is its height at the centre of mass: volume over area.
      expect(found.aboveM3 / found.areaM2).toBeCloseTo(found.meanM, 6);
      expect(found.belowM3).toBe(0);
      const risen = area(ring, z, { before: (x: number, y: number) => z(x, y) - 3 });
      expect(risen.risenM3! / (3 * areaM2(ring))).toBeCloseTo(1, 9);
      expect(risen.sunkenM3).toBe(0);
    }
  });

  it("knows the volume of a box, a cone and a half ball (SPEC N10, N12)", () => {
    const wide: Place[] = [
      [12, 12],
      [1012, 12],
      [1012, 1012],
      [12, 1012],
    ];
    expect(area(square, () => 7, { levelM: 2 }).aboveM3).toBeCloseTo(5 * 300.6 * 299.4, 3);
    expect(area(square, () => -7, { levelM: 2 }).belowM3).toBeCloseTo(9 * 300.6 * 299.4, 3);
    const away = (x: number, y: number): number => Math.hypot(x - 512, y - 512);
    const cone = area(wide, (x, y) => Math.max(0, 200 - away(x, y)), { levelM: 0 });
    expect(cone.aboveM3 / ((Math.PI * 200 ** 2 * 200) / 3)).toBeCloseTo(1, 3);
    const ball = area(wide, (x, y) => Math.sqrt(Math.max(0, 300 ** 2 - away(x, y) ** 2)));
    expect(ball.aboveM3 / ((2 / 3) * Math.PI * 300 ** 3)).toBeCloseTo(1, 2);
    const half = area(wide, (x, y) => 200 - away(x, y), { levelM: 100 });
    expect(half.aboveM3 / ((Math.PI * 100 ** 2 * 100) / 3)).toBeCloseTo(1, 2);
    const moved = area(wide, (x, y) => Math.max(0, 200 - away(x, y)), {
      before: (x: number, y: number) => Math.max(0, 200 - away(x - 500, y)),
    });
    expect(moved.risenM3! + 0).toBeGreaterThan(0.99 * cone.aboveM3);
  });

  it("does not depend on where the outline begins, nor on its direction (SPEC N8)", () => {
    const z = (x: number, y: number): number => 30 * Math.sin(x / 50) + 20 * Math.cos(y / 70);
    const one = area(square, z);
    for (const ring of [[...square].reverse(), [...square.slice(2), ...square.slice(0, 2)]]) {
      const other = area(ring, z);
      expect(other.areaM2).toBeCloseTo(one.areaM2, 6);
      expect(other.aboveM3).toBeCloseTo(one.aboveM3, 3);
    }
  });

  it("is exact for outlines smaller than a cell, and bounded for large ones (SPEC N9)", () => {
    const tiny: Place[] = [
      [10.2, 10.2],
      [10.7, 10.2],
      [10.7, 10.7],
    ];
    expect(area(tiny, () => 4).aboveM3).toBeCloseTo(4 * 0.125, 9);
    const all: Place[] = [
      [0, 0],
      [SIZE, 0],
      [SIZE, SIZE],
      [0, SIZE],
    ];
    let asked = 0;
    expect(
      area(all, () => {
        asked += 1;
        return 1;
      }).aboveM3,
    ).toBeCloseTo(SIZE ** 2, 3);
    expect(asked).toBeLessThan(260 ** 2);
  });

  it("says why there is none (SPEC N13)", () => {
    const of = (ring: Place[], over: object = {}) => measureArea(ring, () => 0, { ...QUESTION, ...over });
    expect(
      of([
        [0, 0],
        [1, 1],
      ]),
    ).toEqual({ problem: TWO_POINTS });
    expect(
      of([
        [0, 0],
        [9, 9],
        [9, 0],
        [0, 9],
      ]),
    ).toEqual({ problem: CROSSES });
    expect(
      of([
        [0, 0],
        [5, 5],
        [9, 9],
      ]),
    ).toEqual({ problem: NO_AREA });
    expect(
      of([
        [0, 0],
        [5, Number.NaN],
        [9, 0],
      ]),
    ).toEqual({ problem: NO_PLACE });
    expect(of(square, { levelM: Number.NaN })).toEqual({ problem: NO_PLACE });
    expect(measureArea(square, () => Number.NaN, QUESTION)).toEqual({ problem: NO_HEIGHT });
  });
});

describe("outlines", () => {
  it("cross themselves or not", () => {
    expect(
      crossesItself([
        [0, 0],
        [4, 0],
        [4, 4],
        [0, 4],
      ]),
    ).toBe(false);
    expect(
      crossesItself([
        [0, 0],
        [4, 4],
        [4, 0],
        [0, 4],
      ]),
    ).toBe(true);
    expect(
      crossesItself([
        [0, 0],
        [4, 0],
        [2, 0],
        [2, 4],
      ]),
    ).toBe(true);
    expect(
      crossesItself([
        [0, 0],
        [4, 0],
        [2, 3],
      ]),
    ).toBe(false);
  });

  it("lose points that do not matter, and keep their ends (SPEC N5)", () => {
    const line: Place[] = Array.from({ length: 200 }, (_, i) => [i, i < 100 ? 0 : i - 100]);
    expect(simplified(line, 0.6, 64)).toEqual([
      [0, 0],
      [100, 0],
      [199, 99],
    ]);
    const wave: Place[] = Array.from({ length: 500 }, (_, i) => [i, 40 * Math.sin(i / 5)]);
    const kept = simplified(wave, 0.01, 24);
    expect(kept.length).toBeLessThanOrEqual(24);
    expect([kept[0], kept.at(-1)]).toEqual([wave[0], wave.at(-1)]);
    expect(simplified([[1, 2]], 1, 24)).toEqual([[1, 2]]);
  });
});
