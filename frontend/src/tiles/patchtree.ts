/**
 * What the selection knows of the ground: per 16-cell sub-patch of every level its bounds and the error of stopping
 * there, in flat arrays `[py * side + px]` (DESIGN 7, 9). A sub-patch is a node of the tree that is drawn: level l has
 * 4 * 2^l of them a side, and the four children of (l, px, py) are (l + 1, 2 px + {0,1}, 2 py + {0,1}), all in one tile.
 *
 * Two masks say what may be drawn: `held` (the store has the tile) and `usable` (the renderer has it in its atlas).
 */

import type { Tile, TileView } from "../core/types.ts";
import { SUBPATCHES } from "../generated/contract.ts";

/** One level of the tree. */
export class PatchLevel {
  /** Sub-patches along one side. */
  readonly side: number;
  /** Tiles along one side. */
  readonly tileSide: number;
  readonly ownMin: Float32Array;
  readonly ownMax: Float32Array;
  readonly ownError: Float32Array;
  /** Bounds of the sub-patch and all its held descendants, metres. */
  readonly min: Float32Array;
  readonly max: Float32Array;
  /** Largest distance, metres, between this sub-patch as drawn and its held descendants; 0 where there are none. */
  readonly error: Float32Array;
  readonly held: Uint8Array;
  readonly usable: Uint8Array;
  /** 1 where the sub-patch may be split without breaking the restriction, given the usable tiles. */
  readonly splittable: Uint8Array;
  /** Stamp of the tile whose figures the arrays hold. */
  readonly stamps: Float64Array;

  constructor(readonly level: number) {
    this.tileSide = 1 << level;
    this.side = SUBPATCHES << level;
    const patches = this.side * this.side;
    const tiles = this.tileSide * this.tileSide;
    this.ownMin = new Float32Array(patches);
    this.ownMax = new Float32Array(patches);
    this.ownError = new Float32Array(patches);
    this.min = new Float32Array(patches);
    this.max = new Float32Array(patches);
    this.error = new Float32Array(patches);
    this.held = new Uint8Array(tiles);
    this.usable = new Uint8Array(tiles);
    this.splittable = new Uint8Array(patches);
    this.stamps = new Float64Array(tiles).fill(-1);
  }
}

export class PatchTree {
  readonly levels: readonly PatchLevel[];
  private syncedStamp = -1;
  private splittableStale = true;

  /** `levels`: the finest level that can exist. */
  constructor(levels: number) {
    this.levels = Array.from({ length: levels + 1 }, (_, level) => new PatchLevel(level));
  }

  /** Reads what changed in the store since the last call. Returns false when nothing did. */
  sync(view: TileView): boolean {
    if (view.stamp === this.syncedStamp) return false;
    this.syncedStamp = view.stamp;
    for (const at of this.levels) at.held.fill(0);
    for (const tile of view.tiles()) {
      const at = this.levels[tile.level];
      if (at === undefined) continue;
      const index = tile.y * at.tileSide + tile.x;
      at.held[index] = 1;
      if (at.stamps[index] !== tile.stamp) {
        at.stamps[index] = tile.stamp;
        readTile(at, tile);
      }
    }
    for (let level = this.levels.length - 1; level >= 0; level -= 1) this.merge(level);
    return true;
  }

  /** Says whether a tile may be drawn (its slot in the atlas is filled). */
  setUsable(level: number, x: number, y: number, usable: boolean): void {
    const at = this.levels[level];
    if (at === undefined) return;
    const index = y * at.tileSide + x;
    const value = usable ? 1 : 0;
    if (at.usable[index] === value) return;
    at.usable[index] = value;
    this.splittableStale = true;
  }

  /**
   * Brings `splittable` up to date: a sub-patch may be split when the tile of its children is usable and its eight
   * neighbours can exist, so that no two drawn neighbours, corners too, ever differ by more than one level.
   */
  updateSplittable(): void {
    if (!this.splittableStale) return;
    this.splittableStale = false;
    for (const at of this.levels) at.splittable.fill(0);
    for (let level = 0; level + 1 < this.levels.length; level += 1) {
      const at = this.levels[level]!;
      const fine = this.levels[level + 1]!;
      const coarse = level > 0 ? this.levels[level - 1]! : undefined;
      let any = false;
      for (let ty = 0; ty < fine.tileSide; ty += 1) {
        for (let tx = 0; tx < fine.tileSide; tx += 1) {
          if (fine.usable[ty * fine.tileSide + tx] === 0) continue;
          // A tile of the finer level covers 2 x 2 sub-patches of this one.
          for (let i = 0; i < 4; i += 1) {
            const px = 2 * tx + (i & 1);
            const py = 2 * ty + (i >> 1);
            if (coarse === undefined ? at.usable[0] === 1 : neighboursCanExist(coarse, at.side, px, py)) {
              at.splittable[py * at.side + px] = 1;
              any = true;
            }
          }
        }
      }
      if (!any) break;
    }
  }

  private merge(level: number): void {
    const at = this.levels[level]!;
    at.min.set(at.ownMin);
    at.max.set(at.ownMax);
    at.error.fill(0);
    const fine = this.levels[level + 1];
    if (fine === undefined) return;
    for (let ty = 0; ty < fine.tileSide; ty += 1) {
      for (let tx = 0; tx < fine.tileSide; tx += 1) {
        if (fine.held[ty * fine.tileSide + tx] === 1) mergeTile(at, fine, tx, ty);
      }
    }
  }
}

function neighboursCanExist(coarse: PatchLevel, side: number, px: number, py: number): boolean {
  const x0 = Math.max(0, px - 1) >> 1;
  const x1 = Math.min(side - 1, px + 1) >> 1;
  const y0 = Math.max(0, py - 1) >> 1;
  const y1 = Math.min(side - 1, py + 1) >> 1;
  for (let y = y0; y <= y1; y += 1) {
    for (let x = x0; x <= x1; x += 1) if (coarse.splittable[y * coarse.side + x] === 0) return false;
  }
  return true;
}

function readTile(at: PatchLevel, tile: Tile): void {
  for (let row = 0; row < SUBPATCHES; row += 1) {
    const to = (tile.y * SUBPATCHES + row) * at.side + tile.x * SUBPATCHES;
    const from = row * SUBPATCHES;
    for (let col = 0; col < SUBPATCHES; col += 1) {
      const error = tile.subError[from + col]!;
      at.ownError[to + col] = error;
      // The morph may show the parent's surface, which lies within `error` of this one.
      at.ownMin[to + col] = tile.subMin[from + col]! - error;
      at.ownMax[to + col] = tile.subMax[from + col]! + error;
    }
  }
}

function mergeTile(at: PatchLevel, fine: PatchLevel, tx: number, ty: number): void {
  for (let i = 0; i < 4; i += 1) {
    const px = 2 * tx + (i & 1);
    const py = 2 * ty + (i >> 1);
    const to = py * at.side + px;
    for (let j = 0; j < 4; j += 1) {
      const from = (2 * py + (j >> 1)) * fine.side + 2 * px + (j & 1);
      at.min[to] = Math.min(at.min[to]!, fine.min[from]!);
      at.max[to] = Math.max(at.max[to]!, fine.max[from]!);
      at.error[to] = Math.max(at.error[to]!, fine.ownError[from]!, fine.error[from]!);
    }
  }
}
