// SPEC U9, U10, U11, U13, U16
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Throttle } from "../../src/app/throttle.ts";
import { ToastList } from "../../src/app/toasts.ts";
import { FrameLoop } from "../../src/app/view/frame-loop.ts";
import { FreshTiles } from "../../src/app/view/fresh-tiles.ts";
import { sunAt, sunOnDial, sunWords } from "../../src/app/view/sun.ts";
import { keyLabel, keyParts, keyText } from "../../src/app/words/keys.ts";
import { ago, compass, height, initials, metres, roundBelow } from "../../src/app/words/words.ts";
import type { DecodedFrame } from "../../src/core/types.ts";
import { FrameKind } from "../../src/generated/contract.ts";
import { mulberry32, penHeight, penRidge, ridge, ridgeLayers, seedOf } from "../../src/ui/pages/ridges.ts";

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

describe("Throttle", () => {
  it("sends at once, then at most once per interval, and always the last state", () => {
    let state = 0;
    const sent: number[] = [];
    const throttle = new Throttle(
      10,
      () => sent.push(state),
      () => Date.now(),
    );
    for (let ms = 0; ms < 1000; ms += 5) {
      state = ms;
      throttle.request();
      vi.advanceTimersByTime(5);
    }
    expect(sent.length).toBeGreaterThan(8);
    expect(sent.length).toBeLessThanOrEqual(11);
    vi.advanceTimersByTime(200);
    expect(sent.at(-1)).toBe(995);
  });

  it("sends nothing more after stop", () => {
    const send = vi.fn();
    const throttle = new Throttle(10, send, () => Date.now());
    throttle.request();
    throttle.request();
    throttle.stop();
    vi.advanceTimersByTime(500);
    expect(send).toHaveBeenCalledTimes(1);
  });
});

describe("toasts", () => {
  it("count up instead of piling up, and go by themselves", () => {
    const toasts = new ToastList();
    toasts.show("This stroke is locked.", "warn");
    toasts.show("This stroke is locked.", "warn");
    expect(toasts.list.value).toMatchObject([{ times: 2 }]);
    vi.advanceTimersByTime(10_000);
    expect(toasts.list.value).toEqual([]);
  });

  it("stand three at most, the newest last", () => {
    const toasts = new ToastList();
    for (const text of ["a", "b", "c", "d"]) toasts.show(text);
    expect(toasts.list.value.map((t) => t.text)).toEqual(["b", "c", "d"]);
    toasts.dismiss(toasts.list.value[1]!.id);
    expect(toasts.list.value.map((t) => t.text)).toEqual(["b", "d"]);
    toasts.dispose();
  });
});

describe("FreshTiles", () => {
  const frame = (level: number, kind: number = FrameKind.LEVEL): DecodedFrame => ({
    kind,
    level,
    channel: 0,
    clock: 1,
    settled: false,
    drops: [],
    tiles: [],
    bytes: 1,
  });

  function sink(solved = 4) {
    const log: string[] = [];
    return { log, solved, clear: () => log.push("clear"), apply: (f: DecodedFrame) => log.push(`level ${f.level}`) };
  }

  it("keeps the old ground until the coarse levels are complete", () => {
    const tiles = sink();
    const done = vi.fn();
    const fresh = new FreshTiles(tiles, done);
    fresh.apply(frame(0));
    fresh.apply(frame(1));
    expect(tiles.log).toEqual([]);
    fresh.apply(frame(2));
    expect(tiles.log).toEqual(["clear", "level 0", "level 1", "level 2"]);
    vi.advanceTimersByTime(5000);
    expect(done).toHaveBeenCalledTimes(1);
  });

  it("does not wait for levels that do not exist, nor for ever", () => {
    const shallow = sink(1);
    new FreshTiles(shallow, () => {}).apply(frame(1));
    expect(shallow.log[0]).toBe("clear");
    const slow = sink();
    new FreshTiles(slow, () => {}).apply(frame(0));
    vi.advanceTimersByTime(1000);
    expect(slow.log).toEqual(["clear", "level 0"]);
  });
});

describe("FrameLoop", () => {
  it("draws one frame for many changes, goes on while something moves, and then rests", () => {
    const queue: ((now: number) => void)[] = [];
    vi.stubGlobal("requestAnimationFrame", (callback: (now: number) => void) => queue.push(callback));
    vi.stubGlobal("cancelAnimationFrame", () => queue.splice(0));
    const steps: number[] = [];
    let moving = 2;
    const loop = new FrameLoop((dt) => {
      steps.push(dt);
      return moving-- > 0;
    });
    loop.invalidate();
    expect(queue).toHaveLength(0);
    loop.start();
    loop.invalidate();
    let now = 1000;
    while (queue.length > 0) {
      const frame = queue.splice(0);
      expect(frame).toHaveLength(1);
      frame[0]!(now);
      now += 500;
    }
    expect(loop.frames).toBe(3);
    expect(steps[1]).toBe(0.1);
    loop.stop();
    loop.invalidate();
    expect(queue).toHaveLength(0);
  });
});

