/** Amplitude and roughness on the page (SPEC R23). */

import { describe, expect, it } from "vitest";
import type { ChannelGrid, DecodedFrame, Scene } from "../../src/core/types.ts";
import {
  AMPLITUDE_QUANTA_PER_M,
  BIAS_QUANTA,
  Channel,
  FrameKind,
  ROUGHNESS_QUANTA,
} from "../../src/generated/contract.ts";
import { channelTexels, overlayGrid } from "../../src/gpu/atlas/channeltexture.ts";
import { detailColour, paintedColour } from "../../src/gpu/map/detail.ts";
import { ChannelStore } from "../../src/tiles/detail/channels.ts";

const SIZE = 1000;

/** A whole level of a channel whose samples are a function of column and row of the level. */
function level(
  channel: number,
  at: number,
  sample: (col: number, row: number) => number,
  drops: { x: number; y: number }[] = [],
  have: (x: number, y: number) => boolean = () => true,
): DecodedFrame {
  const tiles = [];
  for (let y = 0; y < 1 << at; y += 1) {
    for (let x = 0; x < 1 << at; x += 1) {
      if (!have(x, y)) continue;
      const samples = new Int32Array(65 * 65);
      for (let r = 0; r < 65; r += 1)
        for (let c = 0; c < 65; c += 1) samples[r * 65 + c] = Math.round(sample(64 * x + c, 64 * y + r));
      const none = new Int32Array(16);
      tiles.push({ x, y, version: 1, samples, subMin: none, subMax: none, subError: new Uint32Array(16) });
    }
  }
  return { kind: FrameKind.LEVEL, level: at, channel, clock: 1, settled: true, drops, tiles, bytes: 1 };
}

describe("ChannelStore", () => {
  it("R23: says the base values before anything has come", () => {
    const store = new ChannelStore(SIZE);
    expect(store.amplitudeAt(300, 400)).toBe(0);
    expect(store.roughnessAt(300, 400)).toBe(0.5);
  });

  it("R23: gives metres and shares, bilinear between samples, the border's value outside", () => {
    const store = new ChannelStore(SIZE);
    store.apply(level(Channel.AMPLITUDE, 0, (c) => 4 * AMPLITUDE_QUANTA_PER_M * (c / 64)));
    store.apply(level(Channel.ROUGHNESS, 0, (_, r) => ROUGHNESS_QUANTA * (r / 64 - 0.5)));
    expect(store.amplitudeAt(500, 123)).toBeCloseTo(2, 2);
    expect(store.amplitudeAt(507.8, 123)).toBeCloseTo(4 * 0.5078, 2);
    expect(store.roughnessAt(1, 750)).toBeCloseTo(0.75, 2);
    expect(store.amplitudeAt(-50, 9)).toBe(0);
    expect(store.amplitudeAt(5000, 9)).toBe(4);
  });

  it("R23: shows the finest complete level of each channel; heights are none of its business", () => {
    const store = new ChannelStore(SIZE);
    store.apply(level(Channel.AMPLITUDE, 0, () => 64));
    expect(store.stamp).toBe(1);
    store.apply(level(Channel.HEIGHT, 0, () => 9999));
    expect(store.stamp).toBe(1);
    store.apply(
      level(
        Channel.AMPLITUDE,
        1,
        () => 128,
        [],
        (x, y) => x + y < 2,
      ),
    );
    expect(store.amplitude.side).toBe(65);
    expect(store.amplitudeAt(100, 100)).toBe(1);
    store.apply(
      level(
        Channel.AMPLITUDE,
        1,
        () => 128,
        [],
        (x, y) => x + y === 2,
      ),
    );
    expect(store.amplitude.side).toBe(129);
    expect(store.amplitudeAt(100, 100)).toBe(2);
    expect(store.roughness.side).toBe(2);
    store.apply({
      ...level(
        Channel.AMPLITUDE,
        1,
        () => 0,
        [{ x: 1, y: 0 }],
        () => false,
      ),
    });
    expect(store.amplitude.side).toBe(65);
  });

  it("R23: a new connection's first frame replaces everything", () => {
    const store = new ChannelStore(SIZE);
    store.apply(level(Channel.AMPLITUDE, 0, () => 64));
    store.apply(level(Channel.AMPLITUDE, 1, () => 64));
    store.restart();
    expect(store.amplitudeAt(5, 5)).toBe(1);
    store.apply(level(Channel.ROUGHNESS, 0, () => 0));
    expect(store.amplitudeAt(5, 5)).toBe(0);
  });

  it("R23: what a new connection does not bring goes when its ground is here", () => {
    const store = new ChannelStore(SIZE);
    store.apply(level(Channel.SNOW, 0, () => BIAS_QUANTA));
    store.renewed();
    expect(store.snow.values[0]).toBe(1);
    store.restart();
    store.renewed();
    expect(store.snow.side).toBe(2);
    store.apply(level(Channel.SNOW, 0, () => BIAS_QUANTA));
    store.renewed();
    expect(store.snow.values[0]).toBe(1);
  });

  it("R23: only what is shown counts: a coarse level under a fine one changes nothing, nor another channel's grid", () => {
    const store = new ChannelStore(SIZE);
    store.apply(level(Channel.SNOW, 0, () => 0));
    store.apply(level(Channel.SNOW, 1, () => 0));
    store.apply(level(Channel.GRASS, 0, () => 0));
    const [stamp, snow, grass] = [store.stamp, store.snow, store.grass];
    store.apply(level(Channel.SNOW, 0, () => BIAS_QUANTA));
    expect(store.stamp).toBe(stamp);
    expect(store.snow).toBe(snow);
    store.apply(level(Channel.SNOW, 1, () => BIAS_QUANTA));
    expect(store.stamp).toBe(stamp + 1);
    expect(store.snow.values[5]).toBe(1);
    expect(store.grass).toBe(grass);
  });

  it("R23: paint comes like the others, -1 to 1, and is nothing where nobody painted", () => {
    const store = new ChannelStore(SIZE);
    for (const grid of [store.snow, store.grass, store.forest, store.wetness])
      expect([...grid.values]).toEqual([0, 0, 0, 0]);
    store.apply(level(Channel.SNOW, 0, () => BIAS_QUANTA));
    store.apply(level(Channel.FOREST, 0, () => -BIAS_QUANTA / 2));
    store.apply(level(Channel.WETNESS, 0, (c) => (c * BIAS_QUANTA) / 64));
    expect(store.snow.values[100]).toBe(1);
    expect(store.forest.values[100]).toBe(-0.5);
    expect(store.wetness.values[64]).toBe(1);
    expect(store.grass.values[0]).toBe(0);
    expect(store.roughness.values[0]).toBe(0.5);
  });
});

