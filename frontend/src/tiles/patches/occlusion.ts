/**
 * Which patches the ground in front of them hides (DESIGN 9): a horizon over the columns of the picture.
 *
 * A column is a vertical plane through the eye, named by t = side / depth of the directions in it, where `depth` is
 * measured along the level part of the view direction. In a column a ray is named by its slope q = rise / depth. Ground
 * is a continuous surface below the eye: a ray that passes below a patch's guaranteed lowest height has met ground no
 * farther than that patch. So patches that are taken front to back raise a horizon, and one whose guaranteed highest
 * height stays below it in all columns that it touches shows in no pixel.
 *
 * A patch counts for the columns that it crosses from side to side; where two meet inside of a column, both together do.
 */

import type { CameraState, Tile } from "../../core/types.ts";
import { TILE_CELLS, TILE_SAMPLES } from "../../generated/contract.ts";

const COLUMNS = 1024;
/** A view whose lowest rays are steeper than this looks down on the ground: nothing to hide, and columns degenerate. */
const LEAST_DEPTH = 0.1;
/**
 * A patch is hidden only when it lies below the horizon by this much of a slope: far less than a pixel, far more than
 * rounding.
 */
const MARGIN = 1e-6;
const NONE = Number.NEGATIVE_INFINITY;

export class Horizon {
  /** Rays below this slope have ended, by column. */
  readonly #slope = new Float64Array(COLUMNS);
  /** Best patch that covers a column from its left side up to `leftEnd`, in columns; and from `rightEnd` to its right side. */
  readonly #left = new Float64Array(COLUMNS);
  readonly #leftEnd = new Float64Array(COLUMNS);
  readonly #right = new Float64Array(COLUMNS);
  readonly #rightEnd = new Float64Array(COLUMNS);
  #forwardX = 1;
  #forwardY = 0;
  #perT = 1;
  #active = false;
  // Columns that the square measured last covers, and the depths between which it lies.
  #from = 0;
  #to = 0;
  #near = 0;
  #far = 0;

  /** Starts a picture. Nothing is hidden in maps and in views straight down, nor unless the eye is `above` the ground. */
  begin(camera: CameraState, above: boolean): void {
    this.#active = false;
    if (!above || camera.orthoHeight > 0) return;
    const x = camera.target[0] - camera.eye[0];
    const y = camera.target[1] - camera.eye[1];
    const z = (camera.exaggeration ?? 1) * (camera.target[2] - camera.eye[2]);
    const level = Math.hypot(x, y);
    const length = Math.hypot(level, z);
    if (level === 0 || camera.up[2] < 0.999) return;
    const tanV = Math.tan((camera.fovDeg * Math.PI) / 360);
    const tanH = (tanV * camera.width) / camera.height;
    // Depth of the rays of the picture's lower and upper edge (forward ± tanV · up).
    const depth = (level - tanV * Math.abs(z)) / length;
    if (depth < LEAST_DEPTH) return;
    this.#forwardX = x / level;
    this.#forwardY = y / level;
    this.#perT = COLUMNS / 2 / (tanH / depth);
    this.#slope.fill(NONE);
    this.#left.fill(NONE);
    this.#right.fill(NONE);
    this.#active = true;
  }

  /** True when nothing of a square [x, x + w] × [y, y + w] up to `high` can be seen. All relative to the eye. */
  hides(x: number, y: number, w: number, high: number): boolean {
    if (!this.#active || !this.#measure(x, y, w)) return false;
    const q = high / (high > 0 ? this.#near : this.#far) + MARGIN;
    const first = Math.max(0, Math.floor(this.#from));
    const last = Math.min(COLUMNS - 1, Math.floor(this.#to));
    if (first > last) return false;
    for (let c = first; c <= last; c += 1) if (this.#slope[c]! <= q) return false;
    return true;
  }

  /** Takes in a square of drawn ground that is nowhere lower than `low`. It must not lie in front of an earlier one. */
  add(x: number, y: number, w: number, low: number): void {
    if (!this.#active || !this.#measure(x, y, w)) return;
    const q = low / (low > 0 ? this.#far : this.#near);
    const from = this.#from;
    const to = this.#to;
    const slope = this.#slope;
    if (to <= 0 || from >= COLUMNS) return;
    const first = Math.max(0, Math.ceil(from));
    const end = Math.min(COLUMNS, Math.floor(to));
    for (let c = first; c < end; c += 1) if (slope[c]! < q) slope[c] = q;
    if (first > 0 && from < first && to >= first) this.#fromRight(first - 1, from, q);
    if (end < COLUMNS && to > end && from <= end) this.#fromLeft(end, to, q);
  }

  #fromLeft(column: number, end: number, q: number): void {
    if (end >= this.#rightEnd[column]!) this.#raise(column, Math.min(q, this.#right[column]!));
    if (q <= this.#left[column]!) return;
    this.#left[column] = q;
    this.#leftEnd[column] = end;
  }

  #fromRight(column: number, end: number, q: number): void {
    if (end <= this.#leftEnd[column]!) this.#raise(column, Math.min(q, this.#left[column]!));
    if (q <= this.#right[column]!) return;
    this.#right[column] = q;
    this.#rightEnd[column] = end;
  }

  #raise(column: number, q: number): void {
    if (this.#slope[column]! < q) this.#slope[column] = q;
  }

  /** Columns and depths of a square; false when some of it is beside or behind the eye. */
  #measure(x: number, y: number, w: number): boolean {
    const fx = this.#forwardX;
    const fy = this.#forwardY;
    const depth = x * fx + y * fy;
    const side = x * fy - y * fx;
    this.#near = depth + Math.min(0, w * fx) + Math.min(0, w * fy);
    if (this.#near <= 1e-6 * w) return false;
    this.#far = depth + Math.max(0, w * fx) + Math.max(0, w * fy);
    const a = side / depth;
    const b = (side + w * fy) / (depth + w * fx);
    const c = (side - w * fx) / (depth + w * fy);
    const d = (side + w * (fy - fx)) / (depth + w * (fx + fy));
    this.#from = COLUMNS / 2 + this.#perT * Math.min(a, b, c, d);
    this.#to = COLUMNS / 2 + this.#perT * Math.max(a, b, c, d);
    return true;
  }
}

/**
 * Order in which the cells of a `side` × `side` grid over [0, size]² are met by rays from (x, y): none after one that it
 * could hide. Cells are numbered row * side + column.
 */
export function frontToBack(side: number, size: number, x: number, y: number): number[] {
  const column = Math.min(side - 1, Math.max(0, Math.floor((x / size) * side)));
  const row = Math.min(side - 1, Math.max(0, Math.floor((y / size) * side)));
  const away = (cell: number): number => Math.abs((cell % side) - column) + Math.abs(Math.floor(cell / side) - row);
  return Array.from({ length: side * side }, (_, cell) => cell).sort((a, b) => away(a) - away(b));
}

/** Highest of the four samples around a place of the tile, metres. */
export function highestAround({ level, x, y, heights }: Tile, sizeM: number, atX: number, atY: number): number {
  const cells = TILE_CELLS * 2 ** level;
  const column = Math.floor((atX / sizeM) * cells) - x * TILE_CELLS;
  const at = (Math.floor((atY / sizeM) * cells) - y * TILE_CELLS) * TILE_SAMPLES + column;
  return Math.max(heights[at]!, heights[at + 1]!, heights[at + TILE_SAMPLES]!, heights[at + TILE_SAMPLES + 1]!);
}
