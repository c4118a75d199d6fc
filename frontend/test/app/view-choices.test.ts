// Choices of the device (SPEC N20, N27, N32, U635).
import { describe, expect, it } from "vitest";
import { ViewChoices } from "../../src/app/device/view-choices.ts";
import { headingDeg } from "../../src/ui/bars/compass.ts";

function memory(kept: Record<string, string> = {}) {
  return {
    getItem: (key: string) => kept[key] ?? null,
    setItem: (key: string, value: string) => {
      kept[key] = value;
    },
    removeItem: (key: string) => {
      delete kept[key];
    },
  };
}

describe("how this device shows terrains", () => {
  it("is remembered by the device", () => {
    const store = memory();
    const one = new ViewChoices(store);
    expect([one.exaggeration, one.contourM, one.projector, one.lineScale]).toEqual([1, 0, false, 1]);
    one.choose({ exaggeration: 2.5, contourM: 20 });
    one.choose({ projector: true });
    const two = new ViewChoices(store);
    expect([two.exaggeration, two.contourM, two.projector]).toEqual([2.5, 20, true]);
    expect(two.lineScale).toBeGreaterThan(1);
  });

  it("is bounded, whatever was kept or typed", () => {
    for (const text of ["{", "null", "7", '{"exaggeration":"x","contourM":3,"projector":1}', '{"exaggeration":-4}']) {
      const found = new ViewChoices(memory({ "esker.view": text }));
      expect([found.exaggeration, found.contourM, found.projector]).toEqual([1, 0, false]);
    }
    const choices = new ViewChoices(memory());
    choices.choose({ exaggeration: 1e9 });
    expect(choices.exaggeration).toBe(5);
    choices.choose({ exaggeration: Number.NaN });
    expect(choices.exaggeration).toBe(1);
  });

  it("U635: of the ground and of lines is remembered, and left to the adapter where nobody chose", () => {
    const store = memory();
    const one = new ViewChoices(store);
    expect(one.surface).toEqual({ materials: null, shade: true, instances: null });
    expect(one.quietLines).toBe(true);
    one.choose({ instances: false, materials: true });
    one.choose({ shade: false, quietLines: false });
    const two = new ViewChoices(store);
    expect(two.surface).toEqual({ materials: true, shade: false, instances: false });
    expect(two.quietLines).toBe(false);
    const damaged = new ViewChoices(
      memory({ "esker.view": '{"materials":1,"instances":"no","shade":0,"quietLines":7}' }),
    );
    expect(damaged.surface).toEqual({ materials: null, shade: true, instances: null });
    expect(damaged.quietLines).toBe(true);
  });

  it("holds for the page where the device keeps nothing", () => {
    const choices = new ViewChoices({
      ...memory(),
      setItem: () => {
        throw new Error("full");
      },
    });
    choices.choose({ projector: true });
    expect(choices.projector).toBe(true);
  });
});

describe("the compass (SPEC N31)", () => {
  it("says where the view looks", () => {
    const state = { eye: [0, 0, 10], target: [10, 0, 0], up: [0, 0, 1], mode: "orbit" } as never;
    expect(headingDeg(state)).toBeCloseTo(90, 9);
    expect(headingDeg({ ...(state as object), mode: "map", up: [0, 1, 0] } as never)).toBeCloseTo(0, 9);
    expect(headingDeg({ ...(state as object), target: [-1, -1, 0] } as never)).toBeCloseTo(225, 9);
  });
});
