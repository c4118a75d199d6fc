/** The bound grows until what a view needs fits the atlas, and a picture at rest is reached (SPEC R57). */

import { beforeAll, describe, expect, it } from "vitest";
import { Atlas } from "../../src/gpu/atlas/atlas.ts";
import { Fit } from "../../src/gpu/atlas/fit.ts";
import { Selection } from "../../src/tiles/patches/selection.ts";
import { FieldView, filteredField, lookAt } from "./world.ts";

beforeAll(() => {
  const flags = new Proxy({}, { get: () => 1 });
  Object.assign(globalThis, { GPUTextureUsage: flags, GPUBufferUsage: flags });
});

const device = {
  limits: { maxStorageBufferBindingSize: 2 ** 27 },
  createTexture: () => ({ destroy() {} }),
  createBuffer: () => ({ destroy() {} }),
  queue: { writeBuffer() {} },
} as unknown as GPUDevice;

describe("a view that needs more tiles than there are slots", () => {
  const view = new FieldView(4096, 4, filteredField(7, 300));
  const camera = lookAt([200, 200, 700], [1800, 1800, 100], 1024, 768, 50, 2, 20_000);
  const tau = 0.3;

  /** Frames until nothing enters any more, and what the last cut needs. */
  function rest(slots: number, coarsen: boolean): { frames: number; lacking: number; factor: number; patches: number } {
    const selection = new Selection(view.levels);
    const atlas = new Atlas(device, (l, x, y, usable) => selection.tree.setUsable(l, x, y, usable), slots);
    const fit = new Fit();
    let needed = 0;
    for (let frames = 1; frames < 400; frames += 1) {
      atlas.refresh(view);
      fit.begin(frames === 1, needed, atlas.capacity);
      let entered = 0;
      for (;;) {
        const cut = selection.select(view, camera, tau * fit.factor, atlas);
        if (coarsen && fit.exceeded(cut.tiles, atlas.capacity)) continue;
        needed = cut.tiles;
        const more = atlas.admit(cut.requests, 16 - entered).length;
        entered += more;
        if (more > 0) continue;
        // Slots that a finer cut of this frame held are free in the next.
        const due = fit.eased || (cut.requests.length > 0 && (!atlas.full || cut.tiles <= atlas.capacity));
        if (entered === 0 && !due)
          return { frames, lacking: cut.requests.length, factor: fit.factor, patches: cut.count };
        break;
      }
    }
    throw new Error("never rests");
  }

  it("R57: comes to rest with all that it asks for, evenly coarser", () => {
    const roomy = rest(1024, true);
    expect(roomy.factor).toBe(1);
    expect(roomy.lacking).toBe(0);
    const tight = rest(230, true);
    expect(tight.factor).toBeGreaterThan(1);
    expect(tight.factor).toBeLessThan(8);
    expect(tight.lacking).toBe(0);
    expect(tight.patches).toBeLessThan(roomy.patches);
    expect(tight.patches).toBeGreaterThan(200);
  });

  it("R57: rests, with its finest levels left out, where the bound is held", () => {
    expect(rest(230, false).lacking).toBeGreaterThan(0);
  });

  it("R57: the bound comes down again to where there is room, at rest never to one that did not fit", () => {
    const fit = new Fit();
    while (fit.factor < 4) fit.exceeded(512, 512);
    const { factor } = fit;
    fit.begin(false, 100, 512);
    expect(fit.factor).toBe(factor);
    expect(fit.eased).toBe(false);
    fit.begin(true, 500, 512);
    expect(fit.factor).toBe(factor);
    // Another view: it eases frame by frame until one bound does not fit.
    let frames = 0;
    for (fit.begin(true, 100, 512); fit.eased; fit.begin(false, 100, 512)) {
      if (fit.factor < 2) fit.exceeded(512, 512);
      frames += 1;
      expect(frames).toBeLessThan(20);
    }
    expect(fit.factor).toBeGreaterThan(2);
    expect(fit.factor).toBeLessThan(2.4);
    for (fit.begin(true, 100, 512); fit.eased; fit.begin(false, 100, 512));
    expect(fit.factor).toBe(1);
  });
});
