/**
 * The tiles that the page holds, as they are drawn now (DESIGN 6, 8). The only owner of that state.
 *
 * Levels arrive coarse to fine, and while somebody draws the fine ones lag. A tile whose ancestor moved is shown as its
 * last exact samples plus the parent's movement since then, predicted by the codec's own rule, until its level is
 * confirmed: full detail that morphs with the coarse levels. Movements are taken from the parent's heights at the time
 * when the child was exact, never accumulated, so nothing drifts and equal edges stay equal to the bit.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import { subDistance, subRange } from "../core/bounds.ts";
import { predictMetres } from "../core/predict.ts";
import { isUnderAny, keyLevel, parentKey, tileKey } from "../core/tilekey.ts";
import type { DecodedFrame, DecodedTile, Ground, Tile, TileView } from "../core/types.ts";
import { FrameKind, QUANTA_PER_CELL, SUBPATCHES, TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";
import { TileGround } from "./ground.ts";

const AREA = TILE_SAMPLES * TILE_SAMPLES;
const SUBS = SUBPATCHES * SUBPATCHES;

/** A tile, its exact heights, and its parent's heights at the time when the tile was exact. */
interface Entry {
  readonly tile: Tile;
  readonly exactHeights: Float32Array;
  readonly parentThen: Float32Array | null;
}

export class TileStore implements TileView {
  readonly sizeM: number;
  readonly levels: number;
  readonly solved: number;
  /** The same as `stamp`, to subscribe to. */
  readonly revision: ReadonlySignal<number>;
  /** The ground as it is now; `freeze` gives one that stays. */
  readonly ground: Ground;
  private readonly rev = signal(0);
  private entries = new Map<number, Entry>();
  private snapshot: { readonly stamp: number; readonly ground: TileGround } | null = null;
  /** Per level that is held: whether what was last said of all its tiles is final. */
  private readonly finals = new Map<number, boolean>();
  private readonly delta = new Float32Array(AREA);
  private readonly moved = new Float32Array(AREA);
  private readonly distance = new Float64Array(SUBS);

  /** `levels`: the finest level that can exist; `solved`: the finest that exists everywhere. */
  constructor(sizeM: number, levels: number, solved = levels) {
    this.sizeM = sizeM;
    this.levels = levels;
    this.solved = solved;
    this.revision = this.rev;
    this.ground = {
      sizeM,
      heightAt: (x, y) => this.freeze().heightAt(x, y),
      raycast: (ray) => this.freeze().raycast(ray),
    };
  }

  get stamp(): number {
    return this.rev.peek();
  }

  /** True unless some level that is solved everywhere was last seen as a preview: its samples may be a little off. */
  get settled(): boolean {
    for (const [level, final] of this.finals) if (level <= this.solved && !final) return false;
    return true;
  }

  tile(level: number, x: number, y: number): Tile | undefined {
    return this.entries.get(tileKey(level, x, y))?.tile;
  }

  *tiles(): Iterable<Tile> {
    for (const entry of this.entries.values()) yield entry.tile;
  }

  /** Number of tiles held. */
  get size(): number {
    return this.entries.size;
  }

  /** The ground at this moment, which no later frame changes. Cheap: tiles are immutable and shared. */
  freeze(): TileGround {
    if (this.snapshot?.stamp !== this.stamp) {
      const tiles = new Map<number, Tile>();
      for (const [key, entry] of this.entries) tiles.set(key, entry.tile);
      this.snapshot = { stamp: this.stamp, ground: new TileGround(this.sizeM, tiles) };
    }
    return this.snapshot.ground;
  }

  /** Forgets all tiles, as the server does when a connection begins. */
  clear(): void {
    this.entries = new Map();
    this.finals.clear();
    this.rev.value++;
  }

  /** Shows a frame: all of it at once, with everything that moves along. One step of `revision`. */
  apply(frame: DecodedFrame): void {
    const stamp = this.stamp + 1;
    const next = new Map(this.entries);
    this.drop(next, frame);
    // Who holds nothing of a level is told nothing of it: the first tiles that fill it speak for themselves.
    if (!holds(next, frame.level)) this.finals.set(frame.level, frame.settled || frame.tiles.length === 0);
    const changed = new Set<number>();
    for (const t of frame.tiles) {
      const key = tileKey(frame.level, t.x, t.y);
      next.set(key, this.exactEntry(next, key, t, stamp));
      changed.add(key);
    }
    if (frame.kind === FrameKind.LEVEL) {
      if (frame.tiles.length > 0 || holds(next, frame.level)) this.finals.set(frame.level, frame.settled);
      this.confirm(next, frame.level, changed, stamp);
    }
    this.moveBelow(next, frame.level, changed, stamp);
    this.entries = next;
    this.rev.value = stamp;
  }

  private drop(next: Map<number, Entry>, frame: DecodedFrame): void {
    if (frame.drops.length === 0) return;
    const gone = new Set(frame.drops.map((d) => tileKey(frame.level, d.x, d.y)));
    for (const key of next.keys()) if (isUnderAny(key, gone, frame.level)) next.delete(key);
  }

