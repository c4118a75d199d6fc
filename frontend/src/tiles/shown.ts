/**
 * The ground as it is drawn: the solved one with synthesised detail (DESIGN 9, 10, 12). Heights and picking go down to the
 * level that a look from there can tell: rays carry how much of the ground a pixel covers.
 */

import { tileKey } from "../core/tilekey.ts";
import type { Ground, Ray, Vec3 } from "../core/types.ts";
import { SUBPATCHES, SYNTH_GULLY_FALL, TILE_CELLS } from "../generated/contract.ts";
import { BLOCK_CELLS, BLOCK_SIDE, blockArea, blockKey, type DetailField, ROOT_BLOCKS } from "./detail/detail.ts";
import { clip, clipSquare, type March, marchPatch, passesOver } from "./detail/march.ts";
import { BORDER, interpolated } from "./detail/subdivide.ts";
import { bilinear, type TileGround } from "./ground.ts";
import { Memo } from "./memo.ts";
import { fillKnown, type HeightOf, heightsOfTiles } from "./patches/guide.ts";

const SAMPLES = BLOCK_CELLS + 1;
/** The level below 0 at which one block covers the domain. */
const WHOLE = -Math.log2(ROOT_BLOCKS);
const REMEMBERED = 2048;
/** Cells of this many pixels are fine enough: patches are drawn with larger ones. */
const CELL_PIXELS = 2;
/** Detail below this share of the wanted cell is left out. */
const NEGLIGIBLE = 0.1;
/** A ray that says nothing: an eye with a picture of a thousand pixels. */
const USUAL_SPREAD: readonly [number, number] = [0, 1e-3];
/** Exponents may fall from level to level by this, and slopes of finer solved levels may be steeper: boxes allow for it. */
const LESS_SMOOTH = 0.1;
const SLACK = 1.5;
const SLACK_SOLVED = 3;

/** A block of the ground as it is drawn at its level. */
interface Surface {
  /** The block's heights without detail, with the border. */
  readonly base: Float64Array;
  /** The block's heights with detail: 9 x 9. */
  readonly heights: Float32Array;
  /** How far finer levels may reach above these heights where no finer tile is held, metres. */
  readonly rest: number;
  readonly top: number;
  /** Greatest detail in the block, metres. */
  readonly relief: number;
}

/** A ground that never changes. */
export class ShownGround implements Ground {
  readonly sizeM: number;
  readonly #solved: TileGround;
  readonly #solvedLevels: number;
  /** The detail that is added to the solved ground. */
  readonly field: DetailField;
  readonly #heightOf: HeightOf;
  readonly #surfaces = new Memo<Surface>(REMEMBERED);

  /** `solvedLevels`: the finest level that is solved everywhere. */
  constructor(solved: TileGround, solvedLevels: number, field: DetailField) {
    this.sizeM = solved.sizeM;
    this.#solved = solved;
    this.#solvedLevels = solvedLevels;
    this.field = field;
    this.#heightOf = heightsOfTiles((level, x, y) => solved.tile(level, x, y));
  }