describe("overlayGrid", () => {
  const store = new ChannelStore(SIZE);
  const scene = (overlay: Scene["overlay"], influence: ChannelGrid | null = null): Scene =>
    ({ overlay, influence, channels: store }) as unknown as Scene;

  it("is what the overlay shows: a painted channel about a half, the influence as it is, else nothing", () => {
    const painted = { stamp: 1, snow: { side: 2, values: new Float32Array([-1, 0, 0.5, 1]) } };
    const shares = overlayGrid({ overlay: "snow", channels: painted } as unknown as Scene)!;
    expect([...shares.values]).toEqual([0, 0.5, 0.75, 1]);
    expect(overlayGrid({ overlay: "snow", channels: painted } as unknown as Scene)).toBe(shares);
    expect([...overlayGrid(scene("wetness"))!.values]).toEqual([0.5, 0.5, 0.5, 0.5]);
    const felt = { side: 2, values: new Float32Array(4) };
    expect(overlayGrid(scene("influence", felt))).toBe(felt);
    expect(overlayGrid(scene("snow", felt))).not.toBe(felt);
    for (const overlay of ["none", "contours", "slope", "detail", "patches"] as const)
      expect(overlayGrid(scene(overlay, felt))).toBeNull();
  });

  it("is brown for less, blue for more and grey where nothing is painted, on the map too", () => {
    const [less, none, more] = [0, 0.5, 1].map(paintedColour);
    expect(less![0]).toBeGreaterThan(less![2]);
    expect(more![2]).toBeGreaterThan(more![0]);
    expect(Math.max(...none!) - Math.min(...none!)).toBe(0);
  });
});

describe("channelTexels", () => {
  it("R23: amplitude in parts of the greatest, roughness whole, on the finer grid", () => {
    const store = new ChannelStore(SIZE);
    store.apply(level(Channel.AMPLITUDE, 0, (c) => 6 * AMPLITUDE_QUANTA_PER_M * (c / 64)));
    const { bytes, side, fullScale } = channelTexels(store);
    expect([side, fullScale]).toEqual([65, 6]);
    expect([bytes[0], bytes[4 * 64], bytes[4 * 32]]).toEqual([0, 255, 128]);
    expect(bytes[1]).toBe(128);
  });

  it("R23: nothing asked for is amplitude 0, whatever the scale", () => {
    expect([...channelTexels(new ChannelStore(SIZE)).bytes]).toEqual(
      Array.from({ length: 4 }, () => [0, 128, 0, 255]).flat(),
    );
  });
});

describe("detailColour", () => {
  it("R23: hue goes with roughness, strength with amplitude", () => {
    const strength = ([r, g, b]: readonly number[]): number => Math.max(r!, g!, b!) - Math.min(r!, g!, b!);
    expect(strength(detailColour(1, 0))).toBeGreaterThan(3 * strength(detailColour(0, 0)));
    const [smooth, rough] = [detailColour(1, 0), detailColour(1, 1)];
    expect(smooth[2]).toBeGreaterThan(smooth[0]);
    expect(rough[0]).toBeGreaterThan(rough[2]);
  });
});
