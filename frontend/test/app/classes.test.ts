// What the page knows of classes: seats of this device, the order of copies, following the teacher (SPEC U600 to U603).
import { describe, expect, it, vi } from "vitest";
import type { Store } from "../../src/app/device/storage.ts";
import { arrange, codeWords, copyName } from "../../src/app/server/classes/copies.ts";
import { Following } from "../../src/app/server/classes/following.ts";
import { forgetSeat, keepSeat, keptSeats, seatIn } from "../../src/app/server/classes/seats.ts";
import { readJoinInput, terrainPath, wallPath } from "../../src/app/server/links.ts";
import { route } from "../../src/app/server/router.ts";
import type { InClass, WallCopy } from "../../src/generated/contract.ts";

function store(): Store & { readonly values: Map<string, string> } {
  const values = new Map<string, string>();
  return {
    values,
    getItem: (key) => values.get(key) ?? null,
    setItem: (key, value) => void values.set(key, value),
    removeItem: (key) => void values.delete(key),
  };
}

const copy = (number: number, names: string[], last: number | null = null): WallCopy =>
  ({ number, terrain: `t${number}`, names, online: 0, last, strokes: 0, frozen: false }) as unknown as WallCopy;

describe("seats of this device", () => {
  it("keeps one for each class, and forgets it (SPEC U600)", () => {
    const kept = store();
    const seat = { lesson: "a", title: "A", secret: "s", name: "Ada", at: 1 };
    keepSeat(kept, seat);
    keepSeat(kept, { ...seat, secret: "newer", at: 2 });
    keepSeat(kept, { ...seat, lesson: "b", at: 3 });
    expect(keptSeats(kept).map((each) => each.lesson)).toEqual(["b", "a"]);
    expect(seatIn(kept, "a")?.secret).toBe("newer");
    forgetSeat(kept, "a");
    expect(seatIn(kept, "a")).toBeNull();
    kept.setItem("esker.seats", '[{"lesson":1},null]');
    expect(keptSeats(kept)).toEqual([]);
    kept.setItem("esker.seats", "nonsense");
    expect(keptSeats(kept)).toEqual([]);
  });
});

describe("the copies of a wall", () => {
  it("are called by whose they are, and stand in order (SPEC U601)", () => {
    const all = [copy(3, ["ben"], 5), copy(1, ["", "Ada"], null), copy(2, [""], 9), copy(4, ["Ben"], 7)];
    expect(all.map(copyName)).toEqual(["ben", "Ada", "Copy 2", "Ben"]);
    expect(arrange(all, "number").map((each) => each.number)).toEqual([1, 2, 3, 4]);
    expect(arrange(all, "name").map((each) => each.number)).toEqual([1, 3, 4, 2]);
    expect(arrange(all, "last").map((each) => each.number)).toEqual([2, 4, 3, 1]);
    expect(arrange(all, "number", " BEN ").map((each) => each.number)).toEqual([3, 4]);
    expect(codeWords("K7M2QX")).toBe("K7M 2QX");
  });
});

describe("addresses of a class", () => {
  it("are read as they are written (SPEC U602)", () => {
    const read = (path: string) => route(new URL(path, "https://here"));
    expect(read("/join#K7M2QX")).toEqual({ page: "join", code: "K7M2QX" });
    expect(read(wallPath("t1", "c1", "s 1"))).toEqual({ page: "wall", id: "t1", lesson: "c1", secret: "s 1" });
    expect(read("/wall/t1").page).toBe("missing");
    expect(readJoinInput("https://here/join#K7M2QX", "https://here")).toEqual({ kind: "code", code: "K7M2QX" });
    expect(readJoinInput("https://there/join#K7M2QX", "https://here").kind).toBe("unreadable");
  });
});

describe("following the teacher", () => {
  const told = (show: string | null): InClass =>
    ({ type: "class", show: show && { terrain: show, secret: `of-${show}`, name: "Ada" } }) as unknown as InClass;

  function pages(): { at: string; page: (id: string, secret: string) => Following; path: () => string } {
    const kept = store();
    const world = { at: terrainPath("mine", "my") };
    const go = (path: string): void => {
      world.at = path;
    };
    return {
      ...world,
      page: (id, secret) => new Following(id, secret, { kept, go }, 1000),
      path: () => world.at,
    };
  }

  it("goes after a while, comes back when it ends, and stays home then (SPEC U603)", () => {
    vi.useFakeTimers();
    const { page, path } = pages();
    const mine = page("mine", "my");
    mine.told(told(null), false);
    mine.told(told("hers"), false);
    expect(mine.invitation.value?.terrain).toBe("hers");
    vi.advanceTimersByTime(1001);
    expect(path()).toBe(terrainPath("hers", "of-hers"));
    const hers = page("hers", "of-hers");
    expect(hers.away.value).toBe(true);
    hers.told(told("hers"), false);
    expect(path()).toBe(terrainPath("hers", "of-hers"));
    hers.told(told(null), false);
    expect(path()).toBe(terrainPath("mine", "my"));
    const again = page("mine", "my");
    expect(again.away.value).toBe(false);
    again.told(told(null), false);
    vi.advanceTimersByTime(5000);
    expect(path()).toBe(terrainPath("mine", "my"));
    vi.useRealTimers();
  });

  it("stays where it is when it is shown itself, or when the invitation ends in time; comes back when the link ends", () => {
    vi.useFakeTimers();
    const { page, path } = pages();
    const mine = page("mine", "my");
    mine.told(told("mine"), false);
    mine.told(told("hers"), false);
    mine.told(told(null), false);
    vi.advanceTimersByTime(5000);
    expect(path()).toBe(terrainPath("mine", "my"));
    mine.told(told("hers"), false);
    mine.go();
    page("hers", "of-hers").told(null, true);
    expect(path()).toBe(terrainPath("mine", "my"));
    vi.useRealTimers();
  });
});
