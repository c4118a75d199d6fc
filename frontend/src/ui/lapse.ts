/** Showing earlier states one by one: a click on the list, the slider, a time lapse, a copy. */

import { signal } from "@preact/signals-core";
import { ApiError, api } from "./api.ts";
import { terrainPath } from "./links.ts";
import type { TerrainSession } from "./session.ts";
import { Timelapse } from "./timelapse.ts";

const TICK_MS = 100;

export class Lapse {
  readonly playing = signal(false);
  readonly speed = signal(1);
  readonly copying = signal(false);
  readonly #session: TerrainSession;
  readonly #pace = new Timelapse();
  #timer: ReturnType<typeof setInterval> | undefined;
  #at = 0;

  constructor(session: TerrainSession) {
    this.#session = session;
  }

  /** Stops at a clock and shows it. */
  show(clock: number): void {
    this.pause();
    this.#enter(clock);
  }

  /** Goes on from what is shown; from the beginning in the present, and at the end. */
  play(): void {
    const { past, newest } = this.#session;
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
    const { past } = this.#session;
    if (!past.active.peek()) return false;
    this.pause();
    past.leave();
    return true;
  }

  /** A new terrain as this one was at what is shown; the page goes there. */
  async copy(): Promise<void> {
    const session = this.#session;
    const clock = session.past.wanted.peek();
    if (clock === null || this.copying.peek()) return;
    this.pause();
    this.copying.value = true;
    try {
      const { id, secret } = await api.fork(session.id, session.secret, clock);
      window.location.assign(terrainPath(id, secret));
    } catch (error) {
      session.toasts.show(error instanceof ApiError ? error.message : "The copy failed. Try again.", "warn");
    } finally {
      this.copying.value = false;
    }
  }

  #enter(clock: number): void {
    const { past, stage } = this.#session;
    const input = stage.peek()?.input;
    if (input && !past.active.peek()) {
      // What is being drawn or laid belongs to the present.
      input.actions.get("cancel")?.run();
      input.laying.peek()?.cancel();
      input.selection.value = null;
    }
    past.look(clock);
  }

  #tick(): void {
    const { past, newest } = this.#session;
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
