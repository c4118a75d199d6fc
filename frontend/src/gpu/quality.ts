/**
 * Keeps frames short: while the picture moves, resolution and detail follow the measured time of the device; a picture
 * that has come to rest is drawn once more at full quality.
 */

/** Frames longer than this lower the quality, milliseconds. */
export const SLOW_MS = 40;
const FAST_MS = 18;
const LOWEST_SCALE = 0.5;
const STEP = 0.85;

export interface Quality {
  /** Drawn pixels per canvas pixel, along one side. */
  readonly scale: number;
  /** Factor on the screen-error bound. */
  readonly tauFactor: number;
}

export class QualityControl {
  private moving: number;
  private readonly start: number;
  private movedAt = Number.NEGATIVE_INFINITY;
  private drawn: Quality = { scale: 1, tauFactor: 1 };

  /** `software`: the adapter draws on the CPU: begin low, come to rest at full resolution but coarser patches. */
  constructor(private readonly software: boolean) {
    this.start = software ? 0.75 : 1;
    this.moving = this.start;
  }

  /** Quality for a frame at `now` (ms); `moved`: the picture differs from the last one. */
  next(now: number, moved: boolean): Quality {
    if (moved) this.movedAt = now;
    const still = now - this.movedAt >= this.restMs;
    this.drawn = still ? this.rest : { scale: this.moving, tauFactor: this.software ? 2 : 1 / this.moving };
    return this.drawn;
  }

  /** Quality of a picture at rest. */
  get rest(): Quality {
    return { scale: 1, tauFactor: this.software ? 1.5 : 1 };
  }

  /** True while a better picture than the last one is due. */
  get pending(): boolean {
    return this.drawn.scale < 1;
  }

  /** Milliseconds without change after which the picture counts as still. */
  get restMs(): number {
    return this.software ? 300 : 60;
  }

  /** Takes in the measured time of a frame that was drawn at the moving quality. */
  measured(frameMs: number): void {
    if (this.drawn.scale >= 1 && this.moving < 1) return;
    if (frameMs > SLOW_MS) this.moving = Math.max(LOWEST_SCALE, this.moving * STEP);
    else if (frameMs < FAST_MS) this.moving = Math.min(this.start, this.moving / STEP);
  }
}
