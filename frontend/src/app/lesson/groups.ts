/**
 * Groups of people in one terrain, to whom pens are given together. This device of whoever leads keeps who is in which group; the
 * server knows pens alone, so a group is never more than an order about several people at once.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import { MAX_PEOPLE } from "../../generated/contract.ts";
import type { Store } from "../device/storage.ts";

export const MOST_GROUPS = 24;
export const MOST_GROUP_NAME = 40;

/** People by their ids; `pen`: the group was given pens, so whoever is put into it later gets one too. */
export interface Group {
  readonly name: string;
  readonly people: readonly string[];
  readonly pen: boolean;
}

/** Gives these people pens, or takes theirs. */
export type Pens = (action: "pen" | "no_pen", people: readonly string[]) => void;

export class Groups {
  readonly #list = signal<readonly Group[]>([]);
  readonly #store: Store;
  readonly #key: string;
  readonly #pens: Pens;

  constructor(store: Store, terrain: string, pens: Pens) {
    this.#store = store;
    this.#key = `esker.groups.${terrain}`;
    this.#pens = pens;
    this.#list.value = read(store.getItem(this.#key));
  }

  get list(): ReadonlySignal<readonly Group[]> {
    return this.#list;
  }

  /** Adds an empty group at the end; false where there are `MOST_GROUPS`. */
  make(name: string): boolean {
    if (this.#list.peek().length >= MOST_GROUPS) return false;
    this.#set([...this.#list.peek(), { name: name.slice(0, MOST_GROUP_NAME), people: [], pen: false }]);
    return true;
  }

  rename(at: number, name: string): void {
    this.#change(at, { name: name.trim().slice(0, MOST_GROUP_NAME) });
  }

  /** Gives pens to all of a group, also to those who are not here now, or takes them. */
  pen(at: number, pen: boolean): void {
    const group = this.#list.peek()[at];
    if (group === undefined) return;
    if (group.people.length > 0) this.#pens(pen ? "pen" : "no_pen", group.people);
    this.#change(at, { pen });
  }

  /** Puts a person into a group and out of any other. Their pen goes by the group that they are in. */
  put(person: string, at: number): void {
    const group = this.#list.peek()[at];
    if (group === undefined || group.people.includes(person) || group.people.length >= MAX_PEOPLE) return;
    const had = this.#list.peek().find(({ people }) => people.includes(person))?.pen ?? false;
    this.#set(
      this.#list.peek().map((each, k) => {
        const others = each.people.filter((p) => p !== person);
        return { ...each, people: k === at ? [...others, person] : others };
      }),
    );
    if (group.pen) this.#pens("pen", [person]);
    else if (had) this.#pens("no_pen", [person]);
  }

  /** Takes a person out of a group, with the pen that the group had. */
  takeOut(person: string, at: number): void {
    const group = this.#list.peek()[at];
    if (!group?.people.includes(person)) return;
    this.#change(at, { people: group.people.filter((p) => p !== person) });
    if (group.pen) this.#pens("no_pen", [person]);
  }

  /** Forgets a group; its pens go with it. */
  remove(at: number): void {
    const group = this.#list.peek()[at];
    if (group?.pen && group.people.length > 0) this.#pens("no_pen", group.people);
    this.#set(this.#list.peek().filter((_, k) => k !== at));
  }

  /** Pens were given to everybody, or taken from everybody, so groups have them or have none. */
  allHave(pen: boolean): void {
    this.#set(this.#list.peek().map((group) => ({ ...group, pen })));
  }

  #change(at: number, change: Partial<Group>): void {
    this.#set(this.#list.peek().map((group, k) => (k === at ? { ...group, ...change } : group)));
  }

  #set(list: readonly Group[]): void {
    this.#list.value = list;
    try {
      if (list.length === 0) this.#store.removeItem(this.#key);
      else this.#store.setItem(this.#key, JSON.stringify(list));
    } catch {
      // Storage is full: groups last as long as the page.
    }
  }
}

function read(text: string | null): readonly Group[] {
  try {
    const found: unknown = JSON.parse(text ?? "[]");
    return Array.isArray(found) ? found.filter(isGroup).slice(0, MOST_GROUPS) : [];
  } catch {
    return [];
  }
}

function isGroup(found: unknown): found is Group {
  if (typeof found !== "object" || found === null) return false;
  const { name, people, pen } = found as Partial<Record<keyof Group, unknown>>;
  const isList = Array.isArray(people) && people.length <= MAX_PEOPLE && people.every((p) => typeof p === "string");
  return typeof name === "string" && typeof pen === "boolean" && isList;
}
