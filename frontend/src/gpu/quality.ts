/**
 * Keeps frames short. While the picture moves, resolution and detail follow the measured time of the device, or stay as
 * somebody chose; a picture that has come to rest is drawn once more at full resolution.
 */

import type { QualityMode } from "../core/types.ts";

/** Frames longer than this lower the quality, milliseconds. */
export const SLOW_MS = 40;
const FAST_MS = 18;
const LOWEST_SCALE = 0.5;
const STEP = 0.85;
/** Below the lowest resolution only coarser ground helps: the error bound may grow by this much more. */
const COARSEST = 2.5;

export interface Quality {
  /** Drawn pixels per canvas pixel, along one side. */
  readonly scale: number;
  /** Factor on the screen-error bound. */
  readonly tauFactor: number;
}

/** Resolution while the picture moves, of the modes that do not follow the frame rate. */
const FIXED_SCALE: Readonly<Record<Exclude<QualityMode, "automatic">, number>> = { fast: 0.5, balanced: 0.75, fine: 1 };

export class QualityControl {
  /** Somebody's choice: `automatic` holds the frame rate, the others hold the error bound that the scene asks for. */
  mode: QualityMode = "automatic";
  /** Resolution of the automatic mode, and how much coarser its ground is on top of that. */
  #moving: number;
  #coarser = 1;
  readonly #start: number;
  #movedAt = Number.NEGATIVE_INFINITY;
  #drawn: Quality = { scale: 1, tauFactor: 1 };

  readonly #software: boolean;

  /** `software`: the adapter draws on the CPU: begin low, come to rest at full resolution but coarser patches. */
  constructor(software: boolean) {
    this.#software = software;
    this.#start = software ? 0.75 : 1;
    this.#moving = this.#start;
  }

  /** Quality for a frame at `now` (ms); `moved`: the picture differs from the last one. */
  next(now: number, moved: boolean): Quality {
    if (moved) this.#movedAt = now;
    const still = now - this.#movedAt >= this.restMs;
    this.#drawn = still ? this.rest : this.#inMotion;
    return this.#drawn;
  }

  /** Quality of a picture at rest. */
  get rest(): Quality {
    return { scale: 1, tauFactor: this.#software && this.mode === "automatic" ? 1.5 : 1 };
  }

  /** True while a better picture than the last one is due. */
  get pending(): boolean {
    return this.#drawn.scale < 1;
  }

  /** Milliseconds without change after which the picture counts as still. */
  get restMs(): number {
    return this.#software ? 300 : 60;
  }

  /** Takes in the measured time of a frame. Only frames of the automatic mode's moving quality say what that should be. */
  measured(frameMs: number): void {
    if (this.mode !== "automatic" || (this.#drawn.scale >= 1 && this.#moving < 1)) return;
    if (frameMs > SLOW_MS) {
      if (this.#moving > LOWEST_SCALE) this.#moving = Math.max(LOWEST_SCALE, this.#moving * STEP);
      else this.#coarser = Math.min(COARSEST, this.#coarser / STEP);
    } else if (frameMs < FAST_MS) {
      if (this.#coarser > 1) this.#coarser = Math.max(1, this.#coarser * STEP);
      else this.#moving = Math.min(this.#start, this.#moving / STEP);
    }
  }

  get #inMotion(): Quality {
    if (this.mode !== "automatic") return { scale: FIXED_SCALE[this.mode], tauFactor: 1 };
    return { scale: this.#moving, tauFactor: (this.#software ? 2 : 1 / this.#moving) * this.#coarser };
  }
}
