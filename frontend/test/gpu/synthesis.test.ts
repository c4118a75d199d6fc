/** What the host tells the synthesis (SPEC R18, R26, R29). */

import synthSite from "@shaders/wgsl/synthesis/site.wgsl?raw";
import { describe, expect, it } from "vitest";
import vectors from "../../../tests/vectors/synthesis.json";
import type { ChannelGrid, ChannelView } from "../../src/core/types.ts";
import { structLayout } from "../../src/gpu/layout.ts";
import { channelWords, NO_CHANNELS } from "../../src/gpu/synthesis/channels.ts";
import { SITE_BYTES, type SynthesisSettings, sameSettings, siteWords } from "../../src/gpu/synthesis/site.ts";
import { mixBits } from "../../src/tiles/detail/noise.ts";

const SETTINGS: SynthesisSettings = {
  sizeM: 4096,
  seed: 7,
  detail: 2,
  rule: "landscape",
  look: "natural",
  seaLevelM: -12,
  solved: 4,
  cyclic: true,
};

const grid = (side: number, at: (row: number, col: number) => number): ChannelGrid => ({
  side,
  values: Float32Array.from({ length: side * side }, (_, i) => at(Math.floor(i / side), i % side)),
});

const flat = (value: number, side = 3): ChannelGrid => grid(side, () => value);

function view(change: Partial<ChannelView> = {}): ChannelView {
  const none = flat(0);
  const base = {
    amplitude: none,
    roughness: flat(0.5),
    snow: none,
    grass: none,
    forest: none,
    wetness: none,
    survey: flat(-1),
    erosion: none,
    far: flat(1),
  };
  return { stamp: 1, ...base, ...change };
}

describe("siteWords", () => {
  it("R18: lies where the shader's struct says", () => {
    const head = synthSite.replace(/\s*levels: array<SynthLevel, 18>,/, "");
    const layout = structLayout(head, "SynthSite");
    const words = siteWords(SETTINGS, { ...NO_CHANNELS, bits: 6, varied: true, surveyed: true });
    const floats = new Float32Array(words.buffer);
    const at = (field: string): number => layout.offsets[field]! / 4;
    expect(floats[at("size")]).toBe(4096);
    expect(floats[at("amplitude")]).toBeGreaterThan(0);
    expect(floats[at("sea")]).toBe(-12);
    expect(floats[at("has_sea")]).toBe(1);
    expect(floats[at("tree_line")]).toBeCloseTo(0.085);
    expect([words[at("solved")], words[at("cyclic")], words[at("channel_bits")]]).toEqual([4, 1, 6]);
    expect([words[at("varied")], words[at("biased")], words[at("surveyed")]]).toEqual([1, 0, 1]);
    const level = structLayout(synthSite, "SynthLevel");
    expect(words.byteLength).toBe(SITE_BYTES);
    expect(layout.size + 18 * level.size).toBe(SITE_BYTES);
    const third = (layout.size + 3 * level.size) / 4;
    expect(floats[third + level.offsets.inverse_spacing! / 4]).toBe(1 / 16);
    expect(floats[third + level.offsets.tie! / 4]).toBeGreaterThan(floats[third + 12 + level.offsets.tie! / 4]!);
  });

  it("R26: keys are where the hashes of the vectors start", () => {
    for (const { seed, level, stream, i, j, hash } of vectors.hashes) {
      const words = siteWords({ ...SETTINGS, seed }, NO_CHANNELS);
      const key = words[24 + 12 * level + stream]!;
      expect(mixBits((mixBits((key + j) >>> 0) + i) >>> 0)).toBe(hash);
    }
  });

  it("R29: settings that differ in anything are not the same", () => {
    expect(sameSettings(SETTINGS, { ...SETTINGS })).toBe(true);
    expect(sameSettings({ ...SETTINGS, cyclic: false }, { ...SETTINGS, cyclic: undefined as unknown as boolean })).toBe(
      true,
    );
    const others: Partial<SynthesisSettings>[] = [
      { sizeM: 8192 },
      { seed: 8 },
      { detail: 1 },
      { rule: "plain" },
      { look: "paper" },
      { seaLevelM: null },
      { solved: 3 },
      { cyclic: false },
    ];
    for (const other of others) expect(sameSettings(SETTINGS, { ...SETTINGS, ...other })).toBe(false);
  });
});

describe("channelWords", () => {
  it("R26: puts all channels on the finest grid, bilinear between the nodes of coarser ones", () => {
    const words = channelWords(view({ amplitude: grid(5, (r, c) => r * 10 + c), snow: grid(3, (r, c) => r - c) }));
    expect([words.bits, words.varied, words.biased]).toEqual([2, true, true]);
    const at = (row: number, col: number): number[] => [
      ...words.values.subarray(6 * (row * 5 + col), 6 * (row * 5 + col) + 6),
    ];
    expect(at(0, 0)).toEqual([0, 0.5, 0, 0, 0, 0]);
    expect(at(3, 1)).toEqual([31, 0.5, 1, 0, 0, 0]);
    expect(at(1, 4)).toEqual([14, 0.5, -1.5, 0, 0, 0]);
    expect(at(4, 4)).toEqual([44, 0.5, 0, 0, 0, 0]);
  });

  it("tells whether anything is asked for", () => {
    expect(channelWords(view())).toMatchObject({ varied: false, biased: false });
    expect(channelWords(view({ roughness: flat(0.75) }))).toMatchObject({ varied: false, biased: false });
    expect(channelWords(view({ roughness: grid(3, (r) => r) }))).toMatchObject({ varied: true, biased: false });
    expect(channelWords(view({ wetness: flat(1) }))).toMatchObject({ varied: true, biased: true });
  });

  it("R26: wide nodes hold survey, distance and paint of gullies too; without any of them nodes are narrow", () => {
    const words = channelWords(view({ survey: grid(3, (r, c) => 2 * r + c), roughness: grid(2, (r) => r) }));
    expect([words.bits, words.varied, words.biased, words.surveyed]).toEqual([1, true, false, true]);
    expect([...words.values.subarray(10 * 4, 10 * 5)]).toEqual([0, 0.5, 0, 0, 0, 0, 3, 1, 0, 0]);
    expect([words.stride, words.farCells, words.gullied]).toEqual([5, 2, false]);
    expect(channelWords(view())).toMatchObject({ surveyed: false, gullied: false, stride: 3 });
    expect(channelWords(view()).values.length).toBe(6 * 9);
    const worn = channelWords(view({ erosion: flat(0.5), far: grid(3, (r, c) => (r + c) / 4) }));
    expect([...worn.values.subarray(10 * 5, 10 * 6)]).toEqual([0, 0.5, 0, 0, 0, 0, -1, 0.75, 0.5, 0]);
    expect([worn.stride, worn.farCells, worn.gullied, worn.surveyed]).toEqual([5, 2, true, false]);
    expect(channelWords(view({ survey: flat(3) }))).toMatchObject({ varied: false, surveyed: true });
  });

  it("refuses grids that are no power of two", () => {
    expect(() => channelWords(view({ snow: flat(0, 4) }))).toThrow(RangeError);
  });
});
