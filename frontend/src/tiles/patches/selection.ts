/**
 * View-dependent choice of the 16-cell patches that are drawn (DESIGN 7, 9; paper 0, III-A).
 *
 * Descends the patch tree while a patch commits more than `tau` pixels of error, then splits what the restriction asks
 * for: neighbours, across corners too, differ by at most one level. Each drawn patch gets four edge bits (its
 * neighbour there is coarser: odd vertices snap) and a morph weight for each of its four corners. A weight is a property
 * of the corner's point, the same for all patches that meet there: 1 where one of them is coarser (all draw the parent's
 * sample), 0 where one is finer, else by screen error. Bilinear weights between the corners then agree along every
 * shared edge, so patches meet exactly. Away from its edges a patch has its own weight (ground/patch.wgsl).
 */

import type { CameraState, TileView } from "../../core/types.ts";
import { PATCH_CELLS, SUBPATCHES } from "../../generated/contract.ts";
import { frontToBack, Horizon, highestAround } from "./occlusion.ts";
import { PatchTree } from "./patchtree.ts";
import { EDGE_EAST, EDGE_NORTH, EDGE_SOUTH, EDGE_WEST, FACT_WORDS, RECORD_WORDS, writeRecord } from "./records.ts";
import { type TileRequest, TileRequests } from "./requests.ts";
import { DRY, Sight, type Water } from "./sight.ts";

export type { TileRequest } from "./requests.ts";

/** From this error on, in taus, tiles are asked for that a nearer eye will need: they are there before they are drawn. */
const EARLY = 0.7;
/**
 * A patch has its parent's shape when the parent's error is at the bound, and its own from so much above it on, in bounds:
 * wider, and most of what is drawn is half flattened; narrower, and levels change within few frames of a moving camera.
 */
const MORPH_WIDTH = 0.25;

/** The drawn cut. Arrays are reused by the next call of `select`. */
export interface Cut {
  /** Drawn patches, roughly front to back. */
  readonly count: number;
  /** `RECORD_WORDS` words a patch. */
  readonly records: Uint32Array;
  /** `FACT_WORDS` words a patch: lowest and highest ground that it can have, metres, as float32; its node of the tree. */
  readonly facts: Uint32Array;
  /** Tiles that a finer picture needs and that are not usable yet, coarse first, then by screen error. */
  readonly requests: readonly TileRequest[];
  /** Tiles that will be needed when the eye comes a little nearer, in the same order. */
  readonly early: readonly TileRequest[];
  /** Lowest and highest ground of the whole domain, metres, without detail. */
  readonly minHeight: number;
  readonly maxHeight: number;
  /** Nothing of the ground is higher, detail included. */
  readonly top: number;
  /** Tiles that must be in the atlas together for a picture as fine as was asked for, as far as is known. */
  readonly tiles: number;
}

/** The part of the atlas that the selection asks. */
export interface Slots {
  /** Slot of a usable tile. */
  slot(level: number, x: number, y: number): number;
  /**
   * Called once per usable tile that the cut rests on (drawn tiles, their parents and all ancestors), and per one that waits
   * for a tile that was asked for.
   */
  touch(level: number, x: number, y: number): void;
}

export class Selection {
  readonly tree: PatchTree;
  // Each node of the tree has one of these.
  #split: Uint8Array;
  /** Screen error of a split patch in taus: its children morph towards it as this falls to 1. */
  #ratio: Float32Array;
  readonly #splitList: number[][];
  // Each page has one of these.
  #touched: Uint8Array;
  #touchedCount = 0;
  #slotOf: Int32Array;
  /** Tiles that the cut lacks, and those that it will soon need. */
  readonly #requests: TileRequests;
  readonly #early: TileRequests;
  /** Leaves out patches that nearer ground hides. Measurements and tests turn it off. */
  occlusion = true;
  readonly #horizon = new Horizon();
  #records = new Uint32Array(RECORD_WORDS * 1024);
  #facts = new Uint32Array(FACT_WORDS * 1024);
  #bounds = new Float32Array(this.#facts.buffer);
  #count = 0;
  readonly #sight: Sight;
  #slots: Slots | null = null;

