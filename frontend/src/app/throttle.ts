/** Calls `send` at most once per interval: at once when it is free, else at the end of the interval. */
export class Throttle {
  readonly #intervalMs: number;
  readonly #send: () => void;
  #timer: ReturnType<typeof setTimeout> | null = null;
  #last = Number.NEGATIVE_INFINITY;
  readonly #now: () => number;

  constructor(perSecond: number, send: () => void, now: () => number = () => performance.now()) {
    this.#intervalMs = 1000 / perSecond;
    this.#send = send;
    this.#now = now;
  }

  /** Asks for a call; several requests within one interval become one call, made with the state of its end. */
  request(): void {
    if (this.#timer !== null) return;
    const wait = this.#last + this.#intervalMs - this.#now();
    if (wait <= 0) this.#fire();
    else this.#timer = setTimeout(() => this.#fire(), wait);
  }

  stop(): void {
    if (this.#timer !== null) clearTimeout(this.#timer);
    this.#timer = null;
  }

  #fire(): void {
    this.#timer = null;
    this.#last = this.#now();
    this.#send();
  }
}
