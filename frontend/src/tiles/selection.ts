/**
 * View-dependent choice of the 16-cell patches that are drawn (DESIGN 7, 9; paper 0, III-A).
 *
 * Descends the patch tree while a patch commits more than `tau` pixels of error, then splits what the restriction asks
 * for: neighbours, across corners too, differ by at most one level. Each drawn patch gets four edge bits (its
 * neighbour there is coarser: odd vertices snap) and a morph weight for each of its four corners. A weight is a property
 * of the corner's point, the same for all patches that meet there: 1 where one of them is coarser (all draw the parent's
 * sample), 0 where one is finer, else by screen error. Bilinear weights between the corners then agree along every
 * shared edge, so patches meet exactly.
 */

import type { CameraState, TileView } from "../core/types.ts";
import { QUANTA_PER_CELL } from "../generated/contract.ts";
import { type PatchLevel, PatchTree } from "./patchtree.ts";

/** Uint32 words of a patch record; the vertex shader reads the same (terrain.wgsl, `PatchIn`). */
export const RECORD_WORDS = 4;

export const EDGE_WEST = 1;
export const EDGE_EAST = 2;
export const EDGE_SOUTH = 4;
export const EDGE_NORTH = 8;
/** In a record's third word: some of the patch lies below the sea. */
export const WET = 1 << 16;

/** A cell is never split further once it covers fewer pixels than this many taus. */
const SMALLEST_CELL = 1;
/** Where a cell is wide on the screen, what its children would add to the shading counts too: error per child cell. */
const SHADING_ERROR = 1.5 / QUANTA_PER_CELL;
const SHADING_CELL_PX = 5;

export interface TileRequest {
  readonly level: number;
  readonly x: number;
  readonly y: number;
}

/** The drawn cut. Arrays are reused by the next call of `select`. */
export interface Cut {
  /** Drawn patches, roughly front to back. */
  readonly count: number;
  /**
   * Per patch four words: column | row << 16 of its south-west vertex in samples of its level; own slot | parent slot << 16;
   * level | edge bits << 8 | border bits << 12 | (1 << 16 where some of it lies below the sea); four corner morph weights as unorm8 (south-west, south-east, north-west,
   * north-east).
   */
  readonly records: Uint32Array;
  /** Held tiles that a finer picture needs and that are not usable yet, coarse first, then by screen error. */
  readonly requests: readonly TileRequest[];
  /** Lowest and highest ground of the whole domain, metres. */
  readonly minHeight: number;
  readonly maxHeight: number;
}

/** What the selection asks of the atlas. */
export interface Slots {
  /** Slot of a usable tile. */
  slot(level: number, x: number, y: number): number;
  /** Called once per usable tile that the cut rests on (drawn tiles, their parents and all ancestors). */
  touch(level: number, x: number, y: number): void;
}

interface Wish extends TileRequest {
  priority: number;
}

export class Selection {
  readonly tree: PatchTree;
  private readonly split: Uint8Array[];
  /** Screen error of a split patch in taus: its children morph towards it as this falls to 1. */
  private readonly ratio: Float32Array[];
  private readonly splitList: number[][];
  private readonly wished: Uint8Array[];
  private wishes: Wish[] = [];
  private readonly planes = new Float64Array(24);
  private records = new Uint32Array(RECORD_WORDS * 1024);
  private count = 0;
  private eye: readonly number[] = [0, 0, 0];
  private pixels = 1;
  private ortho = false;
  private tau = 1;
  private sizeM = 1;
  private seaM = Number.NEGATIVE_INFINITY;
  private slots: Slots | null = null;

  constructor(readonly levels: number) {
    this.tree = new PatchTree(levels);
    this.split = this.tree.levels.map((at) => new Uint8Array(at.side * at.side));
    this.ratio = this.tree.levels.map((at) => new Float32Array(at.side * at.side));
    this.splitList = this.tree.levels.map(() => []);
    this.wished = this.tree.levels.map((at) => new Uint8Array(at.tileSide * at.tileSide));
  }

