/** The activity log of this terrain, newest first, in pages, and kept up to date while somebody reads it. */

import { signal } from "@preact/signals-core";
import { friendlyName } from "../device/names.ts";

/** What an entry's sentence is made of (`facts` in backend/esker/document/history/words.py). */
export interface HistoryFacts {
  readonly kind: string;
  readonly count: number;
  readonly noun: string;
  readonly label: string;
  readonly paint: string;
  readonly fields?: readonly string[];
}

/** One thing that somebody did, from clock `first` to `last`. `at`: seconds since 1970, where the time is known. */
export interface HistoryEntry {
  readonly first: number;
  readonly last: number;
  readonly at: number | null;
  readonly author: string;
  readonly action: string;
  readonly turn: "" | "undo" | "redo";
  readonly text: string;
  readonly facts?: HistoryFacts;
}

export interface HistoryPerson {
  readonly name: string;
  readonly colour: string;
}

export interface HistoryPage {
  readonly clock: number;
  /** The list begins after this clock. */
  readonly first: number;
  readonly more: boolean;
  readonly entries: readonly HistoryEntry[];
  readonly people: Readonly<Record<string, HistoryPerson>>;
}

export type FetchHistory = (before: number | null) => Promise<HistoryPage>;
export type HistoryState = "waiting" | "ready" | "failed";

/** While ops come, the newest page is asked for at most this often. */
const AGAIN_MS = 1000;
/** Entries that a page keeps; earlier ones can be asked for again. */
export const KEPT = 2000;

export class History {
  readonly entries = signal<readonly HistoryEntry[]>([]);
  readonly people = signal<ReadonlyMap<string, HistoryPerson>>(new Map());
  readonly state = signal<HistoryState>("waiting");
  /** Whether there are earlier entries. */
  readonly more = signal(false);
  readonly first = signal(0);
  readonly #fetch: FetchHistory;
  #clock = -1;
  #busy = false;
  #due: ReturnType<typeof setTimeout> | undefined;
  #askedAt = Number.NEGATIVE_INFINITY;

  constructor(fetch: FetchHistory) {
    this.#fetch = fetch;
  }

  /** The terrain is at this clock now: brings the list up to date, soon. */
  follow(newest: number): void {
    if (newest <= this.#clock && this.state.peek() === "ready") return;
    if (this.#due !== undefined || this.#busy) return;
    const wait = Math.max(0, this.#askedAt + AGAIN_MS - performance.now());
    this.#due = setTimeout(() => {
      this.#due = undefined;
      void this.#load(null).then(() => {
        if (this.state.peek() === "ready") this.follow(newest);
      });
    }, wait);
  }

  /** Asks for the entries before those that are here. */
  async earlier(): Promise<void> {
    const oldest = this.entries.peek().at(-1);
    if (oldest !== undefined && this.more.peek() && !this.#busy) await this.#load(oldest.last);
  }

  /** Tries again after a failure. */
  retry(): void {
    this.state.value = "waiting";
    this.follow(this.#clock);
  }

  stop(): void {
    clearTimeout(this.#due);
    this.#due = undefined;
  }

  /** The name to show for an author, who may have none. */
  nameOf(author: string): string {
    return this.people.value.get(author)?.name.trim() || friendlyName(author);
  }

  async #load(before: number | null): Promise<void> {
    this.#busy = true;
    this.#askedAt = performance.now();
    try {
      this.#take(await this.#fetch(before), before);
      this.state.value = "ready";
    } catch {
      this.state.value = "failed";
    } finally {
      this.#busy = false;
    }
  }

  #take(page: HistoryPage, before: number | null): void {
    this.people.value = new Map([...this.people.peek(), ...Object.entries(page.people)]);
    this.first.value = page.first;
    if (before !== null) {
      this.entries.value = [...this.entries.peek(), ...page.entries].slice(0, KEPT);
      this.more.value = page.more && this.entries.peek().length < KEPT;
      return;
    }
    this.#clock = page.clock;
    const { entries, more } = joined(page, this.entries.peek(), this.more.peek());
    this.entries.value = entries;
    this.more.value = more;
  }
}

/** The newest page, then what is known before it; without that where a gap would lie between. */
export function joined(
  page: HistoryPage,
  known: readonly HistoryEntry[],
  more: boolean,
): { readonly entries: readonly HistoryEntry[]; readonly more: boolean } {
  const oldest = page.entries.at(-1);
  const fresh = new Set(page.entries.map(keyOf));
  const kept = known.filter((e) => !fresh.has(keyOf(e)) && (oldest === undefined || e.last < oldest.last));
  const touches = !page.more || known.some((e) => fresh.has(keyOf(e)));
  if (!touches) return { entries: page.entries, more: page.more };
  return { entries: [...page.entries, ...kept].slice(0, KEPT), more: kept.length > 0 ? more : page.more };
}

/** Returns a key that stays the same while an entry grows. */
export function keyOf(entry: HistoryEntry): string {
  return `${entry.first}:${entry.author}`;
}

/** The entry that a clock lies in or follows: what was done last then. */
export function entryAt(entries: readonly HistoryEntry[], clock: number): HistoryEntry | null {
  return entries.find((e) => e.last === clock) ?? entries.find((e) => e.first <= clock) ?? null;
}
