/**
 * Heights and picking on a fixed set of tiles (DESIGN 9, 12). The surface at a point is the bilinear one of the finest
 * tile that covers it; picking marches that same surface, front to back, through boxes, sub-patches and cells.
 */

import { tileKey } from "../core/tilekey.ts";
import type { Ground, Ray, Tile, Vec3 } from "../core/types.ts";
import { PATCH_CELLS, SUBPATCHES, TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";
import { clip, clipSquare, type March, marchPatch, passesOver } from "./detail/march.ts";

/** Highest point of a tile, and of each of its sub-patches [row*4 + col], with all held tiles below it. Metres. */
export interface Summit {
  readonly top: number;
  readonly subs: Float32Array;
}

export type Summits = ReadonlyMap<number, Summit>;

/** A ground that never changes. */
export class TileGround implements Ground {
  readonly sizeM: number;
  /** Finest level of the tiles that are there; -1 while there are none. */
  readonly finest: number;
  readonly #tiles: ReadonlyMap<number, Tile>;
  #found: Summits | null = null;

  constructor(sizeM: number, tiles: ReadonlyMap<number, Tile>) {
    this.sizeM = sizeM;
    this.#tiles = tiles;
    let finest = -1;
    for (const tile of tiles.values()) if (tile.level > finest) finest = tile.level;
    this.finest = finest;
  }

  tile(level: number, x: number, y: number): Tile | undefined {
    return this.#tiles.get(tileKey(level, x, y));
  }

  /** Metres. Outside the domain the height of the nearest border; 0 while nothing is held. */
  heightAt(x: number, y: number): number {
    const [px, py] = [this.#inside(x), this.#inside(y)];
    const tile = this.#finestAt(px, py);
    if (tile === undefined) return 0;
    const width = this.sizeM / 2 ** tile.level;
    return bilinear(tile.heights, TILE_CELLS, (px / width - tile.x) * TILE_CELLS, (py / width - tile.y) * TILE_CELLS);
  }

  /** Level of the finest tile that covers a place; -1 while nothing is held. */
  levelAt(x: number, y: number): number {
    return this.#finestAt(this.#inside(x), this.#inside(y))?.level ?? -1;
  }

  #inside(v: number): number {
    return Math.min(Math.max(v, 0), this.sizeM);
  }

  #finestAt(x: number, y: number): Tile | undefined {
    for (let level = this.finest; level >= 0; level--) {
      const n = 2 ** level;
      const at = (v: number): number => Math.min(Math.floor((v / this.sizeM) * n), n - 1);
      const tile = this.#tiles.get(tileKey(level, at(x), at(y)));
      if (tile !== undefined) return tile;
    }
    return undefined;
  }

  /**
   * First point at which the ray meets the surface, or null. A ray that starts outside and enters the domain below the
   * surface, through its side, hits nothing.
   */
  raycast(ray: Ray): Vec3 | null {
    const root = this.#tiles.get(tileKey(0, 0, 0));
    const [ox, oy, oz] = ray.origin;
    const [dx, dy, dz] = ray.dir;
    const span = { from: 0, to: Number.POSITIVE_INFINITY };
    if (!root || !clip(span, ox, dx, 0, this.sizeM, true) || !clip(span, oy, dy, 0, this.sizeM, true)) return null;
    const above = oz + span.from * dz >= this.heightAt(ox + span.from * dx, oy + span.from * dy);
    if (!above && span.from > 0) return null;
    const march: March = { ox, oy, oz, dx, dy, dz, above };
    const t = this.#visit(root, march, span.from, span.to);
    return t === null ? null : [ox + t * dx, oy + t * dy, oz + t * dz];
  }

  /** The summits of all tiles, found when somebody first asks. */
  get summits(): Summits {
    this.#found ??= this.#findSummits();
    return this.#found;
  }

  #findSummits(): Summits {
    const summits = new Map<number, Summit>();
    const byLevel: Tile[][] = Array.from({ length: this.finest + 1 }, () => []);
    for (const tile of this.#tiles.values()) byLevel[tile.level]!.push(tile);
    for (let level = this.finest; level >= 0; level--) {
      for (const tile of byLevel[level]!) {
        const subs = tile.subMax.slice();
        for (let q = 0; q < 4; q++) {
          const below = summits.get(tileKey(level + 1, 2 * tile.x + (q & 1), 2 * tile.y + (q >> 1)));
          if (below !== undefined) raise(subs, below.subs, q);
        }
        summits.set(tileKey(level, tile.x, tile.y), { top: Math.max(...subs), subs });
      }
    }
    return summits;
  }

  /** Marches a tile and the held tiles below it over ray parameters [from, to]. */
  #visit(tile: Tile, march: March, from: number, to: number): number | null {
    if (passesOver(march, from, to, this.summits.get(tileKey(tile.level, tile.x, tile.y))!.top)) return null;
    const flip = (march.dx < 0 ? 1 : 0) | (march.dy < 0 ? 2 : 0);
    for (let i = 0; i < 4; i++) {
      const q = i ^ flip;
      const qx = q & 1;
      const qy = q >> 1;
      const span = { from, to };
      const x = 2 * tile.x + qx;
      const y = 2 * tile.y + qy;
      if (!clipSquare(span, march, x, y, 2 << tile.level, this.sizeM)) continue;
      const child = this.#tiles.get(tileKey(tile.level + 1, x, y));
      const t = child
        ? this.#visit(child, march, span.from, span.to)
        : this.#visitQuarter(tile, qx, qy, flip, march, span.from, span.to);
      if (t !== null) return t;
    }
    return null;
  }

  /** The four sub-patches of a tile's quarter, where no child is held. */
  #visitQuarter(
    tile: Tile,
    qx: number,
    qy: number,
    flip: number,
    march: March,
    from: number,
    to: number,
  ): number | null {
    const cell = this.sizeM / (TILE_CELLS * 2 ** tile.level);
    for (let i = 0; i < 4; i++) {
      const s = i ^ flip;
      const col = 2 * qx + (s & 1);
      const row = 2 * qy + (s >> 1);
      const x = tile.x * SUBPATCHES + col;
      const y = tile.y * SUBPATCHES + row;
      const span = { from, to };
      if (!clipSquare(span, march, x, y, SUBPATCHES << tile.level, this.sizeM)) continue;
      if (passesOver(march, span.from, span.to, tile.subMax[row * SUBPATCHES + col]!)) continue;
      const patch = {
        heights: tile.heights,
        stride: TILE_SAMPLES,
        origin: PATCH_CELLS * (row * TILE_SAMPLES + col),
        x0: x * PATCH_CELLS * cell,
        y0: y * PATCH_CELLS * cell,
        cell,
        cells: PATCH_CELLS,
      };
      const t = marchPatch(patch, march, span.from, span.to);
      if (t !== null) return t;
    }
    return null;
  }
}

/** Raises the sub-patches of a tile to those of its child in quarter `q`: four of the child's lie on one of the tile's. */
function raise(subs: Float32Array, below: Float32Array, q: number): void {
  const half = SUBPATCHES / 2;
  for (let row = 0; row < SUBPATCHES; row++)
    for (let col = 0; col < SUBPATCHES; col++) {
      const at = ((q >> 1) * half + (row >> 1)) * SUBPATCHES + (q & 1) * half + (col >> 1);
      subs[at] = Math.max(subs[at]!, below[row * SUBPATCHES + col]!);
    }
}

/** Height at fractional column `c` and row `r` of a square of `cells` cells a side and one sample more. */
export function bilinear(heights: Float32Array, cells: number, c: number, r: number): number {
  const col = Math.min(Math.floor(c), cells - 1);
  const row = Math.min(Math.floor(r), cells - 1);
  const u = c - col;
  const v = r - row;
  const at = row * (cells + 1) + col;
  const north = at + cells + 1;
  const a = heights[at]! * (1 - u) + heights[at + 1]! * u;
  const b = heights[north]! * (1 - u) + heights[north + 1]! * u;
  return a * (1 - v) + b * v;
}