  /**
   * Chooses the cut among the usable tiles.
   *
   * `pixelScale` scales the camera's height to the pixels that are really drawn (adaptive resolution). `seaM`: patches
   * below it are drawn as far as its surface is in view.
   */
  select(
    view: TileView,
    camera: CameraState,
    tauPx: number,
    slots: Slots,
    pixelScale = 1,
    seaM: number = Number.NEGATIVE_INFINITY,
  ): Cut {
    this.seaM = seaM;
    this.tree.sync(view);
    this.tree.updateSplittable();
    this.begin(view, camera, tauPx, slots, pixelScale);
    const root = this.tree.levels[0]!;
    if (root.usable[0] === 1) {
      slots.touch(0, 0, 0);
      for (let i = 0; i < root.side * root.side; i += 1) this.descend(0, i % root.side, Math.floor(i / root.side));
      this.enforce();
      this.touchSplit();
      for (const index of this.rootOrder()) this.emit(0, index % root.side, Math.floor(index / root.side), 0);
    } else if (root.held[0] === 1) {
      this.wish(0, 0, 0, 1);
    }
    this.wishes.sort((a, b) => a.level - b.level || b.priority - a.priority);
    let minHeight = Number.POSITIVE_INFINITY;
    let maxHeight = Number.NEGATIVE_INFINITY;
    for (let i = 0; i < root.min.length; i += 1) {
      minHeight = Math.min(minHeight, root.min[i]!);
      maxHeight = Math.max(maxHeight, root.max[i]!);
    }
    return { count: this.count, records: this.records, requests: this.wishes, minHeight, maxHeight };
  }

  private begin(view: TileView, camera: CameraState, tauPx: number, slots: Slots, pixelScale: number): void {
    this.count = 0;
    this.wishes = [];
    this.slots = slots;
    this.tau = tauPx;
    this.sizeM = view.sizeM;
    this.eye = camera.eye;
    this.ortho = camera.orthoHeight > 0;
    const heightPx = camera.height * pixelScale;
    this.pixels = this.ortho
      ? heightPx / camera.orthoHeight
      : heightPx / (2 * Math.tan((camera.fovDeg * Math.PI) / 360));
    frustumPlanes(camera.viewProj, this.planes);
    for (let level = 0; level < this.split.length; level += 1) {
      const flags = this.split[level]!;
      for (const index of this.splitList[level]!) flags[index] = 0;
      this.splitList[level]!.length = 0;
      this.wished[level]!.fill(0);
    }
  }

  private descend(level: number, px: number, py: number): void {
    const at = this.tree.levels[level]!;
    const index = py * at.side + px;
    if (level >= this.levels || at.error[index] === 0 || !this.visible(at, px, py)) return;
    const ratio = this.screenError(at, px, py);
    if (ratio <= 1) return;
    if (at.splittable[index] === 0) {
      this.wish(level + 1, px >> 1, py >> 1, ratio);
      return;
    }
    this.markSplit(level, index, ratio);
    for (let i = 0; i < 4; i += 1) this.descend(level + 1, 2 * px + (i & 1), 2 * py + (i >> 1));
  }

  /** Error of stopping at this patch, in taus; at most 1 when it need not be split. */
  private screenError(at: PatchLevel, px: number, py: number): number {
    const index = py * at.side + px;
    const cell = this.sizeM / (at.side * 16);
    const scale = this.pixels / (this.ortho ? 1 : this.distance(at, px, py));
    const cellPx = cell * scale;
    if (cellPx <= SMALLEST_CELL * this.tau) return 0;
    const error = at.error[index]!;
    const geometric = (error * scale) / this.tau;
    const rough = error > SHADING_ERROR * cell ? cellPx / (SHADING_CELL_PX * this.tau) : 0;
    return Math.max(geometric, rough);
  }

  private distance(at: PatchLevel, px: number, py: number): number {
    const w = this.sizeM / at.side;
    const index = py * at.side + px;
    const dx = outside(this.eye[0]!, px * w, (px + 1) * w);
    const dy = outside(this.eye[1]!, py * w, (py + 1) * w);
    const dz = outside(this.eye[2]!, at.min[index]!, at.max[index]!);
    return Math.max(1e-3, Math.sqrt(dx * dx + dy * dy + dz * dz));
  }

