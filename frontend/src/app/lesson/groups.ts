/**
 * Groups of people in one terrain, to whom pens are given together. The server keeps them and gives the pens; it tells whoever leads
 * who is in which, and nobody else.
 */

import { computed, type ReadonlySignal } from "@preact/signals-core";
import type { Grouping, Lesson, PenGroup } from "../../generated/contract.ts";
import { MAX_GROUP_NAME, MAX_GROUPED, MAX_GROUPS } from "../../generated/contract.ts";

const UNCHANGED: Grouping = {
  type: "grouping",
  group: null,
  name: null,
  pen: null,
  put: [],
  out: [],
  forget: false,
};

export class Groups {
  readonly list: ReadonlySignal<readonly PenGroup[]>;
  readonly #send: (order: Grouping) => unknown;

  constructor(lesson: ReadonlySignal<Lesson>, send: (order: Grouping) => unknown) {
    this.list = computed(() => lesson.value.groups);
    this.#send = send;
  }

  /** Makes an empty group at the end, and gives its id; null where there are `MAX_GROUPS`. */
  make(name: string): string | null {
    if (this.list.peek().length >= MAX_GROUPS) return null;
    const group = crypto.randomUUID().replaceAll("-", "");
    this.#order({ group, name: cut(name) });
    return group;
  }

  rename(group: string, name: string): void {
    this.#order({ group, name: cut(name.trim()) });
  }

  /** Gives pens to all of a group, also to those who are not here now, or takes them. */
  pen(group: string, pen: boolean): void {
    this.#order({ group, pen });
  }

  /** Puts a person into a group and out of any other; their pen goes by the group that they are in. False where groups are full. */
  put(person: string, group: string): boolean {
    const others = this.list.peek().flatMap(({ people }) => people.filter((each) => each !== person));
    if (others.length >= MAX_GROUPED) return false;
    this.#order({ group, put: [person] });
    return true;
  }

  /** Takes a person out of a group, with the pen that the group had. */
  takeOut(person: string, group: string): void {
    this.#order({ group, out: [person] });
  }

  /** Forgets a group; its pens go with it. */
  remove(group: string): void {
    this.#order({ group, forget: true });
  }

  /** Pens were given to everybody, or taken from everybody, so groups have them or have none. */
  allHave(pen: boolean): void {
    if (this.list.peek().some((group) => group.pen !== pen)) this.#order({ pen });
  }

  #order(change: Partial<Omit<Grouping, "type">>): void {
    this.#send({ ...UNCHANGED, ...change });
  }
}

/** A name of `MAX_GROUP_NAME` characters at most, as the server counts them. */
function cut(name: string): string {
  return [...name].slice(0, MAX_GROUP_NAME).join("");
}
