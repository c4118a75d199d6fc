/**
 * Bounds and errors of sub-patches, as the selection needs them (DESIGN 9, 10): of held tiles as the server sent them, of
 * tiles as they are drawn as the device measured them, and guesses of all that is not measured yet. Addressed by the pages
 * and nodes of a PatchTree.
 *
 * Guesses of bounds are bounds, so that nothing in sight is culled; guesses of errors are what is likely, so that not each
 * level that waits for its figures asks for one too many.
 */

import type { Tile } from "../../core/types.ts";
import { SUBPATCHES, SYNTH_H_RANGE_FROM } from "../../generated/contract.ts";

const SUBS = SUBPATCHES * SUBPATCHES;
/** Nothing measured yet. */
const UNKNOWN = -1;
/** A level adds at most this share of what its parent adds: 2^-H, H the least exponent. */
export const FALL: number = 2 ** -SYNTH_H_RANGE_FROM;
/** Levels that are asked for on guesses alone; then figures must have come. */
const MOST_BLIND = 3;

/** Detail to expect on levels that nobody has made yet. */
export interface Expectation {
  /** Noise of level 0, metres. */
  readonly amplitudeM: number;
  /** Error of a level from that of the one above it, as long as that is a guess itself. */
  readonly ratio: number;
}

/** The part of the tree that figures need. */
export interface Nodes {
  readonly levels: number;
  readonly tileLevel: Uint8Array;
  readonly held: Uint8Array;
  readonly parent: Int32Array;
  above(node: number): number;
}

export class Figures {
  /** Null: tiles that are held are all there is. */
  expected: Expectation | null = null;
  // Per node: the sub-patch by itself, as far as it is known.
  min: Float32Array;
  max: Float32Array;
  /** Distance to what the parent would draw, metres. */
  error: Float32Array;

  #heldMin: Float32Array;
  #heldMax: Float32Array;
  #heldError: Float32Array;
  #drawnMin: Float32Array;
  #drawnMax: Float32Array;
  #drawnError: Float32Array;
  /** The most that children may differ. */
  #drawnFiner: Float32Array;
  /** Last measured error of the children, which outlives them; and 1 where the ground has changed since. */
  #below: Float32Array;
  #belowStale: Uint8Array;
  /** Per page: 1 where `drawn...` are those of the slot as it is now. */
  #measured: Uint8Array;
  /** How many pages from here upwards are not measured. */
  #blind: Uint8Array;

  readonly #tree: Nodes;

