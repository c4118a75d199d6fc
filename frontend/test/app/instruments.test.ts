// The section and the figures follow the ground (SPEC N1, N3, N8, N11, N14).
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Instruments, SINCE_BEGAN } from "../../src/app/view/instruments/instruments.ts";
import { chartOf, numberWords, ticks } from "../../src/app/view/instruments/profile-chart.ts";
import { profileCsv, profileSvg } from "../../src/app/view/instruments/profile-files.ts";
import { areaWords, lengthWords, slopeWords, volumeWords } from "../../src/app/view/instruments/words.ts";
import type { AreaFigures } from "../../src/core/measure/area.ts";
import { type Profile, profileOf } from "../../src/core/measure/profile.ts";
import { Ruler } from "../../src/input/tools/ruler.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { all, frame, SIZE_M } from "../tiles/frames.ts";

let tiles: TileStore;
let ruler: Ruler;
let instruments: Instruments;
const show = (version: number, height: (x: number, y: number) => number): void => {
  tiles.apply(frame("LEVEL", 0, all(0, version, height)));
  vi.advanceTimersByTime(1000);
};

beforeEach(() => {
  vi.useFakeTimers();
  tiles = new TileStore(SIZE_M, 0);
  tiles.apply(
    frame(
      "LEVEL",
      0,
      all(0, 1, () => 10),
    ),
  );
  ruler = new Ruler();
  instruments = new Instruments(ruler, tiles);
});
afterEach(() => {
  instruments.dispose();
  vi.useRealTimers();
});

describe("instruments", () => {
  it("show the section of the ground as it is now, while others draw (SPEC N3)", () => {
    ruler.open("line");
    ruler.add([0, 500]);
    expect(instruments.profile.value).toHaveProperty("problem");
    ruler.add([1000, 500]);
    const flat = instruments.profile.value as Profile;
    expect([flat.min.m, flat.max.m].map(Math.round)).toEqual([10, 10]);
    expect(flat.gainM).toBe(0);
    expect(instruments.beforeHeights.value).toBeNull();
    show(2, (x) => 10 + x / 10);
    const sloped = instruments.profile.value as Profile;
    expect(sloped.gainM).toBeCloseTo(100, 1);
    expect(sloped.overall).toBeCloseTo(0.1, 3);
    // The dashed line: the ground when measuring began.
    expect([...instruments.beforeHeights.value!].every((z) => Math.round(z) === 10)).toBe(true);
    expect(instruments.before.value!.words).toBe(SINCE_BEGAN);
  });

  it("sum what was heaped up and dug out since a moment (SPEC N11)", () => {
    ruler.open("area");
    for (const p of [
      [125, 125],
      [875, 125],
      [875, 875],
      [125, 875],
    ] as const)
      ruler.add(p);
    show(2, (x) => (x < 500 ? 12 : 9));
    let found = instruments.area.value as AreaFigures;
    // Between the two there is one cell of 15.6 m in which the ground goes from one to the other.
    expect(Math.abs(found.risenM3! / (2 * 375 * 750) - 1)).toBeLessThan(0.05);
    expect(Math.abs(found.sunkenM3! / (1 * 375 * 750) - 1)).toBeLessThan(0.05);
    instruments.keep("since step 7 of the history");
    found = instruments.area.value as AreaFigures;
    expect([found.risenM3, found.sunkenM3]).toEqual([0, 0]);
    instruments.levelM.value = 5;
    expect((instruments.area.value as AreaFigures).belowM3).toBe(0);
    expect((instruments.area.value as AreaFigures).aboveM3).toBeGreaterThan(4 * 750 * 750);
  });

  it("show the line on the ground, and the place under a pointer on the section", () => {
    ruler.open("line");
    ruler.add([0, 500]);
    ruler.add([1000, 500]);
    show(2, (x) => x / 10);
    expect(instruments.lines.value).toHaveLength(1);
    instruments.marker.value = 500;
    expect(instruments.marked.value!.map((v) => Math.round(v))).toEqual([500, 500, 50]);
    ruler.close();
    expect(instruments.lines.value).toEqual([]);
    expect(instruments.profile.value).toBeNull();
    expect(instruments.before.value).toBeNull();
  });
});

