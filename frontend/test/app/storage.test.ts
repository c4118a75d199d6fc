// SPEC U4
import { describe, expect, it } from "vitest";
import { friendlyName } from "../../src/app/device/names.ts";
import { madeLinks, rememberLink } from "../../src/app/device/share-links.ts";
import {
  forgetSecret,
  forgetTerrain,
  identity,
  MEMBER_COLOURS,
  type RecentTerrain,
  recentTerrains,
  rememberIdentity,
  rememberTerrain,
  type Store,
} from "../../src/app/device/storage.ts";

function memory(): Store & { readonly values: Map<string, string> } {
  const values = new Map<string, string>();
  return {
    values,
    getItem: (key) => values.get(key) ?? null,
    setItem: (key, value) => void values.set(key, value),
    removeItem: (key) => void values.delete(key),
  };
}

const full: Store = {
  getItem: () => null,
  setItem: () => {
    throw new DOMException("full", "QuotaExceededError");
  },
  removeItem: () => {},
};

const entry = (
  id: string,
  opened: number,
  role: RecentTerrain["role"] = "edit",
  secret = `s-${id}`,
): RecentTerrain => ({
  id,
  title: `Title ${id}`,
  secret,
  role,
  opened,
});

describe("recent terrains", () => {
  it("stand with the last opened first, once each", () => {
    const store = memory();
    rememberTerrain(store, entry("a", 1));
    rememberTerrain(store, entry("b", 2));
    rememberTerrain(store, entry("a", 3));
    expect(recentTerrains(store).map((r) => r.id)).toEqual(["a", "b"]);
    forgetTerrain(store, "a");
    expect(recentTerrains(store).map((r) => r.id)).toEqual(["b"]);
  });

  it("keep the stronger link, and take a stronger one", () => {
    const store = memory();
    rememberTerrain(store, entry("a", 1, "owner", "own"));
    rememberTerrain(store, { ...entry("a", 2, "view", "look"), title: "New title" });
    expect(recentTerrains(store)).toEqual([{ ...entry("a", 2, "owner", "own"), title: "New title" }]);
    rememberTerrain(store, entry("b", 3, "view", "look"));
    rememberTerrain(store, entry("b", 4, "edit", "draw"));
    expect(recentTerrains(store)[0]).toMatchObject({ role: "edit", secret: "draw" });
  });

  it("forget a dead secret, but not a living one of the same terrain", () => {
    const store = memory();
    rememberTerrain(store, entry("a", 1, "owner", "own"));
    forgetSecret(store, "a", "look");
    expect(recentTerrains(store)).toHaveLength(1);
    forgetSecret(store, "a", "own");
    expect(recentTerrains(store)).toHaveLength(0);
  });

  it("are bounded", () => {
    const store = memory();
    for (let i = 0; i < 40; i++) rememberTerrain(store, entry(`t${i}`, i));
    expect(recentTerrains(store)).toHaveLength(24);
    expect(recentTerrains(store)[0]?.id).toBe("t39");
  });

  it("survive damaged and blocked storage", () => {
    const store = memory();
    store.setItem("esker.recent", "{not json");
    expect(recentTerrains(store)).toEqual([]);
    store.setItem(
      "esker.recent",
      JSON.stringify([1, null, { id: "x" }, entry("ok", 5), { ...entry("bad", 1), role: "king" }]),
    );
    expect(recentTerrains(store).map((r) => r.id)).toEqual(["ok"]);
    expect(() => rememberTerrain(full, entry("a", 1))).not.toThrow();
  });
});

describe("identity", () => {
  it("draws a colour and a friendly name once and keeps them", () => {
    const store = memory();
    const first = identity(store, () => 0.99, "c1");
    expect(first).toEqual({ name: friendlyName("c1"), colour: MEMBER_COLOURS.at(-1) });
    expect(identity(store, () => 0, "c2")).toEqual(first);
    rememberIdentity(store, { name: "Ana", colour: "#123456" });
    expect(identity(store, () => 0, "c3")).toEqual({ name: "Ana", colour: "#123456" });
    rememberIdentity(store, { name: " ", colour: "#123456" });
    expect(identity(store, () => 0, "c4").name).toBe(friendlyName("c4"));
  });

  it("friendly names are an adjective and an animal, the same for an id and distinct for most", () => {
    const names = Array.from({ length: 40 }, (_, i) => friendlyName(`client${i}`));
    for (const name of names) expect(name).toMatch(/^[A-Z][a-z]+ [A-Z][a-z]+$/);
    expect(friendlyName("client7")).toBe(names[7]);
    expect(new Set(names).size).toBeGreaterThan(36);
    expect(new Set(names.map((n) => n.split(" ")[0])).size).toBeGreaterThan(15);
    expect(new Set(names.map((n) => n.split(" ")[1])).size).toBeGreaterThan(15);
  });

  it("does not trust what is stored", () => {
    const store = memory();
    store.setItem("esker.colour", "red; background: url(x)");
    store.setItem("esker.name", "x".repeat(200));
    const who = identity(store, () => 0, "c");
    expect(who.colour).toBe(MEMBER_COLOURS[0]);
    expect(who.name).toHaveLength(80);
  });
});

describe("links that this device made", () => {
  it("are kept by terrain and role, replaced and forgotten", () => {
    const store = memory();
    rememberLink(store, "t", "edit", { link: "l1", secret: "s1" });
    rememberLink(store, "t", "view", { link: "l2", secret: "s2" });
    rememberLink(store, "t", "edit", { link: "l1", secret: "s3" });
    expect(madeLinks(store, "t")).toEqual({ edit: { link: "l1", secret: "s3" }, view: { link: "l2", secret: "s2" } });
    expect(rememberLink(store, "t", "edit", null)).toEqual({ view: { link: "l2", secret: "s2" } });
    expect(madeLinks(store, "other")).toEqual({});
    store.setItem("esker.links.t", '{"edit": {"link": 4}}');
    expect(madeLinks(store, "t")).toEqual({});
  });
});
