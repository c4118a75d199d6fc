// SPEC I84
import fc from "fast-check";
import { describe, expect, it } from "vitest";
import {
  centreOf,
  cornersOf,
  covers,
  extentOf,
  firstPlace,
  fitted,
  type GridPlace,
  latticeOf,
  latticePoint,
  rounded,
  turned,
  wrapDegrees,
} from "../../src/core/lattice.ts";
import { MAX_GRID_SPACING_M, MIN_GRID_SPACING_M } from "../../src/generated/contract.ts";

const shape = fc.record({ rows: fc.integer({ min: 4, max: 5000 }), cols: fc.integer({ min: 4, max: 5000 }) });
const place: fc.Arbitrary<GridPlace> = fc.record({
  anchor: fc.tuple(fc.double({ min: -1e4, max: 1e4, noNaN: true }), fc.double({ min: -1e4, max: 1e4, noNaN: true })),
  rotation_deg: fc.double({ min: -360, max: 360, noNaN: true }),
  spacing_m: fc.tuple(fc.double({ min: 0.5, max: 200, noNaN: true }), fc.double({ min: 0.5, max: 200, noNaN: true })),
  scale: fc.constant(1),
  lift_m: fc.constant(0),
});

describe("a grid's lattice", () => {
  it("goes to the world and back", () => {
    fc.assert(
      fc.property(place, fc.double({ min: -9, max: 9, noNaN: true }), (p, u) => {
        const [x, y] = latticePoint(p, u, 2 * u);
        const [bu, bv] = latticeOf(p, x, y);
        expect(bu).toBeCloseTo(u, 6);
        expect(bv).toBeCloseTo(2 * u, 6);
      }),
    );
  });

  it("has sample [0, 0] at its anchor and turns counter-clockwise", () => {
    const p: GridPlace = { anchor: [100, 200], rotation_deg: 90, spacing_m: [10, 30], scale: 1, lift_m: 0 };
    expect(latticePoint(p, 0, 0)).toEqual([100, 200]);
    expect(latticePoint(p, 3, 0)).toEqual([100, 230]);
    expect(latticePoint(p, 0, 2)).toEqual([40, 200]);
  });

  it("has its corners counter-clockwise", () => {
    fc.assert(
      fc.property(shape, place, (s, p) => {
        const c = cornersOf(s, p);
        let twice = 0;
        for (let i = 0; i < 4; i++) {
          const [a, b] = [c[i]!, c[(i + 1) % 4]!];
          twice += a[0] * b[1] - b[0] * a[1];
        }
        const [wide, tall] = extentOf(s, p);
        expect(twice / 2 / (wide * tall)).toBeCloseTo(1, 5);
      }),
    );
  });

  it("turns about its middle", () => {
    fc.assert(
      fc.property(shape, place, fc.double({ min: -720, max: 720, noNaN: true }), (s, p, angle) => {
        const next = turned(s, p, angle);
        const [a, b] = [centreOf(s, p), centreOf(s, next)];
        expect(Math.hypot(a[0] - b[0], a[1] - b[1])).toBeLessThan(1e-3);
        expect(Math.abs(next.rotation_deg)).toBeLessThanOrEqual(180);
        expect(covers(s, next, ...a)).toBe(true);
      }),
    );
  });

  it("fits the terrain at any angle and touches its border", () => {
    fc.assert(
      fc.property(shape, place, (s, p) => {
        const size = 4096;
        const next = fitted(s, p, size);
        fc.pre(next.spacing_m.every((v) => v > MIN_GRID_SPACING_M && v < MAX_GRID_SPACING_M));
        const at = cornersOf(s, next).flat();
        expect(Math.min(...at)).toBeGreaterThan(-1e-6 * size);
        expect(Math.max(...at)).toBeLessThan(size * (1 + 1e-6));
        expect(Math.min(Math.min(...at), size - Math.max(...at))).toBeLessThan(1e-6 * size);
        expect(next.spacing_m[1] / next.spacing_m[0]).toBeCloseTo(p.spacing_m[1] / p.spacing_m[0], 6);
      }),
    );
  });

  it("begins in the middle with its own spacing, if that can be seen", () => {
    const s = { rows: 101, cols: 201 };
    expect(firstPlace(s, 4096, [10, 10])).toMatchObject({ anchor: [1048, 1548], spacing_m: [10, 10] });
    expect(extentOf(s, firstPlace(s, 4096, null))[0]).toBeCloseTo(4096);
    expect(extentOf(s, firstPlace(s, 4096, null, 0, 0.4))[0]).toBeCloseTo(0.4 * 4096);
    expect(extentOf(s, firstPlace(s, 4096, [1000, 1000]))[0]).toBeCloseTo(4096);
  });

  it("is short on the wire", () => {
    const p = rounded({
      anchor: [1 / 3, 2e5 / 3],
      rotation_deg: 400 / 3,
      spacing_m: [10 / 3, 1e-9],
      scale: 1e9,
      lift_m: -1 / 7,
    });
    expect(p.anchor).toEqual([0.333, 66666.667]);
    expect(p.rotation_deg).toBe(133.333);
    expect(p.spacing_m[0]).toBe(3.33333333);
    expect(p.scale).toBe(1000);
    expect(p.lift_m).toBe(-0.143);
  });

  it("knows angles within a turn", () => {
    expect([0, 180, -180, 270, -270, 540, 359].map(wrapDegrees)).toEqual([0, 180, 180, -90, 90, 180, -1]);
  });
});