  /**
   * Metres, with all detail that cells of `cellM` metres can show (left out: the cells of the finest held tile there).
   * Outside the domain the height of the nearest border; 0 while nothing is held.
   */
  heightAt(x: number, y: number, cellM?: number): number {
    const level = cellM === undefined ? this.#solved.levelAt(x, y) : this.#levelFor(cellM);
    if (level < 0) return 0;
    const px = Math.min(Math.max(x, 0), this.sizeM);
    const py = Math.min(Math.max(y, 0), this.sizeM);
    for (let l = 0; ; l += 1) {
      const n = ROOT_BLOCKS * 2 ** l;
      const bx = Math.min(Math.floor((px / this.sizeM) * n), n - 1);
      const by = Math.min(Math.floor((py / this.sizeM) * n), n - 1);
      const surface = this.#surface(l, bx, by);
      if (surface === null) return 0;
      if (l < level && (cellM === undefined || !this.#isDone(surface, l, bx, by, NEGLIGIBLE * cellM))) continue;
      return bilinear(
        surface.heights,
        BLOCK_CELLS,
        ((px / this.sizeM) * n - bx) * BLOCK_CELLS,
        ((py / this.sizeM) * n - by) * BLOCK_CELLS,
      );
    }
  }

  /** Metres without detail: what strokes constrain. */
  solvedAt(x: number, y: number): number {
    return this.#solved.heightAt(x, y);
  }

  /**
   * First point at which the ray meets the surface, or null. A ray that starts outside and enters the domain below the
   * surface, through its side, hits nothing.
   */
  raycast(ray: Ray): Vec3 | null {
    const [ox, oy, oz] = ray.origin;
    const [dx, dy, dz] = ray.dir;
    const span = { from: 0, to: Number.POSITIVE_INFINITY };
    if (this.#solved.finest < 0 || this.#surface(0, 0, 0) === null) return null;
    if (!clip(span, ox, dx, 0, this.sizeM, true) || !clip(span, oy, dy, 0, this.sizeM, true)) return null;
    const pixel = new Footprint(ray);
    const ground = this.heightAt(ox + span.from * dx, oy + span.from * dy, CELL_PIXELS * pixel.at(span.from));
    const above = oz + span.from * dz >= ground;
    if (!above && span.from > 0) return null;
    const march: March = { ox, oy, oz, dx, dy, dz, above };
    const t = this.#visit(WHOLE, 0, 0, march, pixel, span.from, span.to);
    return t === null ? null : [ox + t * dx, oy + t * dy, oz + t * dz];
  }

  #levelFor(cellM: number): number {
    const level = Math.ceil(Math.log2(this.sizeM / TILE_CELLS / Math.max(cellM, 1e-6)));
    return Math.min(Math.max(level, 0), this.field.finest);
  }

  /** Says whether nothing finer than `size` metres is left below a block. */
  #isDone({ rest }: Surface, level: number, x: number, y: number, size: number): boolean {
    return rest <= size && this.#riseOf(level, x, y) === Number.NEGATIVE_INFINITY;
  }

  /** Marches a block, or those below it, over ray parameters [from, to]. */
  #visit(level: number, x: number, y: number, march: March, pixel: Footprint, from: number, to: number): number | null {
    if (level >= 0) {
      const surface = this.#surface(level, x, y)!;
      if (passesOver(march, from, to, this.#topOf(surface, level, x, y))) return null;
      const size = pixel.at(from);
      const cell = this.sizeM / (TILE_CELLS * 2 ** level);
      if (
        cell <= CELL_PIXELS * size ||
        level >= this.field.finest ||
        this.#isDone(surface, level, x, y, NEGLIGIBLE * size)
      ) {
        const [x0, y0] = [x * BLOCK_CELLS * cell, y * BLOCK_CELLS * cell];
        const patch = { heights: surface.heights, stride: SAMPLES, origin: 0, x0, y0, cell, cells: BLOCK_CELLS };
        return marchPatch(patch, march, from, to);
      }
    }
    const flip = (march.dx < 0 ? 1 : 0) | (march.dy < 0 ? 2 : 0);
    for (let i = 0; i < 4; i += 1) {
      const q = i ^ flip;
      const [cx, cy] = [2 * x + (q & 1), 2 * y + (q >> 1)];
      const span = { from, to };
      if (!clipSquare(span, march, cx, cy, ROOT_BLOCKS * 2 ** (level + 1), this.sizeM)) continue;
      const t = this.#visit(level + 1, cx, cy, march, pixel, span.from, span.to);
      if (t !== null) return t;
    }
    return null;
  }

  /** Nothing of the ground over a block, at whatever level it is drawn, is higher. */
  #topOf(surface: Surface, level: number, x: number, y: number): number {
    return Math.max(surface.top, this.#riseOf(level, x, y) + surface.relief + surface.rest);
  }

  /** Greatest height of finer held tiles over a block; -infinity where there are none. */
  #riseOf(level: number, x: number, y: number): number {
    if (level >= this.#solved.finest) return Number.NEGATIVE_INFINITY;
    // Eight cells of a level are one sub-patch of the next.
    const key = tileKey(level + 1, Math.floor(x / SUBPATCHES), Math.floor(y / SUBPATCHES));
    const summit = this.#solved.summits.get(key);
    return summit?.subs[(y % SUBPATCHES) * SUBPATCHES + (x % SUBPATCHES)] ?? Number.NEGATIVE_INFINITY;
  }

  /** The block at its level; null while level 0 is not held. */
  #surface(level: number, x: number, y: number): Surface | null {
    const key = blockKey(level, x, y);
    const known = this.#surfaces.get(key);
    if (known !== undefined) return known;
    const detail = this.field.block(level, x, y);
    if (detail === null) return null;
    const base = this.#baseOf(level, x, y, detail.guide);
    const ratio = 2 ** -Math.max(0.2, detail.exponent - LESS_SMOOTH);
    const slack = level < this.#solvedLevels ? SLACK_SOLVED : SLACK;
    const noise = (detail.sigma * ratio) / (1 - ratio);
    const gullies = (detail.gully * SYNTH_GULLY_FALL) / (1 - SYNTH_GULLY_FALL);
    const made = dressed(base, detail.d, slack * (noise + gullies));
    this.#surfaces.put(key, made);
    return made;
  }

  /** Heights without detail: those of held tiles, between and beyond them interpolated from the parent. */
  #baseOf(level: number, x: number, y: number, guide: Float64Array): Float64Array {
    const area = blockArea(level, x, y);
    const known = new Float64Array(BLOCK_SIDE * BLOCK_SIDE);
    const held = level <= this.#solved.finest ? fillKnown(this.#heightOf, area, known) : 0;
    if (held === known.length) return known;
    if (level === 0) return guide;
    const parent = this.#surface(level - 1, x >> 1, y >> 1)!;
    const between = interpolated(parent.base, blockArea(level - 1, x >> 1, y >> 1), area, this.field.spline);
    if (held > 0) for (let k = 0; k < known.length; k += 1) if (!Number.isNaN(known[k]!)) between[k] = known[k]!;
    return between;
  }
}