  /** `levels`: the finest level that can exist. */
  constructor(readonly levels: number) {
    this.tree = new PatchTree(levels);
    this.#sight = new Sight(this.tree);
    this.#requests = new TileRequests(this.tree, (page) => this.#touch(page));
    this.#early = new TileRequests(this.tree);
    const { capacity } = this.tree;
    this.#split = new Uint8Array(capacity * 16);
    this.#ratio = new Float32Array(capacity * 16);
    this.#touched = new Uint8Array(capacity);
    this.#slotOf = new Int32Array(capacity);
    this.#splitList = Array.from({ length: levels + 1 }, () => []);
  }

  /**
   * Chooses the cut among the usable tiles.
   *
   * `pixelScale` scales the camera's height to the pixels that are really drawn (adaptive resolution). `water`: patches
   * below it are drawn as far as its surface is in view.
   */
  select(view: TileView, camera: CameraState, tauPx: number, slots: Slots, pixelScale = 1, water: Water = DRY): Cut {
    this.tree.sync(view);
    this.tree.updateSplittable();
    this.#sight.begin(view.sizeM, camera, tauPx, pixelScale, water);
    this.#begin(slots);
    const { usable, held, max, low, high } = this.tree;
    if (usable[0] === 1) {
      this.#touch(0);
      for (let node = 0; node < 16; node += 1) this.#descend(0, node);
      this.#enforce();
      this.#touchSplit();
      this.#horizon.begin(camera, this.occlusion && this.#above(view));
      for (const node of frontToBack(SUBPATCHES, this.#sight.sizeM, this.#sight.eye[0]!, this.#sight.eye[1]!))
        this.#emit(0, node, 0);
    } else if (held[0] === 1) {
      this.#requests.ask(0, 0, 0, 1);
    }
    let top = Number.NEGATIVE_INFINITY;
    for (let node = 0; node < 16; node += 1) top = Math.max(top, max[node]!);
    const count = this.#count;
    const records = this.#records;
    const facts = this.#facts;
    const [requests, early] = [this.#requests.sorted(), this.#early.sorted()];
    const tiles = this.#touchedCount + requests.length;
    return { count, records, facts, requests, early, minHeight: low, maxHeight: high, top, tiles };
  }

  #begin(slots: Slots): void {
    this.#count = 0;
    this.#requests.clear();
    this.#early.clear();
    this.#slots = slots;
    for (const list of this.#splitList) {
      for (const node of list) this.#split[node] = 0;
      list.length = 0;
    }
    const { capacity } = this.tree;
    if (this.#touched.length < capacity) {
      this.#split = new Uint8Array(capacity * 16);
      this.#ratio = new Float32Array(capacity * 16);
      this.#touched = new Uint8Array(capacity);
      this.#slotOf = new Int32Array(capacity);
    }
    this.#touched.fill(0);
    this.#touchedCount = 0;
    this.#slotOf.fill(-1);
  }

  #descend(level: number, node: number): void {
    const { tree } = this;
    if (level >= this.levels || tree.error[node] === 0 || !this.#sight.visible(level, node)) return;
    const ratio = this.#sight.screenError(level, node);
    if (ratio <= EARLY) return;
    if (ratio <= 1) {
      if (tree.splittable[node] === 0) this.#early.askBelow(level, node, ratio);
      return;
    }
    if (tree.splittable[node] === 0) {
      this.#requests.askBelow(level, node, ratio);
      this.#lookAhead(level, node);
      return;
    }
    const page = tree.childPage(node);
    this.#markSplit(level, node, ratio);
    const first = tree.firstChild(node, page);
    this.#descend(level + 1, first);
    this.#descend(level + 1, first + 1);
    this.#descend(level + 1, first + 4);
    this.#descend(level + 1, first + 5);
  }

  /** While a tile still enters, those below it are asked for already. */
  #lookAhead(level: number, node: number): void {
    const { tree } = this;
    const page = tree.childPage(node);
    if (page < 0 || tree.usable[page] === 0 || level + 1 >= this.levels) return;
    const first = tree.firstChild(node, page);
    for (const child of [first, first + 1, first + 4, first + 5]) {
      if (tree.error[child] === 0 || !this.#sight.visible(level + 1, child)) continue;
      const ratio = this.#sight.screenError(level + 1, child);
      if (ratio <= 1) continue;
      const below = tree.childPage(child);
      if (below < 0 || tree.usable[below] === 0) this.#early.askBelow(level + 1, child, ratio);
      else this.#lookAhead(level + 1, child);
    }
  }

  #markSplit(level: number, node: number, ratio: number): void {
    this.#split[node] = 1;
    this.#ratio[node] = ratio;
    this.#splitList[level]!.push(node);
  }

  /** Fine to coarse: the neighbours of a split patch must exist, so their parents are split as well. */
  #enforce(): void {
    const { tree } = this;
    for (let level = this.levels - 1; level > 0; level -= 1) {
      for (const node of this.#splitList[level]!) {
        const up = tree.above(node);
        const dx = (node & 1) * 2 - 1;
        const dy = ((node >> 2) & 1) * 2 - 1;
        this.#ensureSplit(level - 1, up);
        this.#ensureSplit(level - 1, tree.neighbour(up, dx, 0));
        this.#ensureSplit(level - 1, tree.neighbour(up, 0, dy));
        this.#ensureSplit(level - 1, tree.neighbour(up, dx, dy));
      }
    }
  }

