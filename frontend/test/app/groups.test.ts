/** Groups of people whose pens are given together (SPEC L160, L161). */

import { describe, expect, test } from "vitest";
import { Groups, MOST_GROUPS } from "../../src/app/lesson/groups.ts";

function store() {
  const values = new Map<string, string>();
  return {
    values,
    getItem: (key: string) => values.get(key) ?? null,
    setItem: (key: string, value: string) => void values.set(key, value),
    removeItem: (key: string) => void values.delete(key),
  };
}

function stand() {
  const kept = store();
  const sent: [string, readonly string[]][] = [];
  const open = (): Groups => new Groups(kept, "t", (action, people) => sent.push([action, people]));
  const groups = open();
  for (const name of ["Red", "Blue"]) groups.make(name);
  for (const [person, at] of [
    ["ada", 0],
    ["ben", 0],
    ["cho", 1],
  ] as const)
    groups.put(person, at);
  return { groups, sent, kept, open };
}

describe("groups of people", () => {
  test("get their pens by one order, and lose them by one (L160)", () => {
    const { groups, sent } = stand();
    expect(sent).toEqual([]);
    groups.pen(0, true);
    groups.pen(0, false);
    expect(sent).toEqual([
      ["pen", ["ada", "ben"]],
      ["no_pen", ["ada", "ben"]],
    ]);
  });

  test("give a pen to who is put in later, and take it from who goes out or elsewhere (L160)", () => {
    const { groups, sent } = stand();
    groups.pen(0, true);
    sent.length = 0;
    groups.put("dan", 0);
    groups.put("dan", 1);
    groups.takeOut("ben", 0);
    groups.put("cho", 0);
    expect(sent).toEqual([
      ["pen", ["dan"]],
      ["no_pen", ["dan"]],
      ["no_pen", ["ben"]],
      ["pen", ["cho"]],
    ]);
    expect(groups.list.value.map(({ people }) => people)).toEqual([["ada", "cho"], ["dan"]]);
    sent.length = 0;
    groups.remove(0);
    expect(sent).toEqual([["no_pen", ["ada", "cho"]]]);
    expect(groups.list.value.map(({ name }) => name)).toEqual(["Blue"]);
  });

  test("are the same after a reload, and forgotten with the last (L161)", () => {
    const { groups, kept, open } = stand();
    groups.pen(1, true);
    expect(open().list.value).toEqual(groups.list.value);
    groups.remove(0);
    groups.remove(0);
    expect(kept.values.size).toBe(0);
  });

  test("are none where what is kept cannot be read, and no more than can be shown (L161)", () => {
    const { kept, open } = stand();
    for (const bad of ["{", '{"a":1}', '[{"name":1}]', '[{"name":"a","people":[1],"pen":true}]', "[null]"]) {
      kept.setItem("esker.groups.t", bad);
      expect(open().list.value).toEqual([]);
    }
    const groups = open();
    for (let k = 0; k < MOST_GROUPS; k += 1) expect(groups.make(`${k}`)).toBe(true);
    expect(groups.make("one more")).toBe(false);
  });

  test("follow what is given to everybody (L160)", () => {
    const { groups, sent } = stand();
    groups.allHave(true);
    sent.length = 0;
    groups.put("dan", 1);
    expect(sent).toEqual([["pen", ["dan"]]]);
  });
});
