// SPEC U27, U28, U29
// @vitest-environment happy-dom

import { signal } from "@preact/signals-core";
import fc from "fast-check";
import { describe, expect, it, vi } from "vitest";
import { footprintVisuals, outlineOf, stemsOf, visualOf } from "../../src/app/layers/footprints.ts";
import {
  handAnswers,
  heightRange,
  laidByHand,
  listsFormats,
  namesSystem,
  optionWords,
} from "../../src/app/layers/import-questions.ts";
import {
  layerFacts,
  orderedLayers,
  percent,
  placeWords,
  reorderOps,
  reportFacts,
} from "../../src/app/layers/layers.ts";
import { PendingPlacing, startingPlace } from "../../src/app/layers/placing.ts";
import { firstPlace } from "../../src/core/lattice.ts";
import type { Ground } from "../../src/core/types.ts";
import { apply } from "../../src/doc/apply.ts";
import { fromDocument } from "../../src/doc/document.ts";
import type { ImportReport, Layer } from "../../src/generated/contract.ts";
import { placingShades, placingVertices } from "../../src/gpu/passes/placing.ts";
import { EMPTY } from "../doc/model.ts";
import { layer, REPORT } from "../ui/grids.ts";

const flat: Ground = { sizeM: 4096, heightAt: () => 50, raycast: () => null };

describe("the order of layers", () => {
  it("is by priority, then by id, the believed one first", () => {
    const layers = [layer("a"), layer("c"), layer("b", { priority: 3 }), layer("d", { priority: -1 })];
    expect(orderedLayers(layers).map((l) => l.id)).toEqual(["b", "c", "a", "d"]);
  });

  it("is what was asked for, by changes that a document takes", () => {
    const priorities = fc.array(fc.integer({ min: -3, max: 3 }), { minLength: 2, maxLength: 8 });
    fc.assert(
      fc.property(priorities, fc.nat(), fc.nat(), (ps, a, b) => {
        const layers = ps.map((priority, i) => layer(`l${i}`, { priority }));
        const before = orderedLayers(layers);
        const [from, to] = [a % ps.length, b % ps.length];
        const wanted = before.map((l) => l.id);
        wanted.splice(to, 0, ...wanted.splice(from, 1));
        let doc = fromDocument({ ...EMPTY, layers });
        const ops = reorderOps(before, before[from]!.id, to);
        if (ops.length > 0) doc = apply(doc, { type: "group", ops });
        expect(orderedLayers(doc.layers.values()).map((l) => l.id)).toEqual(wanted);
      }),
    );
  });

  it("changes one layer where there is room", () => {
    const layers = orderedLayers([
      layer("a", { priority: 9 }),
      layer("b", { priority: 5 }),
      layer("c", { priority: 1 }),
    ]);
    expect(reorderOps(layers, "c", 1)).toEqual([{ type: "layer.set", layer: "c", fields: { priority: 6 } }]);
    expect(reorderOps(layers, "a", 2)).toEqual([{ type: "layer.set", layer: "a", fields: { priority: 0 } }]);
    expect(reorderOps(layers, "a", 0)).toEqual([]);
    expect(reorderOps(layers, "nobody", 0)).toEqual([]);
  });
});

