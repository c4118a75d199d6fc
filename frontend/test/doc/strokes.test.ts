// Strokes as geometry: frames and bounds (SPEC D).
import fc from "fast-check";
import { describe, expect, it } from "vitest";
import { bounds, levelCurve, profileCurve, worldPoints } from "../../src/doc/strokes.ts";
import { ridge } from "./model.ts";

const coordinate = fc.double({ min: -5000, max: 5000, noNaN: true });
const anchor = fc.tuple(coordinate, coordinate, coordinate);
const frames = fc.tuple(anchor, anchor).filter(([a, b]) => Math.hypot(b[0] - a[0], b[1] - a[1]) > 1);

describe("frames", () => {
  it("a profile's curve and its world points are each other's inverse", () => {
    fc.assert(
      fc.property(
        frames,
        fc.array(fc.tuple(fc.double({ min: -2, max: 3, noNaN: true }), coordinate), { maxLength: 20 }),
        ([first, last], curve) => {
          const back = profileCurve(worldPoints({ kind: "profile", first, last, curve }), first, last);
          for (const [i, [u, w]] of curve.entries()) {
            expect(back[i]![0]).toBeCloseTo(u, 6);
            expect(back[i]![1]).toBeCloseTo(w, 4);
          }
        },
      ),
    );
  });

  it("a level stroke's curve and its world points are each other's inverse", () => {
    fc.assert(
      fc.property(
        frames,
        fc.array(fc.tuple(fc.double({ min: -3, max: 3, noNaN: true }), fc.double({ min: -3, max: 3, noNaN: true })), {
          maxLength: 20,
        }),
        ([first, last], curve) => {
          const points = worldPoints({ kind: "level", first, last, curve });
          for (let i = 2; i < points.length; i += 3) expect(points[i]).toBe(first[2]);
          const back = levelCurve(points, first, last);
          for (const [i, [u, v]] of curve.entries()) {
            expect(back[i]![0]).toBeCloseTo(u, 6);
            expect(back[i]![1]).toBeCloseTo(v, 6);
          }
        },
      ),
    );
  });

  it("left is left: v > 0 lies north of a stroke that runs east", () => {
    const points = worldPoints({ kind: "level", first: [0, 0, 7], last: [100, 0, 7], curve: [[0.5, 0.25]] });
    expect([...points]).toEqual([50, 25, 7]);
  });

  it("anchors in one place give finite frames", () => {
    const points = [1, 2, 3, 4, 5, 6];
    expect(profileCurve(points, [1, 1, 0], [1, 1, 5])).toEqual([
      [0, 3],
      [0, 6],
    ]);
    expect(levelCurve(points, [1, 1, 0], [1, 1, 5])).toEqual([
      [0, 0],
      [0, 0],
    ]);
  });
});

describe("bounds", () => {
  it("hold the crest and the wider flank", () => {
    const flank = { slope_deg: 30, extent_m: 50, shape: "straight" as const };
    const s = ridge("s", {
      curve: [
        [0, 0],
        [1, 0],
      ],
      left: flank,
      right: { ...flank, extent_m: 80 },
      plateau_radius_m: 10,
    });
    expect(bounds(s)).toEqual({ x0: 10, y0: 10, x1: 990, y1: 190 });
    expect(bounds({ ...s, hidden: true })).toBeNull();
    expect(bounds({ ...s, curve: [] })).toBeNull();
  });

  it("hold the ring of a brush, whatever its flanks", () => {
    const paint = { channel: "snow" as const, value: 1, radius_m: 30 };
    const flank = { slope_deg: 30, extent_m: 500, shape: "straight" as const };
    const s = ridge("p", { kind: "paint", paint, left: flank, plateau_radius_m: 99, curve: [[1, 0.5]] });
    expect([...worldPoints(s)]).toEqual([900, 500, 0]);
    expect(bounds(s)).toEqual({ x0: 870, y0: 470, x1: 930, y1: 530 });
  });
});
