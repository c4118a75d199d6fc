/** Groups of people whose pens are given together (SPEC L160, L161, L164). */

import { signal } from "@preact/signals-core";
import { describe, expect, test } from "vitest";
import { Groups } from "../../src/app/lesson/groups.ts";
import { NOBODY_LEADS } from "../../src/app/lesson/lesson-view.ts";
import { checkClientMessage } from "../../src/core/wire.ts";
import {
  type Grouping,
  type Lesson,
  MAX_GROUP_NAME,
  MAX_GROUPED,
  MAX_GROUPS,
  type PenGroup,
} from "../../src/generated/contract.ts";

const RED: PenGroup = { id: "red", name: "Red", people: ["ada", "ben"], pen: false };
const BLUE: PenGroup = { id: "blue", name: "Blue", people: ["cho"], pen: true };

function stand(...groups: PenGroup[]) {
  const lesson = signal<Lesson>({ ...NOBODY_LEADS, conducts: true, groups });
  const sent: Grouping[] = [];
  return { lesson, sent, groups: new Groups(lesson, (order) => sent.push(order)) };
}

/** Orders without what they leave as it is. */
const said = (sent: readonly Grouping[]): object[] =>
  sent.map(({ type, ...order }) => {
    expect(type).toBe("grouping");
    const left = Object.entries(order).filter(([, v]) => v !== null && v !== false && !(Array.isArray(v) && !v.length));
    return Object.fromEntries(left);
  });

describe("groups of people", () => {
  test("are those that the server tells, whoever of those who lead made them (L161)", () => {
    const { lesson, groups, sent } = stand(RED);
    expect(groups.list.value).toEqual([RED]);
    lesson.value = { ...lesson.value, groups: [RED, BLUE] };
    expect(groups.list.value).toEqual([RED, BLUE]);
    lesson.value = NOBODY_LEADS;
    expect(groups.list.value).toEqual([]);
    expect(sent).toEqual([]);
  });

  test("are changed by one order each, which says no more than what it changes (L160)", () => {
    const { groups, sent } = stand(RED, BLUE);
    groups.pen("red", true);
    expect(groups.put("dan", "red")).toBe(true);
    groups.takeOut("ben", "red");
    groups.rename("red", `  ${"\u{1f98a}".repeat(50)}`);
    groups.remove("blue");
    expect(said(sent)).toEqual([
      { group: "red", pen: true },
      { group: "red", put: ["dan"] },
      { group: "red", out: ["ben"] },
      { group: "red", name: "\u{1f98a}".repeat(MAX_GROUP_NAME) },
      { group: "blue", forget: true },
    ]);
    for (const order of sent) expect(checkClientMessage(order)).toBeNull();
  });

  test("are made under an id of their own, and no more than a lesson has (L164)", () => {
    const { lesson, groups, sent } = stand();
    const [one, other] = [groups.make("Group 1"), groups.make("Group 2")];
    expect(one).not.toBe(other);
    expect(said(sent)).toEqual([
      { group: one, name: "Group 1" },
      { group: other, name: "Group 2" },
    ]);
    for (const order of sent) expect(checkClientMessage(order)).toBeNull();
    const full = Array.from({ length: MAX_GROUPS }, (_, k) => ({ ...RED, id: `g${k}`, people: [] }));
    lesson.value = { ...lesson.value, groups: full };
    expect(groups.make("one more")).toBeNull();
    expect(sent).toHaveLength(2);
  });

  test("take nobody beyond what a lesson holds; who is in one may change (L164)", () => {
    const people = Array.from({ length: MAX_GROUPED }, (_, k) => `p${k}`);
    const { groups, sent } = stand({ ...RED, people }, { ...BLUE, people: [] });
    expect(groups.put("dan", "blue")).toBe(false);
    expect(groups.put("p7", "blue")).toBe(true);
    expect(said(sent)).toEqual([{ group: "blue", put: ["p7"] }]);
  });

  test("follow what is given to everybody, by one order (L160)", () => {
    const { lesson, groups, sent } = stand(RED, BLUE);
    groups.allHave(true);
    expect(said(sent)).toEqual([{ pen: true }]);
    lesson.value = { ...lesson.value, groups: [BLUE] };
    groups.allHave(true);
    expect(sent).toHaveLength(1);
    groups.allHave(false);
    expect(sent.at(-1)).toMatchObject({ group: null, pen: false });
  });
});