describe("words of grids", () => {
  it("say what a layer is where it lies", () => {
    const facts = Object.fromEntries(layerFacts(layer("a", { scale: -2, lift_m: 100, spacing_m: [10, 30] })));
    expect(facts).toMatchObject({
      Spacing: "10 × 30 m",
      "On the ground": "2.0 km × 3.0 km",
      Heights: "−900 m to 100 m",
    });
  });

  it("say what a file is, and nothing that is not known", () => {
    const facts = Object.fromEntries(reportFacts({ ...REPORT, at: [46.2, -122.19], valid: 0.6281 }));
    expect(facts).toEqual({
      Format: "NPY, float32",
      Samples: "96 × 96",
      Middle: "46.20° N, 122.19° W",
      Heights: "2000 m to 2200 m",
      "With data": "63 %",
    });
    expect(placeWords([-33.9, 151.2])).toBe("33.90° S, 151.20° E");
    expect([0, 0.003, 0.5, 0.9999, 1].map(percent)).toEqual(["0 %", "under 1 %", "50 %", "over 99 %", "100 %"]);
  });

  it("know which answers leave the place to a person", () => {
    const question = (id: string) => ({ id, text: "", options: ["EPSG:4326", "middle"], default: "middle" });
    expect(laidByHand(question("place"), "middle")).toBe(true);
    expect(laidByHand(question("place"), "EPSG:4326")).toBe(false);
    expect(laidByHand(question("size"), "fit")).toBe(true);
    expect(laidByHand(question("nodata"), "middle")).toBe(false);
    expect(heightRange("0..4380.5")).toEqual([0, 4380.5]);
    expect(heightRange("-12.5 .. 1e3")).toEqual([-12.5, 1000]);
    for (const text of ["5..1", "fit", "", "1..x", undefined]) expect(heightRange(text)).toBeNull();
    expect(optionWords("nodata", "-9999")).toBe("Yes, leave out -9999");
    expect(optionWords("height", "shift")).toBe("Yes, shift all its heights");
    const place = (...options: string[]) => ({ id: "place", text: "", options, default: "middle" });
    expect(namesSystem(place("EPSG:4326", "middle"))).toBe(true);
    expect(namesSystem(place("middle", "stop"))).toBe(false);
    expect(handAnswers({ ...place("shift", "stop"), id: "height" })).toBe(true);
    expect(handAnswers(place("middle"))).toBe(false);
    expect(listsFormats("It is in no format that can be read. There are: GeoTIFF or COG")).toBe(true);
    expect(listsFormats("It is empty.")).toBe(false);
    expect(optionWords("rows", "north first")).toBe("The northern row first");
    expect(optionWords("rows", "east first")).toBe("East first");
  });
});

describe("footprints", () => {
  const doc = (...layers: Layer[]) => fromDocument({ ...EMPTY, layers });
  const marks = { selected: null, hovered: null, placing: null, calm: false };

  it("lie on the ground as closed lines, as strong as their layer says", () => {
    const [f] = footprintVisuals(doc(layer("a")), marks, flat);
    expect([...f!.points.slice(0, 3)]).toEqual([100, 200, 50]);
    expect([...f!.points.slice(-3)]).toEqual([100, 200, 50]);
    expect(f!.colour[3]).toBeCloseTo(0.35);
    for (let i = 2; i < f!.points.length; i += 3) expect(f!.points[i]).toBe(50);
  });

  it("are not drawn for hidden or unwanted ones, but for those that are looked at", () => {
    const all = doc(layer("a", { hidden: true }), layer("b", { outline: 0 }), layer("c", { outline: 0 }));
    expect(footprintVisuals(all, marks, flat)).toEqual([]);
    const seen = footprintVisuals(all, { ...marks, selected: "a", hovered: "b" }, flat);
    expect(seen.map((f) => [f.id, f.strong])).toEqual([
      ["a", true],
      ["b", false],
    ]);
  });

  it("are made once for the same layer and ground", () => {
    const d = doc(layer("a"));
    const [one] = footprintVisuals(d, marks, flat);
    const [two] = footprintVisuals(d, { ...marks, hovered: "a" }, flat);
    expect(two!.points).toBe(one!.points);
    expect(footprintVisuals(d, marks, { ...flat })[0]!.points).not.toBe(one!.points);
  });
});