  private visible(at: PatchLevel, px: number, py: number): boolean {
    const w = this.sizeM / at.side;
    const index = py * at.side + px;
    const x0 = px * w;
    const y0 = py * w;
    const p = this.planes;
    const low = at.min[index]!;
    const high = Math.max(at.max[index]!, this.seaM);
    for (let i = 0; i < 24; i += 4) {
      const a = p[i]!;
      const b = p[i + 1]!;
      const c = p[i + 2]!;
      const far = a * (a > 0 ? x0 + w : x0) + b * (b > 0 ? y0 + w : y0) + c * (c > 0 ? high : low);
      if (far + p[i + 3]! < 0) return false;
    }
    return true;
  }

  private markSplit(level: number, index: number, ratio: number): void {
    this.split[level]![index] = 1;
    this.ratio[level]![index] = ratio;
    this.splitList[level]!.push(index);
  }

  /** Fine to coarse: the neighbours of a split patch must exist, so their parents are split as well. */
  private enforce(): void {
    for (let level = this.levels - 1; level > 0; level -= 1) {
      const at = this.tree.levels[level]!;
      const coarse = this.tree.levels[level - 1]!;
      const flags = this.split[level - 1]!;
      for (const index of this.splitList[level]!) {
        const px = index % at.side;
        const py = (index - px) / at.side;
        const x0 = Math.max(0, px - 1) >> 1;
        const x1 = Math.min(at.side - 1, px + 1) >> 1;
        const y0 = Math.max(0, py - 1) >> 1;
        const y1 = Math.min(at.side - 1, py + 1) >> 1;
        for (let y = y0; y <= y1; y += 1) {
          for (let x = x0; x <= x1; x += 1) {
            const to = y * coarse.side + x;
            if (flags[to] === 0) this.markSplit(level - 1, to, 0);
          }
        }
      }
    }
  }

  private touchSplit(): void {
    const slots = this.slots!;
    const seen = this.wished;
    for (let level = 0; level < this.levels; level += 1) {
      const side = this.tree.levels[level]!.side;
      const tileSide = this.tree.levels[level + 1]!.tileSide;
      for (const index of this.splitList[level]!) {
        const px = index % side;
        const tx = px >> 1;
        const ty = ((index - px) / side) >> 1;
        const flags = seen[level + 1]!;
        if ((flags[ty * tileSide + tx]! & 2) !== 0) continue;
        flags[ty * tileSide + tx]! |= 2;
        slots.touch(level + 1, tx, ty);
      }
    }
  }

  /** Asks for a tile and for the neighbours of its parents, without which it could not be drawn. */
  private wish(level: number, x: number, y: number, priority: number): void {
    const at = this.tree.levels[level]!;
    const index = y * at.tileSide + x;
    if ((this.wished[level]![index]! & 1) !== 0) return;
    this.wished[level]![index]! |= 1;
    if (at.held[index] === 1 && at.usable[index] === 0) this.wishes.push({ level, x, y, priority });
    if (level === 0) return;
    for (let dy = -1; dy <= 1; dy += 1) {
      for (let dx = -1; dx <= 1; dx += 1) {
        const nx = x + dx;
        const ny = y + dy;
        if (nx < 0 || ny < 0 || nx >= at.tileSide || ny >= at.tileSide) continue;
        this.wish(level - 1, nx >> 1, ny >> 1, priority);
      }
    }
  }

  private rootOrder(): number[] {
    const root = this.tree.levels[0]!;
    const order = Array.from({ length: root.side * root.side }, (_, i) => i);
    const away = order.map((i) => this.distance(root, i % root.side, Math.floor(i / root.side)));
    return order.sort((a, b) => away[a]! - away[b]!);
  }

