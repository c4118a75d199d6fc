// SPEC U6, U7, U8
import fc from "fast-check";
import { describe, expect, it } from "vitest";
import {
  drag,
  fitFrame,
  flankShare,
  footM,
  type KnobId,
  knobs,
  nudge,
  outline,
  type Section,
  slopeThrough,
  symmetric,
} from "../../src/app/view/cross-section.ts";
import { PRESETS, presetsFor } from "../../src/app/words/presets.ts";
import { type Flank, MAX_SIZE_M, MAX_SLOPE_DEG, MIN_SIZE_M } from "../../src/generated/contract.ts";

const flank = (slope_deg: number | null, extent_m: number, shape: Flank["shape"] = "straight"): Flank => ({
  slope_deg,
  extent_m,
  shape,
});
const ridge: Section = { left: flank(45, 512), right: flank(30, 300), plateauRadiusM: 20, reliefM: 200 };
const limits = { maxExtentM: 2048, maxPlateauM: 1024 };
const knob = (section: Section, id: KnobId) => knobs(section, fitFrame(section, 268, 124)).find((k) => k.id === id)!;

const anyFlank = fc.option(
  fc.record({
    slope_deg: fc.option(fc.double({ min: 0, max: MAX_SLOPE_DEG, noNaN: true })),
    extent_m: fc.double({ min: 0, max: 4000, noNaN: true }),
    shape: fc.constantFrom<Flank["shape"]>("straight", "concave", "convex"),
  }),
);
const anySection: fc.Arbitrary<Section> = fc.record({
  left: anyFlank,
  right: anyFlank,
  plateauRadiusM: fc.double({ min: 0, max: 1000, noNaN: true }),
  reliefM: fc.double({ min: -2000, max: 2000, noNaN: true }),
});