describe("keys", () => {
  it("read as they are printed on a keyboard", () => {
    expect(keyParts("Ctrl+Shift+z")).toEqual(["Ctrl", "Shift", "Z"]);
    expect(keyLabel("ArrowUp")).toBe("↑");
    expect(keyLabel("Escape")).toBe("Esc");
    expect(keyLabel("?")).toBe("?");
    expect(keyLabel("+")).toBe("+");
    expect(keyLabel("Ctrl++")).toBe("Ctrl++");
    expect(keyText("Mountain", { title: "Mountain", keys: ["b", "1"] })).toBe("Mountain (B)");
    expect(keyText("Mountain", undefined)).toBe("Mountain");
  });
});

describe("the sun dial", () => {
  it("gives back the sun that it shows", () => {
    for (const azimuthDeg of [0, 37, 115, 200, 359]) {
      for (const elevationDeg of [0, 24, 60]) {
        const at = sunOnDial({ azimuthDeg, elevationDeg }, 60);
        expect(sunAt(at.x, at.y, 60, { azimuthDeg: 0, elevationDeg: 0 })).toEqual({ azimuthDeg, elevationDeg });
      }
    }
  });

  it("has north at the top and east at the right, and stands on the horizon outside its rim", () => {
    const before = { azimuthDeg: 10, elevationDeg: 10 };
    expect(sunAt(0, -30, 60, before)).toEqual({ azimuthDeg: 0, elevationDeg: 45 });
    expect(sunAt(500, 0, 60, before)).toEqual({ azimuthDeg: 90, elevationDeg: 0 });
    expect(sunAt(0, 0, 60, before)).toEqual({ azimuthDeg: 10, elevationDeg: 90 });
  });

  it("says what light that is", () => {
    expect(sunWords({ azimuthDeg: 115, elevationDeg: 12 })).toBe("Low morning light from the south-east, 12° high");
    expect(sunWords({ azimuthDeg: 250, elevationDeg: 30 })).toMatch(/evening.*west/);
    expect(sunWords({ azimuthDeg: 90, elevationDeg: 0 })).toBe("On the horizon, from the east");
  });
});

describe("words", () => {
  it("says lengths, heights and times plainly", () => {
    expect([metres(8.44), metres(311.7), metres(4096), metres(12_300)]).toEqual(["8.4 m", "312 m", "4.1 km", "12 km"]);
    expect([height(-0.01), height(12.345), height(-123.4)]).toEqual(["0.0 m", "12.3 m", "-123 m"]);
    expect(ago(30_000)).toBe("just now");
    expect(ago(5 * 60_000)).toBe("5 minutes ago");
    expect(ago(26 * 3_600_000)).toBe("yesterday");
    expect([compass(0), compass(115), compass(350), compass(-45)]).toEqual([
      "north",
      "south-east",
      "north",
      "north-west",
    ]);
    expect([initials("Ana Lúcia"), initials("bo"), initials("  "), initials("😀 x")]).toEqual(["AL", "B", "", "😀X"]);
  });

  it("finds the round number below", () => {
    expect([1, 4.9, 5, 19, 999, 0.3].map(roundBelow)).toEqual([1, 2, 5, 10, 500, 0.2]);
    expect(roundBelow(0)).toBe(0);
    expect(roundBelow(Number.NaN)).toBe(0);
  });
});

describe("ridges", () => {
  it("are fixed by their seed and stay in their band", () => {
    expect(ridge(7, 6, 0.5)).toEqual(ridge(7, 6, 0.5));
    expect(ridge(7, 6, 0.5)).not.toEqual(ridge(8, 6, 0.5));
    expect(Math.max(...ridge(7, 6, 0.5).map(Math.abs))).toBeCloseTo(1, 9);
    expect(seedOf("canyon")).not.toBe(seedOf("archipelago"));
    const random = mulberry32(1);
    const draws = Array.from({ length: 1000 }, random);
    expect(Math.min(...draws)).toBeGreaterThanOrEqual(0);
    expect(Math.max(...draws)).toBeLessThan(1);
    expect(ridgeLayers(1, 4, 320, 180).map((l) => l.depth)).toEqual([0, 1 / 3, 2 / 3, 1]);
  });

  it("rise to the drawn line and not above it", () => {
    const pen = penRidge(5, 1600, 640, 500, 905, 1545);
    const points = [...pen.land.matchAll(/L([\d.]+) ([\d.]+)/g)].map((m) => [Number(m[1]), Number(m[2])] as const);
    const under = points.filter(([x]) => x > 905 && x < 1545);
    expect(under.length).toBeGreaterThan(80);
    for (const [x, y] of under) {
      expect(y).toBeGreaterThanOrEqual(500 - penHeight(x) - 0.2);
      expect(y).toBeLessThanOrEqual(500 - penHeight(x) + 9.2);
    }
  });
});
