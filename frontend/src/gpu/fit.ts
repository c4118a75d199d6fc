/**
 * Coarsens the ground where a view asks for more tiles than the atlas has slots: the error bound then grows to what fits,
 * evenly over the picture. Without it the finest levels would push each other out for ever.
 *
 * While nothing moves the bound only grows, so a picture at rest is reached after finitely many frames.
 */

/** The bound grows by this much at a time. */
const STEP = 1.15;
/** When the picture moves and so little of the atlas is needed, the bound comes down again. */
const SLACK = 0.7;
/** Slots left for tiles that are on their way in. */
const SPARE = 16;
const COARSEST = 32;

export class Fit {
  #factor = 1;

  /** Factor on the screen-error bound, at least 1. */
  get factor(): number {
    return this.#factor;
  }

  /** Starts a frame; `needed`: tiles that the last cut rested on and lacked. */
  begin(moved: boolean, needed: number, capacity: number): void {
    if (moved && needed < SLACK * capacity) this.#factor = Math.max(1, this.#factor / STEP);
  }

  /** Takes in what a cut needs. True when it does not fit: the bound has grown, and the cut must be chosen anew. */
  exceeded(needed: number, capacity: number): boolean {
    if (needed <= capacity - SPARE || this.#factor >= COARSEST) return false;
    this.#factor = Math.min(COARSEST, this.#factor * STEP);
    return true;
  }
}
