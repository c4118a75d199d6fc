/** SPEC T40: the page's twin of the synthesis against the vectors of all languages. */

import { describe, expect, test } from "vitest";
import { TILE_CELLS } from "../../src/generated/contract.ts";
import { hashAt, rowStart, streamStart } from "../../src/tiles/detail/noise.ts";
import { detailOf, interpolated, type Samples, subdivide } from "../../src/tiles/detail/subdivide.ts";
import { areaOf, recipeOf, samplesOf, unpacked, vectors } from "./synthesis.ts";

/** Settings have no cyclic domains, so the page knows bounded ones only. */
const sites = new Map(
  vectors.sites.filter((s) => !s.cyclic).map((s) => [s.name, { recipe: recipeOf(s), sizeM: s.size_m }]),
);

function compare(found: Samples, guide: readonly number[], words: readonly number[], cellM: number, relief: boolean) {
  const wanted = unpacked(words);
  const close = (a: ArrayLike<number>, b: ArrayLike<number>, tolerance: number): void => {
    expect(a.length).toBe(b.length);
    let worst = 0;
    for (let k = 0; k < a.length; k++) worst = Math.max(worst, Math.abs(a[k]! - b[k]!));
    expect(worst).toBeLessThanOrEqual(tolerance);
  };
  const rounding = 2 ** -22 * Math.max(...guide.map(Math.abs));
  close(found.guide, guide.map(Math.fround), rounding);
  close(found.d, wanted.d, Math.max(vectors.metres * cellM, 1e-6));
  const unorm = (vectors.unorm + 0.5) / 65535;
  close(found.h, wanted.h, 2 * unorm);
  close(found.snow, wanted.snow, unorm);
  if (relief) expect([found.wet, found.grass, found.forest, found.foam].map((a) => a.length)).toEqual([0, 0, 0, 0]);
  else for (const name of ["wet", "grass", "forest", "foam"] as const) close(found[name], wanted[name], unorm);
}

describe("the noise", () => {
  test("has the bits of all languages", () => {
    for (const { seed, level, stream, i, j, hash } of vectors.hashes)
      expect(hashAt(rowStart(streamStart(seed, level, stream), j), i)).toBe(hash);
  });
});

describe.each([false, true])("with the relief alone: %s", (relief) => {
  test("one step of arbitrary samples", () => {
    let compared = 0;
    for (const step of vectors.steps) {
      const site = sites.get(step.site);
      if (site === undefined) continue;
      const parent = samplesOf(step.level - 1, step.parent);
      const found = subdivide(parent, areaOf(step.level, step.window), site.recipe, relief);
      compare(found, step.guide, step.state, site.sizeM / (TILE_CELLS * 2 ** step.level), relief);
      compared += 1;
    }
    expect(compared).toBeGreaterThan(5);
  });

  test("places on every level, from the root on", () => {
    let compared = 0;
    for (const place of vectors.places) {
      const site = sites.get(place.site);
      if (site === undefined) continue;
      const found = detailOf(areaOf(place.level, place.window), site.recipe, relief)!;
      compare(found, place.guide, place.state, site.sizeM / (TILE_CELLS * 2 ** place.level), relief);
      compared += 1;
    }
    expect(compared).toBeGreaterThan(100);
  });
});

describe("ground that was never solved", () => {
  test("keeps the parent's samples by the 4-point rule, and is a B-spline by the rule `smooth`", () => {
    const parent = areaOf(3, [0, 6, 0, 6]);
    const z = Float64Array.from({ length: 36 }, (_, k) => (k % 6) ** 2);
    const child = areaOf(4, [4, 5, 4, 7]);
    expect([...interpolated(z, parent, child)]).toEqual([4, 6.25, 9]);
    expect([...interpolated(z, parent, child, true)]).toEqual([4.25, 6.5, 9.25]);
  });
});
