// Where a sea comes, and how far it may be moved (SPEC P).
import { describe, expect, it } from "vitest";
import { seaSpan, seaStart } from "../../src/app/view/sea.ts";

const land = (height: (i: number) => number): Float32Array =>
  Float32Array.from({ length: 65 * 65 }, (_, i) => height(i));

describe("a new sea", () => {
  it("lies below a plain, not in it", () => {
    expect(
      seaStart(
        land(() => 0),
        4096,
      ),
    ).toBe(-8);
    expect(
      seaStart(
        land((i) => (i < 900 ? -80 : i < 1000 ? 300 : 0)),
        4096,
      ),
    ).toBe(-8);
    expect(seaStart(new Float32Array(0), 4096)).toBe(-8);
  });

  it("is the real one where real land falls to it", () => {
    expect(
      seaStart(
        land((i) => i / 4),
        8192,
      ),
    ).toBe(0);
  });

  it("is seen on land that lies high, and can be moved over all of it", () => {
    const high = land((i) => 1600 + i / 2);
    const [low, top] = [1600, 1600 + (65 * 65 - 1) / 2];
    const start = seaStart(high, 8192);
    expect(start).toBeGreaterThan(low);
    expect(start).toBeLessThan((low + top) / 2);
    expect(seaSpan(high, 8192)).toEqual([-1024, 3712]);
    expect(
      seaSpan(
        land(() => 0),
        4096,
      ),
    ).toEqual([-512, 512]);
  });
});
