/** The lakes of a terrain while it changes: found anew a few times a second, their levels ease over. */

import type { FloodVisual, TileView } from "../../core/types.ts";
import { LAKE_LEVEL, NO_LAKE, type TerrainSettings, TILE_CELLS } from "../../generated/contract.ts";
import { withFlood } from "./flooded.ts";
import { findLakes, type Lakes, lakeGround, Surfaces } from "./lakes.ts";

/** Lakes as they are drawn. */
export interface ShownLakes {
  /** Null without a lake. */
  readonly lakes: Lakes | null;
  /** How high each lake stands now, by its level: metres. One that is not there is not drawn. */
  readonly heights: ReadonlyMap<number, number>;
}

/** Ground that changes is flooded anew after so long. */
const REST_MS = 250;
/** Levels come this much nearer (1 - 1/e) in so long. */
const EASE_MS = 260;
/** Nearer than this they are there, in cells. */
const THERE = 1e-3;

type Rule = Pick<TerrainSettings, "lakes_m" | "sea_level_m">;
type Later = (run: () => void) => void;

export class LakeWatch implements ShownLakes {
  /** The lakes that are drawn; null without any. The object stays the same until the samples change. */
  lakes: Lakes | null = null;
  /** How high each lake stands now, by its level: metres. */
  readonly heights = new Map<number, number>();
  /** How high water may stand on patches. */
  surfaces = new Surfaces(null, Number.NEGATIVE_INFINITY);
  readonly #targets = new Map<number, number>();
  #view: TileView | null = null;
  #rule: Rule = { lakes_m: null, sea_level_m: null };
  #flood: FloodVisual | null = null;
  #ground: Float32Array | null = null;
  #stamp = -1;
  #asked = Number.NEGATIVE_INFINITY;
  #easedAt = 0;
  #waiting = false;
  #fresh = false;

  readonly #later: Later;

  /** `later` runs what must not hold up a frame. */
  constructor(later: Later = (run) => setTimeout(run, 0)) {
    this.#later = later;
  }

  /** Lakes are being looked for, or will be; or their levels ease. */
  get busy(): boolean {
    return this.#waiting || this.#stale || this.#moving;
  }

  /**
   * Follows a scene; `smooth`: levels ease over. True when what is drawn has changed. `now`: milliseconds. `flood`: lakes
   * that were poured out.
   */
  update(
    view: TileView,
    { lakes_m, sea_level_m }: Rule,
    now: number,
    smooth: boolean,
    flood: FloodVisual | null = null,
  ): boolean {
    const other = view !== this.#view;
    const ruled = lakes_m !== this.#rule.lakes_m || sea_level_m !== this.#rule.sea_level_m || flood !== this.#flood;
    this.#flood = flood;
    if (other) this.#forget();
    if (other || ruled) this.#stamp = -1;
    this.#view = view;
    this.#rule = { lakes_m, sea_level_m };
    const began = this.lakes;
    if (this.#isDry) {
      if (this.lakes !== null || ruled) this.#forget();
      this.#stamp = view.stamp;
    } else if (this.#stale && !this.#waiting && (ruled || now - this.#asked >= REST_MS)) {
      this.#waiting = true;
      this.#asked = now;
      this.#later(() => this.#find(smooth));
    }
    if (this.surfaces.seaM !== (sea_level_m ?? Number.NEGATIVE_INFINITY)) this.#level();
    const eased = this.#ease(now, smooth);
    const changed = eased || this.#fresh || began !== this.lakes;
    this.#fresh = false;
    return changed;
  }

