// What the status line and the legend say (SPEC U18, U19).
// @vitest-environment happy-dom
import { describe, expect, it } from "vitest";
import { progressText } from "../../src/ui/bars/status-line.ts";
import { amplitudeEnds } from "../../src/ui/panels/legend.ts";

const progress = {
  type: "progress",
  clock: 3,
  level: 2,
  of: 4,
  settled: false,
  note: "",
  refining: 0,
  laying: false,
} as const;

describe("progressText", () => {
  it("U18: says the level, then what is left to refine, then that all is final", () => {
    expect(progressText(null, 4)).toBe("Waiting for the ground: 5 levels of detail");
    expect(progressText(progress, 4)).toBe("Settling: level 2 of 4");
    expect(progressText({ ...progress, settled: true, refining: 12 }, 4)).toBe(
      "Refining 12 tiles where somebody looks closely",
    );
    expect(progressText({ ...progress, settled: true, refining: 1 }, 4)).toContain("1 tile ");
    expect(progressText({ ...progress, settled: true }, 4)).toBe("Settled: all 5 levels of detail are final");
    // While the ground moves nothing is refined, whatever is still counted.
    expect(progressText({ ...progress, refining: 12 }, 4)).toBe("Settling: level 2 of 4");
  });
});

describe("amplitudeEnds", () => {
  it("names the greatest amplitude, or that there is none", () => {
    expect(amplitudeEnds(42.4)).toEqual(["0", "42 m"]);
    expect(amplitudeEnds(0)).toEqual(["0", "none yet"]);
  });
});
