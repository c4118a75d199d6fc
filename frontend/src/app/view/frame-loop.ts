/** Draws frames only while something changes: a still page costs nothing. */
export class FrameLoop {
  /** Frames drawn since the start. */
  frames = 0;
  readonly #draw: (dtS: number, timeS: number) => boolean;
  #request: number | null = null;
  #last: number | null = null;
  #running = false;

  /** `draw` gets the seconds since the last frame (at most 0.1) and since the start; true asks for another frame. */
  constructor(draw: (dtS: number, timeS: number) => boolean) {
    this.#draw = draw;
  }

  start(): void {
    this.#running = true;
    this.invalidate();
  }

  stop(): void {
    this.#running = false;
    if (this.#request !== null) cancelAnimationFrame(this.#request);
    this.#request = null;
  }

  /** Something that is seen has changed. */
  invalidate(): void {
    if (!this.#running || this.#request !== null) return;
    this.#request = requestAnimationFrame((now) => this.#frame(now));
  }

  #frame(nowMs: number): void {
    this.#request = null;
    const dt = this.#last === null ? 1 / 60 : (nowMs - this.#last) / 1000;
    const again = this.#draw(Math.min(dt, 0.1), nowMs / 1000);
    this.frames++;
    this.#last = again ? nowMs : null;
    if (again) this.invalidate();
  }
}