  /** There is nothing to look for. */
  get #isDry(): boolean {
    return this.#rule.lakes_m === null && this.#flood === null;
  }

  get #stale(): boolean {
    return this.#view !== null && !this.#isDry && this.#stamp !== this.#view.stamp;
  }

  get #moving(): boolean {
    for (const [level, at] of this.heights) if (at !== this.#targets.get(level)) return true;
    return false;
  }

  #forget(): void {
    this.#fresh = this.lakes !== null;
    this.lakes = null;
    this.#ground = null;
    this.heights.clear();
    this.#targets.clear();
    this.#level();
  }

  #level(): void {
    this.surfaces = new Surfaces(this.lakes, this.#rule.sea_level_m ?? Number.NEGATIVE_INFINITY);
  }

  #find(smooth: boolean): void {
    this.#waiting = false;
    const view = this.#view;
    const rule = this.#rule;
    if (view === null || this.#isDry) return;
    const ruled = this.#stamp === -1;
    this.#stamp = view.stamp;
    const ground = lakeGround(view);
    if (ground === null || (!ruled && this.#ground !== null && sameGround(ground, this.#ground))) return;
    this.#ground = ground;
    const cellM = view.sizeM / (TILE_CELLS << LAKE_LEVEL);
    const side = Math.sqrt(ground.length);
    const leastM = rule.lakes_m ?? Number.POSITIVE_INFINITY;
    const found = findLakes(ground, side, { cellM, leastM, seaM: rule.sea_level_m });
    this.#take(this.#flood === null ? found : withFlood(found, this.#flood), smooth);
    this.#fresh = true;
  }

  /** Old lakes become new ones, new ones rise from their bed, lost ones sink into it. */
  #take(found: Lakes, smooth: boolean): void {
    const old = this.lakes;
    const now = new Map(this.heights);
    this.heights.clear();
    this.#targets.clear();
    for (const level of found.samples.keys()) this.#targets.set(level, level);
    if (!smooth) {
      for (const level of found.samples.keys()) this.heights.set(level, level);
      this.lakes = found.samples.size > 0 ? found : null;
    } else {
      const from = startingHeights(found, old, now);
      for (const [level, at] of from) this.heights.set(level, at);
      this.lakes = old === null ? found : this.#withLost(found, old, now);
      if (this.#targets.size === 0) this.lakes = null;
    }
    this.#level();
  }

  /** `found`, with samples of lakes that sink for as long as they do. */
  #withLost(found: Lakes, old: Lakes, now: ReadonlyMap<number, number>): Lakes {
    const { heights } = found;
    const levels = found.levels.slice();
    const heirs = new Map<number, number>();
    for (let i = 0; i < levels.length; i += 1) {
      const [next, before] = [found.levels[i]!, old.levels[i]!];
      if (next !== NO_LAKE && before !== NO_LAKE && heights[i]! < next) heirs.set(before, next);
    }
    const beds = new Map<number, number>();
    const samples = new Map(found.samples);
    for (let i = 0; i < levels.length; i += 1) {
      const before = old.levels[i]!;
      if (levels[i] !== NO_LAKE || before === NO_LAKE || !now.has(before)) continue;
      const heir = heirs.get(before);
      if (heir !== undefined) {
        if (heights[i]! >= heir) levels[i] = heir;
        continue;
      }
      levels[i] = before;
      if (heights[i]! < before) beds.set(before, Math.min(beds.get(before) ?? before, heights[i]!));
    }
    for (const [level, bed] of beds) {
      if (this.#targets.has(level)) continue;
      this.heights.set(level, now.get(level)!);
      this.#targets.set(level, bed);
      samples.set(level, old.samples.get(level) ?? 0);
    }
    return { ...found, levels, samples };
  }

  /** Brings levels nearer to where they belong; true when one moved. */
  #ease(now: number, smooth: boolean): boolean {
    const passed = Math.min(now - this.#easedAt, 100);
    this.#easedAt = now;
    if (!this.#moving) return false;
    const share = smooth ? 1 - Math.exp(-passed / EASE_MS) : 1;
    const near = (THERE * (this.#view?.sizeM ?? 0)) / (TILE_CELLS << LAKE_LEVEL);
    for (const [level, at] of this.heights) {
      const target = this.#targets.get(level)!;
      const next = at + (target - at) * share;
      this.heights.set(level, Math.abs(target - next) <= near ? target : next);
      // A lost lake that has sunk is gone.
      if (target !== level && this.heights.get(level) === target) {
        this.heights.delete(level);
        this.#targets.delete(level);
      }
    }
    return true;
  }
}

/** From where each lake of `found` rises or falls: where the one before it stands, else its bed. */
function startingHeights(found: Lakes, old: Lakes | null, now: ReadonlyMap<number, number>): Map<number, number> {
  const beds = new Map<number, number>();
  const stood = new Map<number, number>();
  for (let i = 0; i < found.levels.length; i += 1) {
    const level = found.levels[i]!;
    const z = found.heights[i]!;
    if (level === NO_LAKE || z >= level) continue;
    beds.set(level, Math.min(beds.get(level) ?? level, z));
    const before = old === null ? undefined : now.get(old.levels[i]!);
    if (before !== undefined && before > z) stood.set(level, Math.max(stood.get(level) ?? before, before));
  }
  for (const [level, at] of stood) beds.set(level, at);
  return beds;
}

function sameGround(a: Float32Array, b: Float32Array): boolean {
  for (let i = 0; i < a.length; i += 1) if (a[i] !== b[i]) return false;
  return true;
}
