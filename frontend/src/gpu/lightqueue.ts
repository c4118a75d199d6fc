/**
 * Which tiles need their sun and sky visibility marched anew, and when (DESIGN 9: only when the tile or the sun changes).
 *
 * A tile that has just entered has no light at all and never waits. The others may show light that is a few frames old
 * while somebody draws.
 */

import type { Vec3 } from "../core/types.ts";
import type { Atlas, Resident } from "./atlas.ts";
import type { SunPass } from "./tilecompute.ts";

export interface LightFacts {
  readonly sizeM: number;
  readonly high: number;
  readonly sun: Vec3;
}

export class LightQueue {
  private readonly stale = new Set<Resident>();
  private readonly fresh = new Set<Resident>();
  private sunKey = "";

  constructor(
    private readonly pass: SunPass,
    private readonly atlas: Atlas,
  ) {}

  /** Takes in what changed since the last frame. */
  mark(changed: readonly Resident[], entered: readonly Resident[], sun: Vec3): void {
    const key = sun.join();
    if (this.atlas.groundMoved || key !== this.sunKey) {
      // Shadows are long: any change of ground may touch any tile.
      for (const resident of this.atlas.residents()) this.stale.add(resident);
    } else {
      for (const resident of changed) this.stale.add(resident);
      // A new tile refines the ground that the light of its neighbours was marched on.
      if (entered.length > 0)
        for (const resident of this.atlas.residents())
          if (entered.some((e) => touches(e, resident))) this.stale.add(resident);
    }
    this.sunKey = key;
    for (const resident of entered) this.fresh.add(resident);
  }

  /** True when tiles of the last cut still show old light. */
  get pending(): boolean {
    for (const resident of this.stale) if (this.atlas.isCurrent(resident)) return true;
    return false;
  }

  /** Marches the new tiles and up to `budget` others of the last cut, coarse first. */
  run(encoder: GPUCommandEncoder, facts: LightFacts, budget: number): void {
    const jobs = [...this.fresh].filter((r) => this.atlas.holds(r));
    this.fresh.clear();
    for (const job of jobs) this.stale.delete(job);
    const due: Resident[] = [];
    for (const resident of this.stale) {
      if (!this.atlas.holds(resident)) this.stale.delete(resident);
      else if (this.atlas.isCurrent(resident)) due.push(resident);
    }
    due.sort((a, b) => a.level - b.level);
    for (const job of due.slice(0, Math.max(0, budget - jobs.length))) {
      jobs.push(job);
      this.stale.delete(job);
    }
    this.pass.run(encoder, facts.sizeM, this.atlas.levels, facts.high, facts.sun, jobs);
  }
}

function touches(a: Resident, b: Resident): boolean {
  return a.level === b.level && Math.abs(a.x - b.x) <= 1 && Math.abs(a.y - b.y) <= 1;
}
