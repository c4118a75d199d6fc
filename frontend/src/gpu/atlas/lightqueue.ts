/**
 * The queue of tiles whose sun and sky visibility is marched anew (DESIGN 9: only when the tile or the sun changes). A
 * tile that has just entered has no light at all and never waits. The others may show light that is a few frames old
 * while somebody draws. Where the march costs too much, synthetic tiles take their light over from their parents.
 */

import type { Vec3 } from "../../core/types.ts";
import { SELF_BIT } from "./apron.ts";
import type { Atlas, Resident } from "./atlas.ts";
import type { TakeLightPass } from "./takelight.ts";
import type { SunPass } from "./tilecompute.ts";

export interface LightFacts {
  readonly sizeM: number;
  readonly high: number;
  readonly sun: Vec3;
}

export class LightQueue {
  readonly #stale = new Set<Resident>();
  readonly #fresh = new Set<Resident>();
  /** Tiles whose light is their parent's. */
  readonly #taken = new WeakSet<Resident>();
  #sunKey = "";

  readonly #pass: SunPass;
  readonly #atlas: Atlas;
  readonly #taking: TakeLightPass | null;

  constructor(pass: SunPass, atlas: Atlas, taking: TakeLightPass | null = null) {
    this.#pass = pass;
    this.#atlas = atlas;
    this.#taking = taking;
  }

  /** Takes in what changed since the last frame. */
  mark(changed: readonly Resident[], entered: readonly Resident[], sun: Vec3): void {
    const key = sun.join();
    if (this.#atlas.groundMoved || key !== this.#sunKey) {
      // Shadows are long: any change of ground may touch any tile.
      for (const resident of this.#atlas.residents()) this.#stale.add(resident);
    } else {
      for (const resident of changed) this.#stale.add(resident);
      // A new tile refines the ground that the light of its neighbours was marched on.
      if (entered.length > 0)
        for (const resident of this.#atlas.residents())
          if (entered.some((e) => touches(e, resident))) this.#stale.add(resident);
    }
    this.#sunKey = key;
    for (const resident of entered) this.#fresh.add(resident);
  }

  /** True when tiles of the last cut still show old light. */
  get pending(): boolean {
    for (const resident of this.#stale) if (this.#atlas.isCurrent(resident) && !this.#takes(resident)) return true;
    return false;
  }

  /** Marches the new tiles and up to `budget` others of the last cut, coarse first. */
  run(encoder: GPUCommandEncoder, facts: LightFacts, budget: number): void {
    const anew = [...this.#fresh].filter((r) => this.#atlas.holds(r));
    const jobs = anew.filter((r) => !this.#takes(r));
    this.#fresh.clear();
    for (const job of anew) this.#stale.delete(job);
    const changed = new Set(anew);
    const due: Resident[] = [];
    for (const resident of this.#stale) {
      if (!this.#atlas.holds(resident)) this.#stale.delete(resident);
      else if (this.#takes(resident)) {
        // The tile follows its parent: light that was marched while the tile was held is not its own any more.
        if (!this.#taken.has(resident)) changed.add(resident);
        this.#stale.delete(resident);
      } else if (this.#atlas.isCurrent(resident)) due.push(resident);
    }
    due.sort((a, b) => a.level - b.level);
    for (const job of due.slice(0, Math.max(0, budget - jobs.length))) {
      jobs.push(job);
      this.#stale.delete(job);
    }
    this.#pass.run(encoder, facts.sizeM, facts.high, facts.sun, jobs);
    for (const job of jobs) {
      changed.add(job);
      this.#taken.delete(job);
    }
    this.#taking?.run(encoder, this.#takers(changed));
  }

  #takes(resident: Resident): boolean {
    return this.#taking !== null && (resident.held & SELF_BIT) === 0;
  }

  /** The tiles that take the light over that these tiles have now, each after its parent. */
  #takers(changed: Set<Resident>): Resident[] {
    if (this.#taking === null || changed.size === 0) return [];
    const found: Resident[] = [];
    for (const resident of [...this.#atlas.residents()].sort((a, b) => a.level - b.level)) {
      if (!this.#takes(resident)) continue;
      if (!changed.has(resident) && !changed.has(this.#atlas.parentOf(resident))) continue;
      changed.add(resident);
      this.#taken.add(resident);
      found.push(resident);
    }
    return found;
  }
}

function touches(a: Resident, b: Resident): boolean {
  return a.level === b.level && Math.abs(a.x - b.x) <= 1 && Math.abs(a.y - b.y) <= 1;
}
