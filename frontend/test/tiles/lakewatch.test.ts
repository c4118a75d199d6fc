// Lakes while the ground changes under them (spec R69).

import { describe, expect, it } from "vitest";
import type { Tile, TileView } from "../../src/core/types.ts";
import { NO_LAKE } from "../../src/generated/contract.ts";
import { LakeWatch } from "../../src/tiles/lakes/lakewatch.ts";

const SIZE = 4096;
const RULE = { lakes_m: 4, sea_level_m: null };

/** A bowl of 100 m in a plain, with a rim of `rim` metres. */
class Bowl {
  stamp = 1;
  readonly sizeM = SIZE;
  private held = this.made(100);

  raise(rim: number): void {
    this.stamp += 1;
    this.held = this.made(rim);
  }

  flatten(at: number): void {
    this.raise(0);
    this.held.heights.fill(at);
  }

  get view(): TileView {
    return this as unknown as TileView;
  }

  tile(level: number): Tile | undefined {
    return level === 0 ? this.held : undefined;
  }

  private made(rim: number): Tile {
    const heights = Float32Array.from({ length: 65 * 65 }, (_, i) => {
      const away = Math.hypot((i % 65) - 32, Math.floor(i / 65) - 32);
      return away > 14 ? 0 : away > 10 ? rim : -100 + 10 * away;
    });
    return { level: 0, x: 0, y: 0, heights } as unknown as Tile;
  }
}

/** A watch whose work is done at once, and a clock. */
function started(): { watch: LakeWatch; bowl: Bowl; step: (ms: number, smooth?: boolean) => boolean } {
  const watch = new LakeWatch((run) => run());
  const bowl = new Bowl();
  let now = performance.now();
  const step = (ms: number, smooth = true): boolean => {
    now += ms;
    return watch.update(bowl.view, RULE, now, smooth);
  };
  return { watch, bowl, step };
}

const highest = (watch: LakeWatch): number => Math.max(...watch.heights.values());

describe("lakes that change", () => {
  it("rise from their bed, and rest at their level", () => {
    const { watch, step } = started();
    expect(step(1000)).toBe(true);
    const [level] = [...watch.heights.keys()];
    expect(level).toBeGreaterThan(95);
    let before = -101;
    for (let i = 0; i < 60 && watch.busy; i += 1) {
      expect(highest(watch)).toBeGreaterThan(before);
      expect(highest(watch)).toBeLessThan(before + 90);
      before = highest(watch);
      expect(step(50)).toBe(true);
    }
    expect(highest(watch)).toBe(level);
    expect(watch.busy).toBe(false);
    expect(step(50)).toBe(false);
  });

  it("go on from where they stand when the brim is raised, and sink when it is gone", () => {
    const { watch, bowl, step } = started();
    while (step(100) || watch.busy);
    bowl.raise(140);
    step(1000);
    expect(highest(watch)).toBeGreaterThan(95);
    expect(highest(watch)).toBeLessThan(130);
    while (step(100) || watch.busy);
    expect(highest(watch)).toBeGreaterThan(135);
    bowl.raise(-50);
    step(1000);
    expect(highest(watch)).toBeGreaterThan(80);
    while (step(100) || watch.busy);
    expect(highest(watch)).toBeLessThan(0);
    expect(highest(watch)).toBeGreaterThan(-5);
    bowl.flatten(-60);
    step(1000);
    expect(watch.heights.size).toBe(1);
    const sinking = highest(watch);
    step(50);
    expect(highest(watch)).toBeLessThan(sinking);
    expect(watch.surfaces.highest(0, 1, 1)).toBeGreaterThan(-5);
    while (step(100) || watch.busy);
    expect(watch.heights.size).toBe(0);
  });

  it("are there at once where nothing moves, and gone at once without the setting", () => {
    const { watch, bowl, step } = started();
    step(1000, false);
    expect(watch.busy).toBe(false);
    expect(highest(watch)).toBeGreaterThan(95);
    expect(watch.update(bowl.view, { lakes_m: null, sea_level_m: null }, 1, false)).toBe(true);
    expect(watch.lakes).toBeNull();
    expect(watch.surfaces.highest(0, 1, 1)).toBe(Number.NEGATIVE_INFINITY);
  });

  it("are looked for a few times a second, not in every frame", () => {
    let searches = 0;
    const watch = new LakeWatch((run) => {
      searches += 1;
      run();
    });
    const bowl = new Bowl();
    const from = performance.now() + 1000;
    for (let i = 0; i < 100; i += 1) {
      bowl.raise(100 + i);
      watch.update(bowl.view, RULE, from, true);
    }
    expect(searches).toBeLessThan(3);
    expect(watch.lakes?.levels.some((level) => level !== NO_LAKE)).toBe(true);
  });
});
