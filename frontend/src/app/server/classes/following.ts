/** A page of a class goes where its teacher leads, and comes back. The way back is kept for as long as the tab lives. */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { InClass, Shown } from "../../../generated/contract.ts";
import { terrainPath } from "../links.ts";

const BACK = "esker.class.back";
/** So long a line that is being drawn has to end before the page leaves. */
const LEAVE_MS = 4000;

/** The part of the browser that is used; tests bring their own. */
export interface Ways {
  readonly kept: Pick<Storage, "getItem" | "setItem" | "removeItem">;
  go(path: string): void;
}

const browser = (): Ways => ({
  kept: window.sessionStorage,
  go: (path) => {
    window.location.href = path;
    // Another secret of the same terrain changes the fragment alone, and main.ts reloads the page then.
  },
});

export class Following {
  readonly #id: string;
  readonly #own: string;
  readonly #ways: Ways;
  readonly #leaveMs: number;
  readonly #invitation = signal<Shown | null>(null);
  readonly #away = signal(false);
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(id: string, secret: string, ways: Ways = browser(), leaveMs = LEAVE_MS) {
    this.#id = id;
    this.#own = terrainPath(id, secret);
    this.#ways = ways;
    this.#leaveMs = leaveMs;
    const back = ways.kept.getItem(BACK);
    if (back === this.#own) ways.kept.removeItem(BACK);
    else this.#away.value = back !== null;
  }

  /** Where the page is about to go. */
  get invitation(): ReadonlySignal<Shown | null> {
    return this.#invitation;
  }

  /** Whether the page looks at somebody else's copy, and goes back by itself. */
  get away(): ReadonlySignal<boolean> {
    return this.#away;
  }

  /** What the server said of the class; `closed`: the link to look has ended. */
  told(lesson: InClass | null, closed: boolean): void {
    if (this.#away.peek()) {
      if (closed || (lesson !== null && lesson.show?.terrain !== this.#id)) this.#back();
      return;
    }
    const show = lesson?.show ?? null;
    if (show === null || show.terrain === this.#id) {
      clearTimeout(this.#timer);
      this.#timer = undefined;
      this.#invitation.value = null;
    } else if (this.#invitation.peek()?.secret !== show.secret) {
      this.#invitation.value = show;
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.go(), this.#leaveMs);
    }
  }

  /** Goes at once. */
  go(): void {
    const show = this.#invitation.peek();
    if (show === null) return;
    this.stop();
    this.#ways.kept.setItem(BACK, this.#own);
    this.#ways.go(terrainPath(show.terrain, show.secret));
  }

  stop(): void {
    clearTimeout(this.#timer);
  }

  #back(): void {
    const back = this.#ways.kept.getItem(BACK);
    this.#ways.kept.removeItem(BACK);
    this.#away.value = false;
    if (back !== null) this.#ways.go(back);
  }
}
