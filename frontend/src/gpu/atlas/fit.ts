/**
 * Coarsens the ground where a view asks for more tiles than the atlas has slots: the error bound then grows to what fits,
 * evenly over the picture. Without it the finest levels would push each other out for ever.
 *
 * Where less is needed than there is room for the bound comes down again, but while nothing moves never to one that did not
 * fit: a picture at rest is reached after finitely many frames.
 */

/** The bound grows by this much at a time. */
const STEP = 1.15;
/** When so little of the atlas is needed, the bound comes down again. */
const SLACK = 0.7;
/** Slots left for tiles that are on their way in. */
const SPARE = 16;
const COARSEST = 32;

export class Fit {
  #factor = 1;
  /** The coarsest bound that did not fit since the picture moved. */
  #failed = 0;
  #eased = false;

  /** Factor on the screen-error bound, at least 1. */
  get factor(): number {
    return this.#factor;
  }

  /** True when the bound came down in this frame: it may go on in the next. */
  get eased(): boolean {
    return this.#eased;
  }

  /** Starts a frame; `needed`: tiles that the last cut rested on and lacked. */
  begin(moved: boolean, needed: number, capacity: number): void {
    if (moved) this.#failed = 0;
    const finer = Math.max(1, this.#factor / STEP);
    this.#eased = needed < SLACK * capacity && finer < this.#factor && finer > 1.01 * this.#failed;
    if (this.#eased) this.#factor = finer;
  }

  /** Takes in what a cut needs. True when it does not fit: the bound has grown, and the cut must be chosen anew. */
  exceeded(needed: number, capacity: number): boolean {
    if (needed <= capacity - SPARE || this.#factor >= COARSEST) return false;
    this.#failed = Math.max(this.#failed, this.#factor);
    this.#factor = Math.min(COARSEST, this.#factor * STEP);
    return true;
  }
}
