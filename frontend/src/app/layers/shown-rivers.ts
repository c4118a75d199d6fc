/**
 * The rivers of the 3D view while they change: one that moves by less than a coarse cell moves at once, one that comes or goes
 * fades. The map that shaders read is made anew only when something changed.
 */

import type { RiverLine, RiverMap, RiverSet } from "../../core/types.ts";
import { LAKE_LEVEL, TILE_CELLS } from "../../generated/contract.ts";
import { riverMap, type ShownRiver } from "../../tiles/water/rivermap.ts";

const FADE_S = 0.6;
/** A river whose points are near those of before, all but this share of them, is the same river. */
const STRANGE = 0.3;
/** A fade is drawn in so many steps a second at most: each makes the map anew. */
const STEPS_PER_S = 20;

interface Fading extends ShownRiver {
  /** It fades to this share from that of `at`, when it began: seconds. */
  readonly from: number;
  readonly to: number;
  readonly at: number;
}

export class ShownRivers {
  readonly #sizeM: number;
  #set: RiverSet | null = null;
  #rivers: readonly Fading[] = [];
  #wetness = Number.NaN;
  #map: RiverMap | null = null;
  #madeAt = 0;
  #fading = false;

  constructor(sizeM: number) {
    this.#sizeM = sizeM;
  }

  /** Some come or go. */
  get fading(): boolean {
    return this.#fading;
  }

  /** The map of the rivers as they are shown at a time, seconds; at infinity nothing fades. */
  map(set: RiverSet | null, wetness: number, time: number): RiverMap | null {
    const changed = set !== this.#set || wetness !== this.#wetness;
    if (set !== this.#set) this.#take(set, time);
    this.#wetness = wetness;
    if (changed || (this.#fading && time - this.#madeAt >= 1 / STEPS_PER_S)) {
      this.#step(time);
      this.#madeAt = time;
      this.#map = riverMap(this.#rivers, this.#sizeM, wetness);
    }
    return this.#map;
  }

  #take(set: RiverSet | null, time: number): void {
    this.#step(time);
    const isFirst = this.#set === null;
    this.#set = set;
    const before = networkOf(this.#rivers.filter((r) => r.to === 1));
    const level = set?.level ?? 0;
    const coming = (set?.rivers ?? []).map((line): Fading => {
      const from = isFirst || isKnown(line, level, before) ? 1 : 0;
      return { line, level, share: from, from, to: 1, at: time };
    });
    const now = networkOf(coming);
    const going = this.#rivers
      .filter((r) => r.share > 0 && !isKnown(r.line, r.level, now))
      .map((r): Fading => ({ ...r, from: r.share, to: 0, at: time }));
    this.#rivers = [...going, ...coming];
  }

  #step(time: number): void {
    this.#rivers = this.#rivers.flatMap((river): Fading[] => {
      const passed = Number.isFinite(time) ? Math.min(1, Math.max(0, (time - river.at) / FADE_S)) : 1;
      const share = river.from + (river.to - river.from) * passed;
      return river.to === 0 && passed === 1 ? [] : [{ ...river, share }];
    });
    this.#fading = this.#rivers.some((r) => r.share !== r.to);
  }
}

const SIDE = TILE_CELLS << LAKE_LEVEL;

/** The coarse cells that rivers run through. */
function networkOf(rivers: readonly ShownRiver[]): Set<number> {
  const cells = new Set<number>();
  for (const { line, level } of rivers) for (const cell of cellsAlong(line, level)) cells.add(cell);
  return cells;
}

/** Whether a river runs where others do, give or take a coarse cell. */
function isKnown(line: RiverLine, level: number, network: ReadonlySet<number>): boolean {
  let [strange, all] = [0, 0];
  for (const cell of cellsAlong(line, level)) {
    all += 1;
    let isNear = false;
    for (let dy = -1; dy <= 1; dy += 1)
      for (let dx = -1; dx <= 1; dx += 1) isNear ||= network.has(cell + dy * (SIDE + 1) + dx);
    if (!isNear) strange += 1;
  }
  return strange <= STRANGE * all;
}

function* cellsAlong({ cells }: RiverLine, level: number): Generator<number> {
  const scale = 2 ** (LAKE_LEVEL - level);
  for (let i = 0; i + 3 < cells.length; i += 2) {
    const [ax, ay, bx, by] = [cells[i]! * scale, cells[i + 1]! * scale, cells[i + 2]! * scale, cells[i + 3]! * scale];
    const parts = Math.max(1, Math.ceil(Math.hypot(bx - ax, by - ay)));
    for (let k = 0; k <= parts; k += 1) {
      const [x, y] = [ax + ((bx - ax) * k) / parts, ay + ((by - ay) * k) / parts];
      yield Math.round(y) * (SIDE + 1) + Math.round(x);
    }
  }
}
