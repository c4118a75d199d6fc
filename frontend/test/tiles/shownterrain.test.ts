/** SPEC T41, T42: the shown ground follows tiles, channels and settings, and makes anew only what they change. */

import { describe, expect, test } from "vitest";
import { Camera } from "../../src/core/camera/camera.ts";
import type { Ground } from "../../src/core/types.ts";
import { Channel, FrameKind } from "../../src/generated/contract.ts";
import { ChannelStore } from "../../src/tiles/detail/channels.ts";
import { DetailField } from "../../src/tiles/detail/detail.ts";
import { Memo } from "../../src/tiles/memo.ts";
import { heightsOfTiles } from "../../src/tiles/patches/guide.ts";
import type { RuleSettings } from "../../src/tiles/rules/rule.ts";
import type { ShownGround } from "../../src/tiles/shown.ts";
import { ShownTerrain } from "../../src/tiles/shownterrain.ts";
import { TileStore } from "../../src/tiles/store.ts";
import { frame, tileOf } from "./frames.ts";

const SIZE = 1024;
const peak = (x: number, y: number): number => 250 * Math.exp(-((x - 500) ** 2 + (y - 500) ** 2) / 30_000);
const SETTINGS: RuleSettings = {
  size_m: SIZE,
  seed: 3,
  sea_level_m: null,
  look: "natural",
  detail: 2,
  rule: "landscape",
};

function terrain(settings: () => RuleSettings | null = () => SETTINGS) {
  const tiles = new TileStore(SIZE, 5, 1);
  const channels = new ChannelStore(SIZE);
  const level = (l: number, height: (x: number, y: number) => number): void => {
    const n = 2 ** l;
    const all = Array.from({ length: n * n }, (_, k) => tileOf(l, k % n, Math.floor(k / n), 1, height, SIZE));
    tiles.apply(frame("LEVEL", l, all));
  };
  level(0, peak);
  level(1, peak);
  return { tiles, channels, level, shown: new ShownTerrain(tiles, channels, settings) };
}

/** The field that a frozen ground has inside. */
const fieldOf = (ground: Ground): DetailField => (ground as ShownGround).field;

describe("the shown terrain", () => {
  test("keeps its detail when refined tiles come and go, and makes it anew when anything it depends on changes", () => {
    let settings = SETTINGS;
    const { tiles, channels, level, shown } = terrain(() => settings);
    const first = shown.freeze();
    expect(shown.freeze()).toBe(first);
    tiles.apply(frame("FILL", 2, [tileOf(2, 1, 1, 1, peak, SIZE)]));
    const refined = shown.freeze();
    expect(refined).not.toBe(first);
    expect(fieldOf(refined)).toBe(fieldOf(first));

    level(1, (x, y) => peak(x, y) + 10);
    const moved = shown.freeze();
    expect(fieldOf(moved)).not.toBe(fieldOf(first));

    const samples = new Int32Array(65 * 65).fill(1024);
    const paint = { x: 0, y: 0, version: 1, samples, subMin: samples, subMax: samples, subError: new Uint32Array(16) };
    channels.apply({ ...frame("LEVEL", 0, [paint]), kind: FrameKind.LEVEL, channel: Channel.SNOW });
    expect(fieldOf(shown.freeze())).not.toBe(fieldOf(moved));
    expect(shown.attributesAt(500, 500)!.snow).toBe(1);

    const painted = shown.freeze();
    for (const change of [
      { detail: 3 },
      { rule: "plain" as const },
      { seed: 4 },
      { look: "desert" as const },
      { sea_level_m: 2 },
    ]) {
      settings = { ...SETTINGS, ...change };
      expect(fieldOf(shown.freeze())).not.toBe(fieldOf(painted));
    }
  });

  test("frozen, stays as it is while the ground goes on", () => {
    const { level, shown } = terrain();
    const before = shown.freeze();
    const height = before.heightAt(500, 500, 1);
    level(1, () => 0);
    expect(before.heightAt(500, 500, 1)).toBe(height);
    expect(shown.ground.heightAt(500, 500, 1)).toBeLessThan(height - 100);
    expect(shown.ground.solvedAt!(500, 500)).toBe(0);
  });

  test("is the solved ground while there is no document", () => {
    const { tiles, shown } = terrain(() => null);
    expect(shown.freeze()).toBe(tiles.freeze());
    expect(shown.attributesAt(1, 1)).toBeNull();
  });

  test("carries the eye: no camera that walks over it dips under the rock", () => {
    const { shown } = terrain();
    const camera = new Camera(SIZE);
    camera.resize(400, 300);
    camera.setMode("fly");
    const floor = {
      ...shown.ground,
      heightAt: (x: number, y: number) => shown.floorUnder(x, y, camera.state.value.eye[2]),
    };
    let deepest = Number.NEGATIVE_INFINITY;
    for (let i = 0; i < 12; i++) {
      const [x, y] = [400 + 17 * i, 470 + 7 * i];
      camera.goTo([x, y, 2], [x + 10, y, 2], 0);
      while (camera.update(0.016, floor));
      const [ex, ey, ez] = camera.state.value.eye;
      deepest = Math.max(deepest, shown.ground.heightAt(ex, ey, 0.02) - ez);
    }
    expect(deepest).toBeLessThan(-1.5);
  });
});

describe("the memo", () => {
  test("forgets what was not asked for, never more than it may, and keeps what is in use", () => {
    const memo = new Memo<string>(4);
    memo.put(0, "kept");
    for (let k = 1; k <= 40; k++) {
      memo.put(k, `${k}`);
      expect(memo.get(0)).toBe("kept");
      expect(memo.size).toBeLessThanOrEqual(9);
    }
    expect(memo.get(1)).toBeUndefined();
    expect(memo.get(40)).toBe("40");
  });

  test("makes what it forgot again, the same", () => {
    const { tiles, channels } = terrain();
    const heightOf = heightsOfTiles((level, x, y) => tiles.tile(level, x, y));
    const field = new DetailField(SETTINGS, channels, heightOf, 1, 16);
    const once = [...field.block(3, 20, 30)!.d];
    for (let x = 0; x < 60; x++) field.block(3, x, 2);
    expect([...field.block(3, 20, 30)!.d]).toEqual(once);
  });
});
