/**
 * What the selection knows of the ground: per 16-cell sub-patch its bounds and the error of stopping there (DESIGN 7, 9).
 *
 * A tile that is held or drawn has a *page*: 16 *nodes*, its sub-patches `[row * 4 + col]`. Node = page * 16 + sub-patch.
 * Pages come and go with the tiles and know their parent, their four children and their eight neighbours, so that the
 * selection walks the tree without a look-up and memory follows what is held, not what the finest level could hold.
 *
 * Two masks say what may be drawn: `held` (the store has the tile) and `usable` (the renderer has it in its atlas). A tile
 * that is usable and not held is synthetic (DESIGN 10).
 *
 * Figures of a tile as it is drawn, with its detail, are measured on the device and come a few frames late (`measure`);
 * until then they are guessed (`guess`), bounds so that nothing in sight is culled.
 */

import { tileKey } from "../../core/tilekey.ts";
import type { TileView } from "../../core/types.ts";
import { SUBPATCHES } from "../../generated/contract.ts";
import { type Expectation, Figures } from "./figures.ts";

const SUBS = SUBPATCHES * SUBPATCHES;
const FIRST_PAGES = 512;
/** Own place in `near`. */
const SELF = 4;
/** Synthetic tiles fade in this many times faster than refined ones. */
const SYNTHETIC_HASTE = 2.5;
/** Stamp of a page whose tile is not held. */
const NOT_HELD = -1;
export class PatchTree {
  /** Pages that the arrays have room for. */
  capacity = FIRST_PAGES;

  // Each page has one of these.
  tileLevel = new Uint8Array(FIRST_PAGES);
  tileX = new Int32Array(FIRST_PAGES);
  tileY = new Int32Array(FIRST_PAGES);
  /** Page of the tile one level coarser; -1 for the root. */
  parent = new Int32Array(FIRST_PAGES);
  /** Pages of the four quarters, `[page * 4 + (y & 1) * 2 + (x & 1)]`; -1 where none. */
  child = new Int32Array(FIRST_PAGES * 4);
  /** Pages of the tiles around, `[page * 9 + (dy + 1) * 3 + dx + 1]`; -1 where none. */
  near = new Int32Array(FIRST_PAGES * 9);
  held = new Uint8Array(FIRST_PAGES);
  usable = new Uint8Array(FIRST_PAGES);
  /** Share of the tile's entrance that is still to come, 1 to 0: a tile starts out as its parent's surface. */
  fade = new Float32Array(FIRST_PAGES);

  // Each node has one of these.
  /** Bounds of the sub-patch and all its known descendants, metres. */
  min = new Float32Array(FIRST_PAGES * SUBS);
  max = new Float32Array(FIRST_PAGES * SUBS);
  /** Largest distance, metres, between this sub-patch as drawn and its descendants; 0 where there can be none. */
  error = new Float32Array(FIRST_PAGES * SUBS);
  /** 1 where the sub-patch may be split without breaking the restriction, given the usable tiles. */
  splittable = new Uint8Array(FIRST_PAGES * SUBS);

  /** Lowest and highest ground that is held, metres, without detail. */
  low = 0;
  high = 0;

  /** Stamp of the tile whose figures the page holds. */
  #stamps = new Float64Array(FIRST_PAGES);
  #seen = new Float64Array(FIRST_PAGES);

  readonly #index = new Map<number, number>();
  readonly #byLevel: number[][];
  readonly #free: number[] = [];
  #used = 0;
  #round = 0;
  #syncedStamp = -1;
  #splittableStale = true;
  #figuresStale = true;
  #pruneDue = false;
  #fading = false;
  readonly #figures = new Figures(this, FIRST_PAGES);
  /** Finest level that is solved everywhere. */
  #solved = 0;

  /** `levels`: the finest level that can exist. */
  constructor(readonly levels: number) {
    this.#byLevel = Array.from({ length: levels + 1 }, () => []);
    this.#page(0, 0, 0);
  }