/** Metres of the ground that a pixel covers along a ray. */
class Footprint {
  readonly #near: number;
  readonly #gain: number;

  constructor({ dir, spread = USUAL_SPREAD }: Ray) {
    this.#near = spread[0];
    this.#gain = spread[1] * Math.hypot(...dir);
  }

  at(t: number): number {
    return this.#near + this.#gain * t;
  }
}

/** The drawn heights of a block and its bounds. `finer`: how much finer levels may add. */
function dressed(base: Float64Array, d: Float64Array, finer: number): Surface {
  const heights = new Float32Array(SAMPLES * SAMPLES);
  let top = Number.NEGATIVE_INFINITY;
  let relief = Number.NEGATIVE_INFINITY;
  let bend = 0;
  let wrinkle = 0;
  for (let row = 0; row < SAMPLES; row += 1) {
    for (let col = 0; col < SAMPLES; col += 1) {
      const at = (row + BORDER) * BLOCK_SIDE + col + BORDER;
      const z = base[at]! + d[at]!;
      heights[row * SAMPLES + col] = z;
      top = Math.max(top, z);
      relief = Math.max(relief, d[at]!);
      bend = Math.max(bend, bendAt(base, at));
      wrinkle = Math.max(wrinkle, bendAt(d, at));
    }
  }
  // Between samples the 4-point rule leaves the line by an eighth of the second difference at most, per axis. The B-spline
  // rule moves the detail's own samples by an eighth of theirs, and a quarter of that on each further level.
  const rest = finer + bend / 4 + wrinkle / 3;
  return { base, heights, rest, top: top + rest, relief };
}

/** Greatest second difference of a sample of a block with its border, along either axis. */
function bendAt(z: Float64Array, at: number): number {
  const across = z[at - 1]! - 2 * z[at]! + z[at + 1]!;
  const upward = z[at - BLOCK_SIDE]! - 2 * z[at]! + z[at + BLOCK_SIDE]!;
  return Math.max(Math.abs(across), Math.abs(upward));
}
