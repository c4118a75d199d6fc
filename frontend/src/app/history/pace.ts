/** The pace of a time lapse: drawing as fast as it was drawn, pauses left out, and never longer than half a minute. */

/** Ops of one who draws, a second. */
const DRAWING_RATE = 30;
const LONGEST_S = 30;
export const SPEEDS = [0.5, 1, 2, 4] as const;

export class Pace {
  #at = 0;

  /** Begins at a clock. */
  start(clock: number): void {
    this.#at = clock;
  }

  /** Goes on for a while: the clock then, `newest` at most. */
  advance(seconds: number, newest: number, speed: number): number {
    this.#at = Math.min(newest, this.#at + seconds * speed * rate(newest));
    return Math.floor(this.#at);
  }
}

/** Clocks a second at speed 1 for a history of so many. */
export function rate(newest: number): number {
  return Math.max(DRAWING_RATE, newest / LONGEST_S);
}