  private exactEntry(next: ReadonlyMap<number, Entry>, key: number, t: DecodedTile, stamp: number): Entry {
    const level = keyLevel(key);
    const quantum = this.sizeM / (TILE_CELLS << level) / QUANTA_PER_CELL;
    const heights = new Float32Array(AREA);
    for (let i = 0; i < AREA; i++) heights[i] = t.samples[i]! * quantum;
    const scaled = (a: ArrayLike<number>) => Float32Array.from(a, (v) => v * quantum);
    const tile: Tile = {
      level,
      x: t.x,
      y: t.y,
      version: t.version,
      exact: true,
      stamp,
      heights,
      subMin: scaled(t.subMin),
      subMax: scaled(t.subMax),
      subError: scaled(t.subError),
    };
    return { tile, exactHeights: heights, parentThen: parentHeights(next, key) };
  }

  /** After a LEVEL frame every held tile of the level shows its own samples again. */
  private confirm(next: Map<number, Entry>, level: number, changed: Set<number>, stamp: number): void {
    for (const [key, entry] of next) {
      if (keyLevel(key) !== level || changed.has(key)) continue;
      const parent = parentHeights(next, key);
      if (entry.tile.exact && entry.parentThen === parent) continue;
      if (entry.tile.heights === entry.exactHeights) {
        const tile = entry.tile.exact ? entry.tile : { ...entry.tile, exact: true, stamp };
        next.set(key, { ...entry, tile, parentThen: parent });
        continue;
      }
      next.set(key, { ...entry, tile: this.show(entry, entry.exactHeights, parent, true, stamp), parentThen: parent });
      changed.add(key);
    }
  }

  /** Moves the tiles below those that changed, level by level, so that each follows its parent's new display. */
  private moveBelow(next: Map<number, Entry>, level: number, changed: Set<number>, stamp: number): void {
    if (changed.size === 0) return;
    const byLevel: number[][] = Array.from({ length: this.levels + 1 }, () => []);
    for (const key of next.keys()) if (keyLevel(key) > level) byLevel[keyLevel(key)]?.push(key);
    for (let below = level + 1; below <= this.levels; below++) {
      for (const key of byLevel[below]!) {
        if (!changed.has(parentKey(key))) continue;
        const entry = next.get(key)!;
        const tile = this.follow(entry, parentHeights(next, key), stamp);
        if (tile === entry.tile) continue;
        next.set(key, { ...entry, tile });
        changed.add(key);
      }
    }
  }

  /** The tile moved along with its parent; the same object when its part of the parent did not move. */
  private follow(entry: Entry, parent: Float32Array | null, stamp: number): Tile {
    const { tile, exactHeights, parentThen } = entry;
    if (!parent || !parentThen) return tile;
    if (!this.parentMoved(parent, parentThen, tile.x, tile.y)) {
      return tile.exact ? tile : this.show(entry, exactHeights, parent, true, stamp);
    }
    predictMetres(this.delta, tile.x, tile.y, this.moved);
    let same = true;
    let still = true;
    for (let i = 0; i < AREA; i++) {
      const height = Math.fround(exactHeights[i]! + this.moved[i]!);
      if (height !== tile.heights[i]) same = false;
      if (height !== exactHeights[i]) still = false;
      this.moved[i] = height;
    }
    if (same) return tile;
    return this.show(entry, still ? exactHeights : this.moved.slice(), parent, still, stamp);
  }

  /** Writes the parent's movement, where the child's prediction reads it, to `delta`; false when it is zero there. */
  private parentMoved(now: Float32Array, then: Float32Array, x: number, y: number): boolean {
    if (now === then) return false;
    const [firstCol, lastCol] = x & 1 ? [TILE_CELLS / 2 - 1, TILE_CELLS] : [0, TILE_CELLS / 2 + 1];
    const [firstRow, lastRow] = y & 1 ? [TILE_CELLS / 2 - 1, TILE_CELLS] : [0, TILE_CELLS / 2 + 1];
    let any = false;
    for (let r = firstRow; r <= lastRow; r++) {
      for (let i = r * TILE_SAMPLES + firstCol, end = r * TILE_SAMPLES + lastCol; i <= end; i++) {
        const d = now[i]! - then[i]!;
        this.delta[i] = d;
        if (d !== 0) any = true;
      }
    }
    return any;
  }

  /** A new Tile with these heights and the bounds that belong to them. */
  private show(entry: Entry, heights: Float32Array, parent: Float32Array | null, exact: boolean, stamp: number): Tile {
    const { tile } = entry;
    const subMin = new Float32Array(SUBS);
    const subMax = new Float32Array(SUBS);
    const subError = new Float32Array(SUBS);
    subRange(heights, subMin, subMax);
    if (parent) {
      subDistance(heights, parent, 1, tile.x, tile.y, this.distance);
      for (let i = 0; i < SUBS; i++) subError[i] = this.distance[i]! / 2;
    }
    return { ...tile, exact, stamp, heights, subMin, subMax, subError };
  }
}

function parentHeights(entries: ReadonlyMap<number, Entry>, key: number): Float32Array | null {
  if (keyLevel(key) === 0) return null;
  return entries.get(parentKey(key))?.tile.heights ?? null;
}

function holds(entries: ReadonlyMap<number, Entry>, level: number): boolean {
  for (const key of entries.keys()) if (keyLevel(key) === level) return true;
  return false;
}
