// What follows the ground only when it lies still (SPEC I425).
import { computed, signal } from "@preact/signals-core";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { StillGround } from "../../src/app/layers/still-ground.ts";
import { SLOPE } from "../input/scene.ts";

describe("ground that lies still", () => {
  beforeEach(() => {
    vi.useFakeTimers();
  });
  afterEach(() => {
    vi.useRealTimers();
  });

  it("is asked for once, after the last of many tiles, and again when it has moved", () => {
    const revision = signal(0);
    const still = new StillGround(revision, () => ({ ...SLOPE }));
    let asked = 0;
    const lines = computed(() => {
      asked += still.ground.value === null ? 0 : 1;
      return still.ground.value;
    });
    for (let tile = 1; tile <= 200; tile++) {
      revision.value = tile;
      vi.advanceTimersByTime(20);
      expect(lines.value).toBeNull();
    }
    vi.advanceTimersByTime(1000);
    const first = lines.value;
    expect(first).not.toBeNull();
    expect(lines.value).toBe(first);
    expect(asked).toBe(1);
    revision.value = 0;
    expect(lines.value, "lines stay where they are meanwhile").toBe(first);
    vi.advanceTimersByTime(1000);
    expect(lines.value).not.toBe(first);
    expect(asked).toBe(2);
    revision.value = 1;
    still.stop();
    vi.advanceTimersByTime(1000);
    expect(asked).toBe(2);
  });
});
