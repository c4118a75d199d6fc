/** Showing earlier states one by one: a click on the list, the slider, a time lapse, a copy. */

import { msg } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import { ApiError, api } from "../server/api.ts";
import { terrainPath } from "../server/links.ts";
import type { ToastList } from "../toasts.ts";
import type { HistoryView } from "./history-view.ts";
import { Pace } from "./pace.ts";

const TICK_MS = 100;

/** The parts of a terrain that a time lapse needs. */
export interface TimeLapseTerrain {
  readonly id: string;
  readonly secret: string;
  readonly historyView: HistoryView;
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
    const { historyView, newest } = this.#terrain;
    const at = historyView.wanted.peek();
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
    const { historyView } = this.#terrain;
    if (!historyView.active.peek()) return false;
    this.pause();
    historyView.leave();
    return true;
  }

  /** A new terrain as this one was at what is shown; the page goes there. */
  async copy(): Promise<void> {
    const terrain = this.#terrain;
    const clock = terrain.historyView.wanted.peek();
    if (clock === null || this.copying.peek()) return;
    this.pause();
    this.copying.value = true;
    try {
      const { id, secret } = await api.fork(terrain.id, terrain.secret, clock);
      window.location.assign(terrainPath(id, secret));
    } catch (error) {
      terrain.toasts.show(error instanceof ApiError ? error.message : msg("The copy failed. Try again."), "warn");
    } finally {
      this.copying.value = false;
    }
  }

  #enter(clock: number): void {
    const { historyView } = this.#terrain;
    if (!historyView.active.peek()) this.#terrain.leavePresent();
    historyView.look(clock);
  }

  #tick(): void {
    const { historyView, newest } = this.#terrain;
    if (!historyView.active.peek()) {
      this.pause();
      return;
    }
    const now = performance.now();
    const seconds = (now - this.#at) / 1000;
    this.#at = now;
    // Where the server does not keep up with the pace, steps become longer; it never falls behind.
    const clock = this.#pace.advance(seconds, newest.peek(), this.speed.peek());
    historyView.look(clock);
    if (clock >= newest.peek()) this.pause();
  }
}