  constructor(tree: Nodes, pages: number) {
    this.#tree = tree;
    const nodes = (): Float32Array => new Float32Array(pages * SUBS);
    [this.min, this.max, this.error] = [nodes(), nodes(), nodes()];
    [this.#heldMin, this.#heldMax, this.#heldError] = [nodes(), nodes(), nodes()];
    [this.#drawnMin, this.#drawnMax, this.#drawnError, this.#drawnFiner] = [nodes(), nodes(), nodes(), nodes()];
    this.#below = nodes();
    this.#belowStale = new Uint8Array(pages * SUBS);
    this.#measured = new Uint8Array(pages);
    this.#blind = new Uint8Array(pages);
  }

  /** Makes room. `wider` gives a larger copy of an array. */
  grow(wider: <A extends Float32Array | Uint8Array>(old: A) => A): void {
    this.min = wider(this.min);
    this.max = wider(this.max);
    this.error = wider(this.error);
    this.#heldMin = wider(this.#heldMin);
    this.#heldMax = wider(this.#heldMax);
    this.#heldError = wider(this.#heldError);
    this.#drawnMin = wider(this.#drawnMin);
    this.#drawnMax = wider(this.#drawnMax);
    this.#drawnError = wider(this.#drawnError);
    this.#drawnFiner = wider(this.#drawnFiner);
    this.#below = wider(this.#below);
    this.#belowStale = wider(this.#belowStale);
    this.#measured = wider(this.#measured);
    this.#blind = wider(this.#blind);
  }

  /** A page begins: nothing is known of it. */
  clear(page: number): void {
    const [from, to] = [page * SUBS, (page + 1) * SUBS];
    this.error.fill(0, from, to);
    this.#drawnError.fill(UNKNOWN, from, to);
    this.#below.fill(UNKNOWN, from, to);
    this.#measured[page] = 0;
  }

  /** Measurements of a page's children are forgotten: they were of another rule. */
  forgetBelow(page: number): void {
    this.#below.fill(UNKNOWN, page * SUBS, (page + 1) * SUBS);
  }

  /** The slot is filled anew: what was measured of it no longer bounds it. */
  outdate(page: number): void {
    this.#measured[page] = 0;
    this.#belowStale.fill(1, page * SUBS, (page + 1) * SUBS);
  }

  /** Figures of a held tile. */
  hold(page: number, tile: Tile): void {
    this.#heldMin.set(tile.subMin, page * SUBS);
    this.#heldMax.set(tile.subMax, page * SUBS);
    this.#heldError.set(tile.subError, page * SUBS);
  }

  /**
   * Figures of a page's sub-patches as they are drawn, four each from `figures[at]` on: lowest and highest height, distance
   * to the parent's surface, the most that children can differ.
   */
  measure(page: number, figures: Float32Array, at: number): void {
    const first = page * SUBS;
    for (let sub = 0; sub < SUBS; sub += 1) {
      this.#drawnMin[first + sub] = figures[at + 4 * sub]!;
      this.#drawnMax[first + sub] = figures[at + 4 * sub + 1]!;
      this.#drawnError[first + sub] = figures[at + 4 * sub + 2]!;
      this.#drawnFiner[first + sub] = figures[at + 4 * sub + 3]!;
    }
    this.#measured[page] = 1;
    if (this.#tree.tileLevel[page] === 0) return;
    // A node of the parent covers 2 x 2 of these.
    const e = this.#drawnError;
    for (const sub of [0, 2, 8, 10]) {
      const node = first + sub;
      const up = this.#tree.above(node);
      this.#below[up] = Math.max(e[node]!, e[node + 1]!, e[node + 4]!, e[node + 5]!);
      this.#belowStale[up] = 0;
    }
  }

  /** Brings `min`, `max` and `error` of a page up to date; its parent's are. */
  settle(page: number): void {
    const level = this.#tree.tileLevel[page]!;
    this.#blind[page] = this.#measured[page] === 1 ? 0 : 1 + (level > 0 ? this.#blind[this.#tree.parent[page]!]! : 0);
    const amplitude = this.expected?.amplitudeM ?? 0;
    // All that levels to this one may have added, a geometric sum.
    const detail = (amplitude * (1 - FALL ** (level + 1))) / (1 - FALL);
    for (let node = page * SUBS; node < (page + 1) * SUBS; node += 1) {
      if (this.#measured[page] === 1) {
        const error = this.#drawnError[node]!;
        // The morph may show the parent's surface, which lies within `error` of this one.
        this.#set(node, this.#drawnMin[node]! - error, this.#drawnMax[node]! + error, error);
        continue;
      }
      const up = level > 0 ? this.#tree.above(node) : -1;
      const last = this.#drawnError[node]!;
      const error = last >= 0 ? last : up < 0 ? 0 : this.expectBelow(up);
      if (this.#tree.held[page] === 1) {
        const worst = Math.max(this.#heldError[node]!, error);
        this.#set(node, this.#heldMin[node]! - worst - detail, this.#heldMax[node]! + worst + detail, worst);
      } else if (up >= 0) {
        // Interpolation by four points leaves the range of its samples by an eighth of it at most.
        const more = amplitude * FALL ** level + (this.max[up]! - this.min[up]!) / 8;
        this.#set(node, this.min[up]! - more, this.max[up]! + more, error);
      }
    }
  }

  /** Error of the children of a node as far as it is not that of held tiles: measured, bounded or guessed. */
  expectBelow(node: number): number {
    const page = node >> 4;
    const level = this.#tree.tileLevel[page]!;
    if (this.expected === null || level >= this.#tree.levels) return 0;
    const known = this.#below[node]!;
    if (known >= 0 && this.#belowStale[node] === 0) return known;
    if (this.#measured[page] === 1) return this.#drawnFiner[node]!;
    if (this.#blind[page]! >= MOST_BLIND && this.#drawnError[node]! < 0) return Math.max(known, 0);
    const own = level === 0 ? this.expected.amplitudeM : this.error[node]!;
    return Math.max(known, own * this.expected.ratio);
  }

  /** Lowest and highest held ground of a page. */
  heldRange(page: number): { low: number; high: number } {
    let low = Number.POSITIVE_INFINITY;
    let high = Number.NEGATIVE_INFINITY;
    for (let node = page * SUBS; node < (page + 1) * SUBS; node += 1) {
      if (this.#heldMin[node]! < low) low = this.#heldMin[node]!;
      if (this.#heldMax[node]! > high) high = this.#heldMax[node]!;
    }
    return { low, high };
  }

  #set(node: number, min: number, max: number, error: number): void {
    this.min[node] = min;
    this.max[node] = max;
    this.error[node] = error;
  }
}