describe("a file without a place", () => {
  const pending = (over: Partial<ImportReport> = {}, range: readonly [number, number] = [2000, 2200]) => {
    const report = { ...REPORT, ...over };
    const finish = vi.fn();
    return new PendingPlacing(
      "import-1",
      report,
      signal(range),
      startingPlace(report, 4096, 0.4, 700),
      finish,
      vi.fn(),
    );
  };

  it("begins in the middle, on the ground that is there", () => {
    const placing = pending();
    expect(placing.place.value.spacing_m[0]).toBeCloseTo((0.4 * 4096) / 95);
    expect(placing.place.value.lift_m).toBe(-1300);
    expect(startingPlace(REPORT, 4096, 1, 0).lift_m).toBe(0);
    // Heights of 2,000 m: more than five sides of 64 m.
    expect(startingPlace(REPORT, 64, 1, 0).lift_m).toBe(-2000);
    expect(pending({ spacing_m: [2, 2], questions: [] }).place.value.spacing_m).toEqual([2, 2]);
  });

  it("shows its coarse relief where it would lie", () => {
    const placing = pending();
    placing.moveTo({ ...firstPlace(REPORT, 4096, [2, 2]), anchor: [0, 0], scale: 2, lift_m: -4000 });
    const { side, points } = placing.visual.value!;
    expect(side).toBe(2);
    expect([...points.slice(0, 6)]).toEqual([0, 0, 0, 190, 0, 400]);
    expect(points[8]).toBeCloseTo((128 / 255) * 400, 3);
    expect(points[11]).toBeNaN();
    expect(visualOf(placing, placing.place.value, [])).toBeNull();
  });

  it("stands on stems at the corners that hold data", () => {
    const placing = pending();
    const stems = stemsOf(placing, placing.visual.value, flat);
    expect(stems.length).toBe(3);
    const [x, y, z, x1, y1, z1] = stems[0]!.points;
    expect([x, y]).toEqual([x1, y1]);
    expect(z).toBe(50);
    expect(z1).toBe(2000 + placing.place.value.lift_m);
    expect(stemsOf(placing, null, flat)).toEqual([]);
  });

  it("is outlined where its edge truly lies, wherever it is moved", () => {
    // The middle of the south side bends by 4 rows to the south, that of the east side by 2 columns to the west.
    const edge = Array.from({ length: 32 }, (_, i): [number, number] =>
      i === 4 ? [0, -4] : i === 12 ? [-2, 0] : [0, 0],
    );
    const bent = layer("a", { rotation_deg: 90, facts: { ...layer("a").facts, edge } });
    const points = outlineOf(bent.facts, bent, flat, edge);
    const lies = (x: number, y: number): number => {
      let least = Number.POSITIVE_INFINITY;
      for (let i = 0; i < points.length; i += 3)
        least = Math.min(least, Math.hypot(points[i]! - x, points[i + 1]! - y));
      return least;
    };
    expect(lies(100 + 40, 200 + 1000)).toBeLessThan(1e-6);
    expect(lies(100 - 500, 200 + 2000 - 20)).toBeLessThan(1e-6);
    expect(lies(100, 200)).toBeLessThan(1e-6);
    expect([...points.slice(0, 3)]).toEqual([...points.slice(-3)]);
    expect(outlineOf(bent.facts, bent, flat, []).length).toBeLessThanOrEqual(points.length);
  });

  it("shows no cell that lacks a corner, and light from the north-west", () => {
    const at = (f: (r: number, q: number) => number) => {
      const points = new Float32Array(27);
      for (let i = 0; i < 9; i++) points.set([i % 3, Math.floor(i / 3), f(Math.floor(i / 3), i % 3)], 3 * i);
      return { side: 3, points, colour: [1, 1, 1, 1] as const };
    };
    expect(placingVertices(at(() => 0)).length).toBe(4 * 6 * 10);
    expect(placingVertices(at((r, q) => (r + q === 0 ? Number.NaN : 0))).length).toBe(3 * 6 * 10);
    const toLight = placingShades(at((r, q) => q - r))[4]!;
    const away = placingShades(at((r, q) => r - q))[4]!;
    expect(toLight).toBeGreaterThan(placingShades(at(() => 0))[4]!);
    expect(away).toBeLessThan(0.1);
  });
});
