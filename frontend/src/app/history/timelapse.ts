/** Showing earlier states one by one: a click on the list, the slider, a time lapse, a copy. */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import { ApiError, api } from "../server/api.ts";
import { terrainPath } from "../server/links.ts";
import type { ToastList } from "../toasts.ts";
import { Pace } from "./pace.ts";
import type { Past } from "./past.ts";

const TICK_MS = 100;

/** What a time lapse needs of the terrain that it shows. */
export interface TimeLapseTerrain {
  readonly id: string;
  readonly secret: string;
  readonly past: Past;
  readonly newest: ReadonlySignal<number>;
  readonly toasts: ToastList;
  /** Gives up what is being drawn or laid: it belongs to the present. */
  leavePresent(): void;
}

export class TimeLapse {
  readonly playing = signal(false);
  readonly speed = signal(1);
  readonly copying = signal(false);
  readonly #terrain: TimeLapseTerrain;
  readonly #pace = new Pace();
  #timer: ReturnType<typeof setInterval> | undefined;
  #at = 0;

  constructor(terrain: TimeLapseTerrain) {
    this.#terrain = terrain;
  }

  /** Stops at a clock and shows it. */
  show(clock: number): void {
    this.pause();
    this.#enter(clock);
  }

  /** Goes on from what is shown; from the beginning in the present, and at the end. */
  play(): void {
    const { past, newest } = this.#terrain;
    const at = past.wanted.peek();
    const from = at === null || at >= newest.peek() ? 0 : at;
    this.#pace.start(from);
    this.#enter(from);
    this.#at = performance.now();
    this.playing.value = true;
    clearInterval(this.#timer);
    this.#timer = setInterval(() => this.#tick(), TICK_MS);
  }

  pause(): void {
    clearInterval(this.#timer);
    this.playing.value = false;
  }

  /** Back to now; false when that is what is shown. */
  leave(): boolean {
    const { past } = this.#terrain;
    if (!past.active.peek()) return false;
    this.pause();
    past.leave();
    return true;
  }

  /** A new terrain as this one was at what is shown; the page goes there. */
  async copy(): Promise<void> {
    const terrain = this.#terrain;
    const clock = terrain.past.wanted.peek();
    if (clock === null || this.copying.peek()) return;
    this.pause();
    this.copying.value = true;
    try {
      const { id, secret } = await api.fork(terrain.id, terrain.secret, clock);
      window.location.assign(terrainPath(id, secret));
    } catch (error) {
      terrain.toasts.show(error instanceof ApiError ? error.message : "The copy failed. Try again.", "warn");
    } finally {
      this.copying.value = false;
    }
  }

  #enter(clock: number): void {
    const { past } = this.#terrain;
    if (!past.active.peek()) this.#terrain.leavePresent();
    past.look(clock);
  }

  #tick(): void {
    const { past, newest } = this.#terrain;
    if (!past.active.peek()) {
      this.pause();
      return;
    }
    const now = performance.now();
    const seconds = (now - this.#at) / 1000;
    this.#at = now;
    // Where the server does not keep up with the pace, steps become longer; it never falls behind.
    const clock = this.#pace.advance(seconds, newest.peek(), this.speed.peek());
    past.look(clock);
    if (clock >= newest.peek()) this.pause();
  }
}
