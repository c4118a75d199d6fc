/**
 * Heights and picking on a fixed set of tiles (DESIGN 9, 12). The surface at a point is the bilinear one of the finest
 * tile that covers it; picking marches that same surface, front to back, through boxes, sub-patches and cells.
 */

import { tileKey } from "../core/tilekey.ts";
import type { Ground, Ray, Tile, Vec3 } from "../core/types.ts";
import { PATCH_CELLS, SUBPATCHES, TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";
import { type March, marchPatch } from "./march.ts";

/** Highest point of a tile and of all held tiles below it. */
type Summits = Map<number, number>;

/** A ground that never changes. */
export class TileGround implements Ground {
  readonly sizeM: number;
  /** Finest level of the tiles that are there. */
  private readonly finest: number;
  private readonly tiles: ReadonlyMap<number, Tile>;
  private summits: Summits | null = null;

  constructor(sizeM: number, tiles: ReadonlyMap<number, Tile>) {
    this.sizeM = sizeM;
    this.tiles = tiles;
    let finest = 0;
    for (const tile of tiles.values()) if (tile.level > finest) finest = tile.level;
    this.finest = finest;
  }

  /** Metres. Outside the domain the height of the nearest border; 0 while nothing is held. */
  heightAt(x: number, y: number): number {
    const px = Math.min(Math.max(x, 0), this.sizeM);
    const py = Math.min(Math.max(y, 0), this.sizeM);
    for (let level = this.finest; level >= 0; level--) {
      const width = this.sizeM / 2 ** level;
      const last = 2 ** level - 1;
      const tx = Math.min(Math.floor(px / width), last);
      const ty = Math.min(Math.floor(py / width), last);
      const tile = this.tiles.get(tileKey(level, tx, ty));
      if (tile) return bilinear(tile.heights, (px / width - tx) * TILE_CELLS, (py / width - ty) * TILE_CELLS);
    }
    return 0;
  }

  /**
   * First point at which the ray meets the surface, or null. A ray that starts outside and enters the domain below the
   * surface, through its side, hits nothing.
   */
  raycast(ray: Ray): Vec3 | null {
    const root = this.tiles.get(tileKey(0, 0, 0));
    const [ox, oy, oz] = ray.origin;
    const [dx, dy, dz] = ray.dir;
    const span = { from: 0, to: Number.POSITIVE_INFINITY };
    if (!root || !clip(span, ox, dx, 0, this.sizeM, true) || !clip(span, oy, dy, 0, this.sizeM, true)) return null;
    const above = oz + span.from * dz >= this.heightAt(ox + span.from * dx, oy + span.from * dy);
    if (!above && span.from > 0) return null;
    const march: March = { ox, oy, oz, dx, dy, dz, above };
    this.summits ??= this.findSummits();
    const t = this.visit(root, march, span.from, span.to);
    return t === null ? null : [ox + t * dx, oy + t * dy, oz + t * dz];
  }

  private findSummits(): Summits {
    const summits: Summits = new Map();
    const byLevel: Tile[][] = Array.from({ length: this.finest + 1 }, () => []);
    for (const tile of this.tiles.values()) byLevel[tile.level]!.push(tile);
    for (let level = this.finest; level >= 0; level--) {
      for (const tile of byLevel[level]!) {
        let top = Math.max(...tile.subMax);
        for (let q = 0; q < 4; q++) {
          const below = summits.get(tileKey(level + 1, 2 * tile.x + (q & 1), 2 * tile.y + (q >> 1)));
          if (below !== undefined && below > top) top = below;
        }
        summits.set(tileKey(level, tile.x, tile.y), top);
      }
    }
    return summits;
  }

  /** Marches a tile and the held tiles below it over ray parameters [from, to]. */
  private visit(tile: Tile, march: March, from: number, to: number): number | null {
    if (passesOver(march, from, to, this.summits!.get(tileKey(tile.level, tile.x, tile.y))!)) return null;
    const flip = (march.dx < 0 ? 1 : 0) | (march.dy < 0 ? 2 : 0);
    for (let i = 0; i < 4; i++) {
      const q = i ^ flip;
      const qx = q & 1;
      const qy = q >> 1;
      const span = { from, to };
      const x = 2 * tile.x + qx;
      const y = 2 * tile.y + qy;
      if (!clipSquare(span, march, x, y, 2 << tile.level, this.sizeM)) continue;
      const child = this.tiles.get(tileKey(tile.level + 1, x, y));
      const t = child
        ? this.visit(child, march, span.from, span.to)
        : this.visitQuarter(tile, qx, qy, flip, march, span.from, span.to);
      if (t !== null) return t;
    }
    return null;
  }

  /** The four sub-patches of a tile's quarter, where no child is held. */
  private visitQuarter(
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
      const origin = PATCH_CELLS * (row * TILE_SAMPLES + col);
      const t = marchPatch(
        tile.heights,
        origin,
        x * PATCH_CELLS * cell,
        y * PATCH_CELLS * cell,
        cell,
        march,
        span.from,
        span.to,
      );
      if (t !== null) return t;
    }
    return null;
  }
}

/** Height at fractional column `c` and row `r` of a tile's 65x65 samples. */
function bilinear(heights: Float32Array, c: number, r: number): number {
  const col = Math.min(Math.floor(c), TILE_CELLS - 1);
  const row = Math.min(Math.floor(r), TILE_CELLS - 1);
  const u = c - col;
  const v = r - row;
  const at = row * TILE_SAMPLES + col;
  const south = heights[at]! * (1 - u) + heights[at + 1]! * u;
  const north = heights[at + TILE_SAMPLES]! * (1 - u) + heights[at + TILE_SAMPLES + 1]! * u;
  return south * (1 - v) + north * v;
}

interface Span {
  from: number;
  to: number;
}

/**
 * Narrows the span to where `origin + t * dir` is in [low, high]; false when nothing is left. A ray along a shared edge
 * belongs to the upper side, as in `heightAt`, unless `last`: the edge is the domain's.
 */
function clip(span: Span, origin: number, dir: number, low: number, high: number, last: boolean): boolean {
  if (dir === 0) return origin >= low && (origin < high || (last && origin === high));
  const a = (low - origin) / dir;
  const b = (high - origin) / dir;
  span.from = Math.max(span.from, Math.min(a, b));
  span.to = Math.min(span.to, Math.max(a, b));
  return span.from <= span.to;
}

/** Narrows the span to square (x, y) of a grid with `count` squares a side of the domain. */
function clipSquare(span: Span, m: March, x: number, y: number, count: number, sizeM: number): boolean {
  const low = (i: number) => (sizeM * i) / count;
  return (
    clip(span, m.ox, m.dx, low(x), low(x + 1), x + 1 === count) &&
    clip(span, m.oy, m.dy, low(y), low(y + 1), y + 1 === count)
  );
}

/** True when the ray, known to be above the ground, stays above `top` all the way. */
function passesOver(march: March, from: number, to: number, top: number): boolean {
  if (!march.above) return false;
  const lowest = march.dz < 0 ? march.oz + to * march.dz : march.oz + from * march.dz;
  return lowest > top;
}