  /** True when no detail is added to what tiles hold. */
  get plain(): boolean {
    return (this.#figures.expected?.amplitudeM ?? 0) === 0;
  }

  /** Pages in use. */
  get pages(): number {
    return this.#index.size;
  }

  /** The node beside `node` on its level, or -1 when it is outside the domain or its tile has no page. */
  neighbour(node: number, dx: number, dy: number): number {
    const col = (node & 3) + dx;
    const row = ((node >> 2) & 3) + dy;
    if (((col | row) & ~3) === 0) return (node & ~15) | (row << 2) | col;
    const page = this.near[(node >> 4) * 9 + (row < 0 ? 0 : row > 3 ? 6 : 3) + (col < 0 ? 0 : col > 3 ? 2 : 1)]!;
    return page < 0 ? -1 : (page << 4) | ((row & 3) << 2) | (col & 3);
  }

  /** The node one level coarser that covers `node`; not for the root's nodes. */
  above(node: number): number {
    const page = node >> 4;
    const col = 2 * (this.tileX[page]! & 1) + ((node & 3) >> 1);
    const row = 2 * (this.tileY[page]! & 1) + ((node >> 3) & 1);
    return (this.parent[page]! << 4) | (row << 2) | col;
  }

  /** Page of the tile that holds the four children of `node`, or -1. */
  childPage(node: number): number {
    return this.child[(node >> 4) * 4 + ((node >> 2) & 2) + ((node >> 1) & 1)]!;
  }

  /** First (south-west) child of a node in the page of its children; the others are 1, 4 and 5 further. */
  firstChild(node: number, childPage: number): number {
    return (childPage << 4) | ((node & 4) << 1) | ((node & 1) << 1);
  }

  /** True for a level whose tiles can be made where nobody holds them. */
  canMake(level: number): boolean {
    return this.#figures.expected !== null && level > this.#solved;
  }

  /** The page of a tile, or -1. */
  find(level: number, x: number, y: number): number {
    return this.#index.get(tileKey(level, x, y)) ?? -1;
  }

  /** Sets the detail to expect from now on. */
  expect(expected: Expectation | null): void {
    const [a, b] = [this.#figures.expected, expected];
    if (a === b || (a !== null && b !== null && a.amplitudeM === b.amplitudeM && a.ratio === b.ratio)) return;
    this.#figures.expected = expected;
    this.#figuresStale = true;
    for (const page of this.#index.values()) this.#figures.forgetBelow(page);
  }

  /** Brings everything up to date with the store and with what was measured. Returns false when nothing changed. */
  sync(view: TileView): boolean {
    if (view.stamp !== this.#syncedStamp) {
      this.#syncedStamp = view.stamp;
      this.#readStore(view);
    }
    if (this.#pruneDue) for (let level = this.levels; level > 0; level -= 1) this.#prune(level);
    this.#pruneDue = false;
    if (!this.#figuresStale) return false;
    this.#figuresStale = false;
    for (const pages of this.#byLevel) for (const page of pages) this.#figures.settle(page);
    for (let level = this.levels; level >= 0; level -= 1) for (const page of this.#byLevel[level]!) this.#merge(page);
    return true;
  }

  #readStore(view: TileView): void {
    this.#round += 1;
    this.#solved = view.solved;
    this.low = Number.POSITIVE_INFINITY;
    this.high = Number.NEGATIVE_INFINITY;
    for (const tile of view.tiles()) {
      if (tile.level > this.levels) continue;
      const page = this.#page(tile.level, tile.x, tile.y);
      this.#seen[page] = this.#round;
      this.held[page] = 1;
      if (this.#stamps[page] !== tile.stamp) this.#figures.hold(page, tile);
      this.#stamps[page] = tile.stamp;
      const { low, high } = this.#figures.heldRange(page);
      if (low < this.low) this.low = low;
      if (high > this.high) this.high = high;
    }
    for (const page of this.#index.values()) {
      if (this.held[page] === 0 || this.#seen[page] === this.#round) continue;
      this.held[page] = 0;
      this.#stamps[page] = NOT_HELD;
    }
    this.#pruneDue = true;
    this.#figuresStale = true;
  }

  /** The tile in the atlas is being made anew: what was measured of it no longer bounds it. */
  remade(level: number, x: number, y: number): void {
    const page = this.find(level, x, y);
    if (page < 0) return;
    this.#figures.outdate(page);
    this.#figuresStale = true;
  }

  /** Takes in what was measured of a tile as it is drawn (Figures.measure). */
  measure(level: number, x: number, y: number, figures: Float32Array, at: number): void {
    const page = this.find(level, x, y);
    if (page < 0) return;
    this.#figures.measure(page, figures, at);
    this.#figuresStale = true;
  }

  /** Says whether a tile may be drawn (its slot in the atlas is filled). `fade`: it enters as its parent's surface. */
  setUsable(level: number, x: number, y: number, usable: boolean, fade = false): void {
    if (level > this.levels) return;
    const page = usable ? this.#page(level, x, y) : (this.#index.get(tileKey(level, x, y)) ?? -1);
    const value = usable ? 1 : 0;
    if (page < 0 || this.usable[page] === value) return;
    this.usable[page] = value;
    this.fade[page] = usable && fade ? 1 : 0;
    this.#fading ||= usable && fade;
    this.#splittableStale = true;
    this.#figuresStale = true;
    this.#figures.outdate(page);
    if (!usable) this.#pruneDue = true;
  }

  /** Lets entrances go on by this share of their time; true while any is under way. */
  advance(share: number): boolean {
    if (!this.#fading) return false;
    let any = false;
    for (const page of this.#index.values()) {
      const left = this.fade[page]!;
      if (left === 0) continue;
      // Synthetic tiles differ less from their parents, and many levels of them enter one after the other.
      const next = Math.max(0, left - (this.held[page] === 1 ? share : SYNTHETIC_HASTE * share));
      this.fade[page] = next;
      if (next > 0) any = true;
      else this.#splittableStale = true;
    }
    this.#fading = any;
    return any;
  }

  /**
   * Brings `splittable` up to date: a sub-patch may be split when the tile of its children is usable, its own tile has
   * fully entered, and its eight neighbours can exist, so that no two drawn neighbours, corners too, ever differ by more
   * than one level.
   */
  updateSplittable(): void {
    if (!this.#splittableStale) return;
    this.#splittableStale = false;
    this.splittable.fill(0);
    for (let level = 0; level < this.levels; level += 1) {
      let any = false;
      for (const fine of this.#byLevel[level + 1]!) {
        const page = this.parent[fine]!;
        if (this.usable[fine] === 0 || this.usable[page] === 0 || this.fade[page]! > 0) continue;
        const corner = (page << 4) | ((this.tileY[fine]! & 1) << 3) | ((this.tileX[fine]! & 1) << 1);
        // A tile of the finer level covers 2 x 2 sub-patches of this one.
        for (const node of [corner, corner + 1, corner + 4, corner + 5]) {
          if (level > 0 && !this.#neighboursCanExist(level, node)) continue;
          this.splittable[node] = 1;
          any = true;
        }
      }
      if (!any) break;
    }
  }

  /** The nodes around one exist when the nodes above them are split: its own and those on the sides that it touches. */
  #neighboursCanExist(level: number, node: number): boolean {
    const page = node >> 4;
    const last = (SUBPATCHES << level) - 1;
    const dx = (node & 1) * 2 - 1;
    const dy = ((node >> 2) & 1) * 2 - 1;
    const px = this.tileX[page]! * SUBPATCHES + (node & 3) + dx;
    const py = this.tileY[page]! * SUBPATCHES + ((node >> 2) & 3) + dy;
    const inX = px >= 0 && px <= last;
    const inY = py >= 0 && py <= last;
    const up = this.above(node);
    return (
      this.splittable[up] === 1 &&
      (!inX || this.#canSplit(up, dx, 0)) &&
      (!inY || this.#canSplit(up, 0, dy)) &&
      (!inX || !inY || this.#canSplit(up, dx, dy))
    );
  }

  #canSplit(node: number, dx: number, dy: number): boolean {
    const to = this.neighbour(node, dx, dy);
    return to >= 0 && this.splittable[to] === 1;
  }

  /** The page of a tile, made with those of its ancestors when it is new. */
  #page(level: number, x: number, y: number): number {
    const key = tileKey(level, x, y);
    const known = this.#index.get(key);
    if (known !== undefined) return known;
    const up = level > 0 ? this.#page(level - 1, x >> 1, y >> 1) : -1;
    const page = this.#free.pop() ?? this.#used++;
    if (page >= this.capacity) this.#grow();
    this.#index.set(key, page);
    this.#byLevel[level]!.push(page);
    this.tileLevel[page] = level;
    this.tileX[page] = x;
    this.tileY[page] = y;
    this.held[page] = 0;
    this.usable[page] = 0;
    this.fade[page] = 0;
    this.#stamps[page] = NOT_HELD;
    this.#seen[page] = this.#round;
    this.splittable.fill(0, page * SUBS, (page + 1) * SUBS);
    this.#figures.clear(page);
    this.child.fill(-1, page * 4, page * 4 + 4);
    this.parent[page] = up;
    if (up >= 0) this.child[up * 4 + 2 * (y & 1) + (x & 1)] = page;
    this.#link(page, true);
    this.#splittableStale = true;
    this.#figuresStale = true;
    return page;
  }

  /** Makes a page and its neighbours know each other, or forget. */
  #link(page: number, on: boolean): void {
    const level = this.tileLevel[page]!;
    const last = (1 << level) - 1;
    for (let i = 0; i < 9; i += 1) {
      const x = this.tileX[page]! + (i % 3) - 1;
      const y = this.tileY[page]! + Math.floor(i / 3) - 1;
      const inside = i !== SELF && x >= 0 && y >= 0 && x <= last && y <= last;
      const other = inside ? (this.#index.get(tileKey(level, x, y)) ?? -1) : -1;
      this.near[page * 9 + i] = i === SELF ? page : other;
      if (other >= 0) this.near[other * 9 + 8 - i] = on ? page : -1;
    }
  }

  /** Frees the pages of a level that nobody needs: their tile has gone from store and atlas, and so have its children. */
  #prune(level: number): void {
    const pages = this.#byLevel[level]!;
    let kept = 0;
    for (const page of pages) {
      const c = page * 4;
      const leaf = this.child[c]! < 0 && this.child[c + 1]! < 0 && this.child[c + 2]! < 0 && this.child[c + 3]! < 0;
      if (level === 0 || this.held[page] === 1 || this.usable[page] === 1 || !leaf) {
        pages[kept++] = page;
        continue;
      }
      const [x, y] = [this.tileX[page]!, this.tileY[page]!];
      this.#index.delete(tileKey(level, x, y));
      this.#link(page, false);
      this.child[this.parent[page]! * 4 + 2 * (y & 1) + (x & 1)] = -1;
      this.#free.push(page);
    }
    pages.length = kept;
  }

  #grow(): void {
    this.capacity *= 2;
    const wider = <A extends { length: number; set(from: A): void }>(old: A): A => {
      const grown = new (old.constructor as new (n: number) => A)(old.length * 2);
      grown.set(old);
      return grown;
    };
    this.tileLevel = wider(this.tileLevel);
    this.tileX = wider(this.tileX);
    this.tileY = wider(this.tileY);
    this.parent = wider(this.parent);
    this.child = wider(this.child);
    this.near = wider(this.near);
    this.held = wider(this.held);
    this.usable = wider(this.usable);
    this.fade = wider(this.fade);
    this.min = wider(this.min);
    this.max = wider(this.max);
    this.error = wider(this.error);
    this.splittable = wider(this.splittable);
    this.#figures.grow(wider);
    this.#stamps = wider(this.#stamps);
    this.#seen = wider(this.#seen);
  }

  /** A page's figures from its own and those of its children, which are merged already. */
  #merge(page: number): void {
    const { min, max, error } = this;
    const figures = this.#figures;
    const first = page * SUBS;
    for (let node = first; node < first + SUBS; node += 1) {
      min[node] = figures.min[node]!;
      max[node] = figures.max[node]!;
      error[node] = this.childPage(node) < 0 ? figures.expectBelow(node) : 0;
    }
    for (let q = 0; q < 4; q += 1) {
      const fine = this.child[page * 4 + q]!;
      if (fine < 0) continue;
      const corner = first + (q & 2) * 4 + (q & 1) * 2;
      for (let sub = 0; sub < SUBS; sub += 1) {
        const from = fine * SUBS + sub;
        const to = corner + ((sub >> 3) << 2) + ((sub & 3) >> 1);
        if (min[from]! < min[to]!) min[to] = min[from]!;
        if (max[from]! > max[to]!) max[to] = max[from]!;
        const worst = Math.max(figures.error[from]!, error[from]!);
        if (worst > error[to]!) error[to] = worst;
      }
    }
  }
}
