/** Patches of a tree as an eye sees them: which lie in view, and how many pixels their error covers. */

import { eyeProjection } from "../../core/camera/projection.ts";
import type { CameraState } from "../../core/types.ts";
import { PATCH_CELLS, QUANTA_PER_CELL, SUBPATCHES } from "../../generated/contract.ts";
import type { PatchTree } from "./patchtree.ts";

/** A cell is never split further once it covers fewer pixels than this many taus. */
const SMALLEST_CELL = 1;
/** Where a cell is wide on the screen, what its children would add to the shading counts too: error per child cell. */
const SHADING_ERROR = 1.5 / QUANTA_PER_CELL;
const SHADING_CELL_PX = 5;
/** How high water may stand on a patch, metres; -Infinity where there is none (tiles/lakes/lakes.ts, Surfaces). */
export interface Water {
  highest(level: number, px: number, py: number): number;
}

export const DRY: Water = { highest: () => Number.NEGATIVE_INFINITY };

export class Sight {
  sizeM = 1;
  eye: readonly number[] = [0, 0, 0];
  readonly #planes = new Float64Array(24);
  #pixels = 1;
  #ortho = false;
  #tau = 1;
  /** How many times heights are seen larger than they are. */
  #k = 1;
  #water = DRY;

  readonly #tree: PatchTree;

  constructor(tree: PatchTree) {
    this.#tree = tree;
  }

  /** Takes over a view; parameters as of `Selection.select`. */
  begin(sizeM: number, camera: CameraState, tauPx: number, pixelScale: number, water: Water): void {
    this.sizeM = sizeM;
    this.#water = water;
    this.#tau = tauPx;
    this.eye = camera.eye;
    this.#k = camera.exaggeration ?? 1;
    this.#ortho = camera.orthoHeight > 0;
    const heightPx = camera.height * pixelScale;
    this.#pixels = this.#ortho
      ? heightPx / camera.orthoHeight
      : heightPx / (2 * Math.tan((camera.fovDeg * Math.PI) / 360));
    frustumPlanes(eyeProjection(camera), this.#planes);
  }

  /** Error of stopping at this patch, in taus; at most 1 when it need not be split. */
  screenError(level: number, node: number): number {
    const cell = this.sizeM / ((SUBPATCHES << level) * PATCH_CELLS);
    const scale = this.#pixels / (this.#ortho ? 1 : this.#distance(level, node));
    const cellPx = cell * scale;
    if (cellPx <= SMALLEST_CELL * this.#tau) return 0;
    const error = this.#tree.error[node]!;
    const geometric = (this.#k * error * scale) / this.#tau;
    const rough = this.#k * error > SHADING_ERROR * cell ? cellPx / (SHADING_CELL_PX * this.#tau) : 0;
    return Math.max(geometric, rough);
  }

  /** Column and row of a node on its level. */
  column(node: number): number {
    return this.#tree.tileX[node >> 4]! * SUBPATCHES + (node & 3);
  }

  row(node: number): number {
    return this.#tree.tileY[node >> 4]! * SUBPATCHES + ((node >> 2) & 3);
  }

  /** Metres from the eye to the box of a patch. */
  #distance(level: number, node: number): number {
    const w = this.sizeM / (SUBPATCHES << level);
    const px = this.column(node);
    const py = this.row(node);
    const dx = outside(this.eye[0]!, px * w, (px + 1) * w);
    const dy = outside(this.eye[1]!, py * w, (py + 1) * w);
    const dz = this.#k * outside(this.eye[2]!, this.#tree.min[node]!, this.#tree.max[node]!);
    return Math.max(1e-3, Math.sqrt(dx * dx + dy * dy + dz * dz));
  }

  /** Says whether some of the box of a patch, with the water on it, may be in view. */
  visible(level: number, node: number): boolean {
    const w = this.sizeM / (SUBPATCHES << level);
    const x0 = this.column(node) * w - this.eye[0]!;
    const y0 = this.row(node) * w - this.eye[1]!;
    const p = this.#planes;
    const low = this.#tree.min[node]! - this.eye[2]!;
    const high = this.highest(level, node) - this.eye[2]!;
    for (let i = 0; i < 24; i += 4) {
      const a = p[i]!;
      const b = p[i + 1]!;
      const c = p[i + 2]!;
      const far = a * (a > 0 ? x0 + w : x0) + b * (b > 0 ? y0 + w : y0) + c * (c > 0 ? high : low);
      if (far + p[i + 3]! < 0) return false;
    }
    return true;
  }

  /** Returns the highest place of a patch: its ground, or the water on it. */
  highest(level: number, node: number): number {
    return Math.max(this.#tree.max[node]!, this.waterOn(level, this.column(node), this.row(node)));
  }

  /** How high water may stand on the patch of a column and row. */
  waterOn(level: number, px: number, py: number): number {
    return this.#water.highest(level, px, py);
  }
}

function outside(v: number, low: number, high: number): number {
  return v < low ? low - v : v > high ? v - high : 0;
}

/** Six planes (a, b, c, d), positive inside, of a column-major matrix with z from 0 to 1. */
function frustumPlanes(m: ArrayLike<number>, out: Float64Array): void {
  for (let c = 0; c < 4; c += 1) {
    const x = m[4 * c]!;
    const y = m[4 * c + 1]!;
    const z = m[4 * c + 2]!;
    const w = m[4 * c + 3]!;
    out[c] = w + x;
    out[4 + c] = w - x;
    out[8 + c] = w + y;
    out[12 + c] = w - y;
    out[16 + c] = z;
    out[20 + c] = w - z;
  }
}