  /** `node` may be -1: outside the domain. (Inside, `splittable` has seen to it that it is there.) */
  #ensureSplit(level: number, node: number): void {
    if (node >= 0 && this.#split[node] === 0) this.#markSplit(level, node, 0);
  }

  #touchSplit(): void {
    for (let level = 0; level < this.levels; level += 1)
      for (const node of this.#splitList[level]!) this.#touch(this.tree.childPage(node));
  }

  #touch(page: number): void {
    if (this.#touched[page] === 1) return;
    this.#touched[page] = 1;
    this.#touchedCount += 1;
    const { tileLevel, tileX, tileY } = this.tree;
    this.#slots!.touch(tileLevel[page]!, tileX[page]!, tileY[page]!);
  }

  /**
   * Says whether the eye is above the ground that is drawn: from below, nearer ground need not hide what is behind it.
   */
  #above(view: TileView): boolean {
    const { tree } = this;
    const { sizeM } = this.#sight;
    const [x, y, z] = this.#sight.eye as [number, number, number];
    if (x < 0 || y < 0 || x >= sizeM || y >= sizeM) {
      for (let node = 0; node < 16; node += 1) if (tree.max[node]! >= z) return false;
      return true;
    }
    const cell = (level: number, v: number): number => Math.floor((v / sizeM) * (SUBPATCHES << level));
    let level = 0;
    let node = cell(0, y) * SUBPATCHES + cell(0, x);
    while (this.#split[node] === 1) {
      level += 1;
      node = tree.firstChild(node, tree.childPage(node)) + (cell(level, x) & 1) + 4 * (cell(level, y) & 1);
    }
    const high = tree.max[node]!;
    if (high < z) return true;
    // On a slope the patch below the eye may rise above it elsewhere: samples around the eye say more, where they are all.
    const page = node >> 4;
    const tile = tree.plain ? view.tile(level, tree.tileX[page]!, tree.tileY[page]!) : undefined;
    if (tile === undefined) return false;
    const sub = node & 15;
    return highestAround(tile, sizeM, x, y) + tile.subError[sub]! + Math.max(0, high - tile.subMax[sub]!) < z;
  }

  #emit(level: number, node: number, morph: number): void {
    const { tree } = this;
    if (!this.#sight.visible(level, node)) return;
    const w = this.#sight.sizeM / (SUBPATCHES << level);
    const east = this.#sight.column(node) * w - this.#sight.eye[0]!;
    const north = this.#sight.row(node) * w - this.#sight.eye[1]!;
    if (this.#horizon.hides(east, north, w, this.#sight.highest(level, node) - this.#sight.eye[2]!)) return;
    if (this.#split[node] === 0) {
      this.#write(level, node, morph);
      this.#horizon.add(east, north, w, tree.min[node]! - this.#sight.eye[2]!);
      return;
    }
    const page = tree.childPage(node);
    const childMorph = Math.max(morphOf(this.#ratio[node]!), tree.fade[page]!);
    const first = tree.firstChild(node, page);
    // The nearest quadrant comes first: for the horizon, and for early depth rejection.
    const near = (east < -0.5 * w ? 1 : 0) | (north < -0.5 * w ? 2 : 0);
    for (let flip = 0; flip < 4; flip += 1) {
      const i = near ^ flip;
      this.#emit(level + 1, first + (i & 1) + 2 * (i & 2), childMorph);
    }
  }

  #write(level: number, node: number, morph: number): void {
    if ((this.#count + 1) * RECORD_WORDS > this.#records.length) {
      const grown = new Uint32Array(this.#records.length * 2);
      grown.set(this.#records);
      this.#records = grown;
      const facts = new Uint32Array(this.#facts.length * 2);
      facts.set(this.#facts);
      this.#facts = facts;
      this.#bounds = new Float32Array(facts.buffer);
    }
    const { tree } = this;
    const px = this.#sight.column(node);
    const py = this.#sight.row(node);
    const last = (SUBPATCHES << level) - 1;
    let edges = 0;
    if (px > 0 && !this.#exists(level, tree.neighbour(node, -1, 0))) edges |= EDGE_WEST;
    if (px < last && !this.#exists(level, tree.neighbour(node, 1, 0))) edges |= EDGE_EAST;
    if (py > 0 && !this.#exists(level, tree.neighbour(node, 0, -1))) edges |= EDGE_SOUTH;
    if (py < last && !this.#exists(level, tree.neighbour(node, 0, 1))) edges |= EDGE_NORTH;
    let corners = 0;
    if (level > 0) {
      for (let corner = 0; corner < 4; corner += 1) {
        const sx = (corner & 1) * 2 - 1;
        const sy = (corner >> 1) * 2 - 1;
        const inX = sx < 0 ? px > 0 : px < last;
        const inY = sy < 0 ? py > 0 : py < last;
        corners |= Math.round(this.#cornerMorph(node, inX ? sx : 0, inY ? sy : 0, morph) * 255) << (8 * corner);
      }
    }
    const border =
      (px === 0 ? EDGE_WEST : 0) |
      (px === last ? EDGE_EAST : 0) |
      (py === 0 ? EDGE_SOUTH : 0) |
      (py === last ? EDGE_NORTH : 0);
    const own = this.#slot(node >> 4);
    const parent = level > 0 ? this.#slot(tree.parent[node >> 4]!) : own;
    writeRecord(this.#records, this.#count, {
      level,
      column: px * PATCH_CELLS,
      row: py * PATCH_CELLS,
      slot: own,
      parent,
      edges,
      border,
      own: level > 0 ? Math.round(morph * 255) : 0,
      wet: tree.min[node]! < this.#sight.waterOn(level, px, py),
      corners,
    });
    const fact = this.#count * FACT_WORDS;
    this.#bounds[fact] = tree.min[node]!;
    this.#bounds[fact + 1] = tree.max[node]!;
    this.#facts[fact + 2] = node;
    this.#count += 1;
  }

  #slot(page: number): number {
    const known = this.#slotOf[page]!;
    if (known >= 0) return known;
    const { tree } = this;
    const found = this.#slots!.slot(tree.tileLevel[page]!, tree.tileX[page]!, tree.tileY[page]!);
    this.#slotOf[page] = found;
    return found;
  }

  /**
   * Weight of the corner towards (sx, sy), 0 where the domain ends: the greatest weight of the patches of this level that
   * meet there. Not for level 0.
   */
  #cornerMorph(node: number, sx: number, sy: number, own: number): number {
    const { tree } = this;
    let weight = own;
    for (let i = 1; i < 4; i += 1) {
      const dx = (i & 1) * sx;
      const dy = (i >> 1) * sy;
      if ((i & 1 && dx === 0) || (i & 2 && dy === 0)) continue;
      const at = tree.neighbour(node, dx, dy);
      if (at < 0) return 1;
      const up = tree.above(at);
      if (this.#split[up] === 0) return 1;
      if (this.#split[at] === 1) return 0;
      weight = Math.max(weight, morphOf(this.#ratio[up]!), tree.fade[at >> 4]!);
    }
    return weight;
  }

  /** True when the patch is a node of the cut's tree (drawn or split): its parent is split. -1: its tile is not there. */
  #exists(level: number, node: number): boolean {
    return level === 0 || (node >= 0 && this.#split[this.tree.above(node)] === 1);
  }
}

/** 1 when the parent's error is at the bound (about to be merged), 0 from `MORPH_WIDTH` beyond it on. */
function morphOf(parentRatio: number): number {
  return Math.min(1, Math.max(0, 1 - (parentRatio - 1) / MORPH_WIDTH));
}