  private emit(level: number, px: number, py: number, morph: number): void {
    const at = this.tree.levels[level]!;
    const index = py * at.side + px;
    if (!this.visible(at, px, py)) return;
    if (this.split[level]![index] === 0) {
      this.write(at, px, py, morph);
      return;
    }
    const ratio = this.ratio[level]![index]!;
    const childMorph = morphOf(ratio);
    const w = this.sizeM / at.side;
    // Nearest quadrant first, for early depth rejection.
    const near = (this.eye[0]! > (px + 0.5) * w ? 1 : 0) | (this.eye[1]! > (py + 0.5) * w ? 2 : 0);
    for (const flip of [0, 1, 2, 3]) {
      const i = near ^ flip;
      this.emit(level + 1, 2 * px + (i & 1), 2 * py + (i >> 1), childMorph);
    }
  }

  private write(at: PatchLevel, px: number, py: number, morph: number): void {
    if ((this.count + 1) * RECORD_WORDS > this.records.length) {
      const grown = new Uint32Array(this.records.length * 2);
      grown.set(this.records);
      this.records = grown;
    }
    const level = at.level;
    const last = at.side - 1;
    let edges = 0;
    if (px > 0 && !this.exists(level, px - 1, py)) edges |= EDGE_WEST;
    if (px < last && !this.exists(level, px + 1, py)) edges |= EDGE_EAST;
    if (py > 0 && !this.exists(level, px, py - 1)) edges |= EDGE_SOUTH;
    if (py < last && !this.exists(level, px, py + 1)) edges |= EDGE_NORTH;
    let corners = 0;
    if (level > 0) {
      for (let corner = 0; corner < 4; corner += 1) {
        const weight = this.cornerMorph(at, px, py, (corner & 1) * 2 - 1, (corner >> 1) * 2 - 1, morph);
        corners |= Math.round(weight * 255) << (8 * corner);
      }
    }
    const border =
      (px === 0 ? EDGE_WEST : 0) |
      (px === last ? EDGE_EAST : 0) |
      (py === 0 ? EDGE_SOUTH : 0) |
      (py === last ? EDGE_NORTH : 0);
    const slots = this.slots!;
    const own = slots.slot(level, px >> 2, py >> 2);
    const parent = level > 0 ? slots.slot(level - 1, px >> 3, py >> 3) : own;
    const at0 = this.count * RECORD_WORDS;
    this.records[at0] = ((px * 16) | ((py * 16) << 16)) >>> 0;
    this.records[at0 + 1] = (own | (parent << 16)) >>> 0;
    const wet = at.min[py * at.side + px]! < this.seaM ? WET : 0;
    this.records[at0 + 2] = level | (edges << 8) | (border << 12) | wet;
    this.records[at0 + 3] = corners >>> 0;
    this.count += 1;
  }

  /** Weight of the corner towards (sx, sy): the greatest wish of the patches of this level that meet there. */
  private cornerMorph(at: PatchLevel, px: number, py: number, sx: number, sy: number, own: number): number {
    let weight = own;
    for (let i = 1; i < 4; i += 1) {
      const nx = px + (i & 1) * sx;
      const ny = py + (i >> 1) * sy;
      if (nx < 0 || ny < 0 || nx >= at.side || ny >= at.side) continue;
      if (!this.exists(at.level, nx, ny)) return 1;
      if (this.split[at.level]![ny * at.side + nx] === 1) return 0;
      const parent = this.tree.levels[at.level - 1]!;
      weight = Math.max(weight, morphOf(this.ratio[at.level - 1]![(ny >> 1) * parent.side + (nx >> 1)]!));
    }
    return weight;
  }

  /** True when the patch is a node of the cut's tree (drawn or split): its parent is split. */
  private exists(level: number, px: number, py: number): boolean {
    if (level === 0) return true;
    const side = this.tree.levels[level - 1]!.side;
    return this.split[level - 1]![(py >> 1) * side + (px >> 1)] === 1;
  }
}

/** 1 when the parent's error is at the bound (about to be merged), 0 from twice the bound on. */
function morphOf(parentRatio: number): number {
  return Math.min(1, Math.max(0, 2 - parentRatio));
}

function outside(v: number, low: number, high: number): number {
  return v < low ? low - v : v > high ? v - high : 0;
}

/** Six planes (a, b, c, d), positive inside, of a column-major matrix with z from 0 to 1. */
export function frustumPlanes(m: Float32Array, out: Float64Array): void {
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