const hill = profileOf(
  [
    [0, 0],
    [1000, 0],
    [2000, 0],
  ],
  (x) => 100 + 80 * Math.exp(-(((x - 900) / 250) ** 2)),
  10,
) as Profile;

describe("the section as a drawing (SPEC N14)", () => {
  it("has ground, axes and ticks inside its box, and the exaggeration that is asked for", () => {
    for (const exaggeration of [0, 1, 2, 5, 10, 20]) {
      const chart = chartOf(hill, { width: 600, height: 180, exaggeration });
      if (exaggeration > 0) expect(chart.exaggeration).toBeCloseTo(exaggeration, 9);
      for (const t of chart.distances) expect(t.at).toBeLessThanOrEqual(chart.right + 1e-6);
      for (const t of chart.heights) {
        expect(t.at).toBeGreaterThanOrEqual(chart.top - 1e-6);
        expect(t.at).toBeLessThanOrEqual(chart.bottom + 1e-6);
      }
      for (const z of hill.height) expect(chart.yOf(z)).toBeGreaterThanOrEqual(chart.top - 1e-6);
      expect(chart.distances.length).toBeGreaterThan(0);
      expect(chart.distanceAt(chart.xOf(700))).toBeCloseTo(700, 6);
      const metre = chart.xOf(1) - chart.xOf(0);
      expect((chart.yOf(0) - chart.yOf(1)) / metre).toBeCloseTo(chart.exaggeration, 6);
    }
    expect(chartOf(hill, { width: 600, height: 180 }).corners).toHaveLength(3);
  });

  it("stays a line on flat ground", () => {
    const flat = profileOf([[0, 0], [100, 0]], () => 5, 1) as Profile; // biome-ignore format: one line
    const chart = chartOf(flat, { width: 400, height: 120 });
    expect(Number.isFinite(chart.exaggeration)).toBe(true);
    expect(chart.line).not.toContain("NaN");
  });

  it("has round ticks", () => {
    expect(ticks(0, 1000, 6, 1)).toEqual([0, 200, 400, 600, 800, 1000]);
    expect(ticks(-3, 12, 4, 1)).toEqual([0, 5, 10]);
    expect(ticks(0, 0, 5, 1)).toEqual([]);
    expect(numberWords(-0.5)).toBe("−0.5");
    expect(numberWords(-0.0001)).toBe("0");
  });
});

describe("the section as files (SPEC N15)", () => {
  it("is numbers, a row a sample", () => {
    const rows = profileCsv(hill, null).trim().split("\r\n");
    expect(rows[0]).toBe("distance_m,x_m,y_m,height_m");
    expect(rows).toHaveLength(hill.distance.length + 1);
    expect(rows[1]!.split(",").map(Number)[3]).toBeCloseTo(hill.height[0]!, 3);
    expect(profileCsv(hill, hill.height).split("\r\n")[0]).toContain("before_m");
  });

  it("is a drawing that says its title safely", () => {
    const svg = profileSvg(hill, 'A <b> & "c"', { exaggeration: 2, before: hill.height });
    expect(svg).toContain("A &lt;b&gt; &amp; &quot;c&quot;");
    expect(svg).not.toContain("NaN");
    expect(svg).toContain("heights × 2.0");
    expect(svg.match(/<path /g)!.length).toBeGreaterThan(4);
  });
});

describe("words of measures (SPEC N16)", () => {
  it("have units and as many digits as help", () => {
    expect([lengthWords(12.34), lengthWords(1234.5), lengthWords(12_345)]).toEqual(["12.3 m", "1 235 m", "12.35 km"]);
    expect([areaWords(950), areaWords(25_000), areaWords(2_500_000)]).toEqual(["950 m²", "2.50 ha", "2.50 km²"]);
    expect([volumeWords(12), volumeWords(2.5e6), volumeWords(3e9)]).toEqual([
      "12.0 m³",
      "2.50 million m³",
      "3.000 km³",
    ]);
    expect(slopeWords(1)).toBe("45.0° (100 %)");
    expect(slopeWords(-0.05)).toBe("−2.9° (−5.0 %)");
  });
});