describe("the picture", () => {
  it("is to scale: a flank of 45° falls as far as it runs", () => {
    const frame = fitFrame(ridge, 268, 124);
    const slope = knob(ridge, "left-slope");
    const edge = frame.centreX - 20 * frame.pxPerM;
    expect(edge - slope.x).toBeCloseTo(slope.y - frame.crestY, 6);
  });

  it("puts the foot where the slope meets the base, or at the extent", () => {
    expect(footM(flank(45, 512), 200)).toBeCloseTo(200, 9);
    expect(footM(flank(45, 120), 200)).toBe(120);
    expect(footM(flank(0, 120), 200)).toBe(120);
    expect(footM(flank(null, 120), 200)).toBe(120);
    expect(flankShare(flank(45, 512), 200, 100)).toBeCloseTo(0.5, 9);
    expect(flankShare(flank(45, 512), 200, 500)).toBeCloseTo(0, 9);
  });

  it("is the solver's flank: straight at the prescribed slope, round at a concave foot or a convex shoulder", () => {
    const at = (shape: Flank["shape"], t: number) => 200 * flankShare(flank(45, 512, shape), 200, t);
    expect([0, 100, 200, 300].map((t) => at("straight", t))).toEqual([200, 100, 0, 0].map((z) => expect.closeTo(z, 9)));
    // Concave: straight down to half the height, then a parabola that ends level at 1.5 times the straight run.
    expect([50, 100, 200, 300].map((t) => at("concave", t))).toEqual(
      [150, 100, 25, 0].map((z) => expect.closeTo(z, 9)),
    );
    expect([100, 200, 300].map((t) => at("convex", t))).toEqual([175, 100, 0].map((z) => expect.closeTo(z, 9)));
    expect(footM(flank(45, 512, "concave"), 200)).toBeCloseTo(300, 9);
    expect(footM(flank(45, 512, "convex"), 200)).toBeCloseTo(300, 9);
  });

  it("finds the slope of the flank through any of its points", () => {
    fc.assert(
      fc.property(
        fc.constantFrom<Flank["shape"]>("straight", "concave", "convex"),
        fc.double({ min: 5, max: 80, noNaN: true }),
        fc.double({ min: 0.05, max: 0.95, noNaN: true }),
        (shape, slope, part) => {
          const f = flank(slope, 1e6, shape);
          const t = part * footM(f, 200);
          expect(slopeThrough(f, 200, t, flankShare(f, 200, t))).toBeCloseTo(slope, 6);
        },
      ),
    );
  });

  it("stays inside its box for every cross-section, with finite numbers", () => {
    fc.assert(
      fc.property(anySection, (section) => {
        const frame = fitFrame(section, 268, 124);
        expect(Object.values(outline(section, frame)).join()).not.toMatch(/NaN|Infinity/);
        for (const k of knobs(section, frame)) {
          expect(k.x).toBeGreaterThanOrEqual(0);
          expect(k.x).toBeLessThanOrEqual(268);
          expect(k.y).toBeGreaterThanOrEqual(0);
          expect(k.y).toBeLessThanOrEqual(124);
        }
      }),
    );
  });

  it("shows what is prescribed apart from what is left free", () => {
    const numbers = (path: string) =>
      [...path.matchAll(/[ML]([-\d.]+) ([-\d.]+)/g)].map((m) => [Number(m[1]), Number(m[2])]);
    const steep: Section = { left: flank(35, 512), right: null, plateauRadiusM: 0, reliefM: 900 };
    const frame = fitFrame(steep, 268, 124);
    const firm = numbers(outline(steep, frame).firm);
    const end = 900 - 512 * Math.tan((35 * Math.PI) / 180);
    expect(firm[0]![0]).toBeCloseTo(frame.centreX - 512 * frame.pxPerM, 0);
    expect(firm[0]![1]).toBeCloseTo(frame.baseY - end * frame.pxPerM, 0);
    expect(firm.at(-1)).toEqual([frame.centreX, Number(frame.crestY.toFixed(1))]);
    const free = numbers(outline(steep, frame).free);
    expect(free.at(-1)![1]).toBeCloseTo(frame.baseY, 0);
    for (const [x] of free) expect(x).toBeLessThanOrEqual(268);
  });

  it("is as large as the profile allows; an extent outside it has its knob at the edge and says its true value", () => {
    const wide: Section = { ...ridge, left: flank(45, 2048), right: flank(45, 250) };
    const frame = fitFrame(wide, 268, 124);
    expect(frame.pxPerM).toBeCloseTo(fitFrame({ ...wide, left: flank(45, 320) }, 268, 124).pxPerM, 6);
    expect((frame.baseY - frame.crestY) / 124).toBeGreaterThan(0.5);
    const [left, right] = (["left-extent", "right-extent"] as const).map((id) => knob(wide, id));
    expect(left).toMatchObject({ x: 14, value: 2048, beyond: true });
    expect(right!.beyond).toBe(false);
    expect(right!.x).toBeCloseTo(frame.centreX + 270 * frame.pxPerM, 6);
  });

  it("shows the whole extent where it ends the flank before its slope does", () => {
    const cut: Section = { ...ridge, left: flank(20, 300), right: null };
    expect(knob(cut, "left-extent").beyond).toBe(false);
  });

  it("turns upside down for a crevice", () => {
    const frame = fitFrame({ ...ridge, reliefM: -200 }, 268, 124);
    expect(frame.crestY).toBeGreaterThan(frame.baseY);
  });

  it("has no knobs for a side without a flank and no slope knob for a free slope", () => {
    const section: Section = { ...ridge, left: null, right: flank(null, 300) };
    expect(knobs(section, fitFrame(section, 268, 124)).map((k) => k.id)).toEqual(["right-extent", "plateau"]);
  });
});

describe("dragging", () => {
  const ids: KnobId[] = ["left-slope", "right-slope", "left-extent", "right-extent", "plateau"];

  it.each(ids)("%s dropped where it stands changes next to nothing", (id) => {
    const frame = fitFrame(ridge, 268, 124);
    const at = knob(ridge, id);
    const after = drag(ridge, frame, id, at, false, limits);
    const metre = 1 / frame.pxPerM;
    expect(Math.abs(after.plateauRadiusM - ridge.plateauRadiusM)).toBeLessThanOrEqual(metre);
    for (const side of ["left", "right"] as const) {
      expect(Math.abs(after[side]!.extent_m - ridge[side]!.extent_m)).toBeLessThanOrEqual(metre);
      expect(Math.abs(after[side]!.slope_deg! - ridge[side]!.slope_deg!)).toBeLessThanOrEqual(1);
    }
  });

  it("an extent knob follows the pointer and moves only its side", () => {
    const frame = fitFrame(ridge, 268, 124);
    const after = drag(ridge, frame, "left-extent", { x: frame.centreX - 220 * frame.pxPerM, y: 0 }, false, limits);
    expect(after.left!.extent_m).toBeCloseTo(200, 0);
    expect(after.right).toEqual(ridge.right);
  });

  it("an extent knob at the edge stays at its value there, follows inside and grows past it", () => {
    const wide: Section = { ...ridge, left: flank(45, 1500), right: flank(45, 250) };
    const frame = fitFrame(wide, 268, 124);
    const to = (section: Section, x: number) => drag(section, frame, "left-extent", { x, y: 0 }, false, limits);
    const edge = knob(wide, "left-extent").x;
    expect(to(wide, edge)).toEqual(wide);
    expect(to(wide, edge - 3).left!.extent_m).toBe(1500);
    const inside = to(wide, frame.centreX - 220 * frame.pxPerM);
    expect(inside.left!.extent_m).toBeCloseTo(200, 0);
    const edgeM = (frame.centreX - edge) / frame.pxPerM - 20;
    expect(to(inside, edge - 16).left!.extent_m).toBeCloseTo(2 * edgeM, -1);
    expect(to(inside, edge - 400).left!.extent_m).toBe(limits.maxExtentM);
    expect(nudge(wide, frame, "left-extent", -1, false, limits).left!.extent_m).toBeLessThanOrEqual(1470);
  });

  it("linked sides change together, each keeping what was not touched", () => {
    const frame = fitFrame(ridge, 268, 124);
    const after = drag(ridge, frame, "left-extent", { x: frame.centreX - 220 * frame.pxPerM, y: 0 }, true, limits);
    expect(after.right!.extent_m).toBe(after.left!.extent_m);
    expect(after.right!.slope_deg).toBe(30);
  });

  it("stays within the limits wherever the pointer goes", () => {
    fc.assert(
      fc.property(
        anySection,
        fc.constantFrom(...ids),
        fc.double({ min: -5000, max: 5000, noNaN: true }),
        fc.double({ min: -5000, max: 5000, noNaN: true }),
        fc.boolean(),
        (section, id, x, y, linked) => {
          const after = drag(section, fitFrame(section, 268, 124), id, { x, y }, linked, limits);
          if (id === "plateau") {
            expect(after.plateauRadiusM).toBeGreaterThanOrEqual(0);
            expect(after.plateauRadiusM).toBeLessThanOrEqual(limits.maxPlateauM);
            return;
          }
          const side = after[id.startsWith("left") ? "left" : "right"];
          if (!side) return;
          if (id.endsWith("extent")) {
            expect(side.extent_m).toBeGreaterThan(0);
            expect(side.extent_m).toBeLessThanOrEqual(limits.maxExtentM);
          } else {
            expect(side.slope_deg).toBeGreaterThanOrEqual(1);
            expect(side.slope_deg).toBeLessThanOrEqual(MAX_SLOPE_DEG);
          }
        },
      ),
    );
  });

  it("an arrow key changes a slope by a degree and stops at the limits", () => {
    const frame = fitFrame(ridge, 268, 124);
    expect(nudge(ridge, frame, "left-slope", 1, false, limits).left!.slope_deg).toBe(46);
    expect(nudge(ridge, frame, "left-slope", 999, false, limits).left!.slope_deg).toBe(MAX_SLOPE_DEG);
    expect(nudge(ridge, frame, "plateau", -999, false, limits).plateauRadiusM).toBe(0);
    expect(nudge(ridge, frame, "right-extent", 1, true, limits).left!.extent_m).toBeGreaterThan(300);
  });
});

describe("presets", () => {
  it.each(PRESETS.map((p) => p.id))("%s is valid for every size of terrain", (id) => {
    const preset = PRESETS.find((p) => p.id === id)!;
    for (const size of [MIN_SIZE_M, 4096, MAX_SIZE_M]) {
      const { left, right, plateau_radius_m } = preset.section(size);
      expect(plateau_radius_m).toBeGreaterThanOrEqual(0);
      for (const side of [left, right]) {
        expect(side!.extent_m).toBeGreaterThan(0);
        expect(side!.extent_m).toBeLessThanOrEqual(size / 2);
        expect(side!.slope_deg).toBeGreaterThanOrEqual(0);
        expect(side!.slope_deg).toBeLessThanOrEqual(MAX_SLOPE_DEG);
      }
    }
  });

  it("come with those that suit the stroke first, and all of them", () => {
    expect(presetsFor("down")[0]!.sense).toBe("down");
    expect(presetsFor("up")[0]!.sense).toBe("up");
    expect(new Set(presetsFor("down"))).toEqual(new Set(PRESETS));
  });
});

describe("symmetric", () => {
  it("compares what both sides say", () => {
    expect(symmetric({ left: flank(30, 100), right: flank(30, 100) })).toBe(true);
    expect(symmetric({ left: flank(30, 100), right: flank(31, 100) })).toBe(false);
    expect(symmetric({ left: null, right: null })).toBe(true);
    expect(symmetric({ left: null, right: flank(30, 100) })).toBe(false);
  });
});
