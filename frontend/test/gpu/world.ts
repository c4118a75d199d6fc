/** Analytic terrains as tile stores, and cameras, for tests and the renderer's harness. */

import { mat4 } from "wgpu-matrix";
import { tileKey } from "../../src/core/tilekey.ts";
import type { CameraState, ChannelGrid, ChannelView, Tile, TileView, Vec3 } from "../../src/core/types.ts";
import { SUBPATCHES, TILE_CELLS, TILE_SAMPLES } from "../../src/generated/contract.ts";

export type HeightField = (x: number, y: number, level: number) => number;

/** Small deterministic generator (mulberry32). */
export function random(seed: number): () => number {
  let a = seed >>> 0;
  return () => {
    a = (a + 0x6d2b79f5) >>> 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

/** A store whose tiles sample a function of place and level: a filtered pyramid when the function depends on the level. */
export class FieldView implements TileView {
  stamp = 1;
  readonly solved: number;
  private readonly held = new Map<string, Tile>();

  constructor(
    readonly sizeM: number,
    readonly levels: number,
    private field: HeightField,
    private readonly has: (level: number, x: number, y: number) => boolean = () => true,
  ) {
    this.solved = levels;
    this.fill();
  }

  tile(level: number, x: number, y: number): Tile | undefined {
    return this.held.get(`${level}/${x}/${y}`);
  }

  tiles(): Iterable<Tile> {
    return this.held.values();
  }

  /** Replaces the ground; every tile gets a new stamp. */
  change(field: HeightField): void {
    this.field = field;
    this.stamp += 1;
    this.fill();
  }

  /** Drops tiles. */
  drop(level: number, x: number, y: number): void {
    this.stamp += 1;
    this.held.delete(`${level}/${x}/${y}`);
  }

  private fill(): void {
    this.held.clear();
    for (let level = 0; level <= this.levels; level += 1) {
      for (let y = 0; y < 1 << level; y += 1) {
        for (let x = 0; x < 1 << level; x += 1) {
          if (this.has(level, x, y)) this.held.set(`${level}/${x}/${y}`, this.make(level, x, y));
        }
      }
    }
  }

  private make(level: number, x: number, y: number): Tile {
    const cell = this.sizeM / (TILE_CELLS << level);
    const heights = new Float32Array(TILE_SAMPLES * TILE_SAMPLES);
    for (let r = 0; r < TILE_SAMPLES; r += 1) {
      for (let c = 0; c < TILE_SAMPLES; c += 1) {
        heights[r * TILE_SAMPLES + c] = this.field((x * TILE_CELLS + c) * cell, (y * TILE_CELLS + r) * cell, level);
      }
    }
    const parent = level > 0 ? this.tile(level - 1, x >> 1, y >> 1) : undefined;
    return { level, x, y, version: 1, exact: true, stamp: this.stamp, heights, ...subFigures(heights, x, y, parent) };
  }
}

/** Sub-patch bounds and distance to the parent's linear surface, as the store makes them. */
function subFigures(
  heights: Float32Array,
  x: number,
  y: number,
  parent: Tile | undefined,
): Pick<Tile, "subMin" | "subMax" | "subError"> {
  const n = SUBPATCHES * SUBPATCHES;
  const subMin = new Float32Array(n).fill(Number.POSITIVE_INFINITY);
  const subMax = new Float32Array(n).fill(Number.NEGATIVE_INFINITY);
  const subError = new Float32Array(n);
  for (let sub = 0; sub < n; sub += 1) {
    for (let r = 0; r <= 16; r += 1) {
      for (let c = 0; c <= 16; c += 1) {
        const row = Math.floor(sub / SUBPATCHES) * 16 + r;
        const col = (sub % SUBPATCHES) * 16 + c;
        const h = heights[row * TILE_SAMPLES + col]!;
        subMin[sub] = Math.min(subMin[sub]!, h);
        subMax[sub] = Math.max(subMax[sub]!, h);
        if (parent === undefined) continue;
        const pr = (row + (y & 1) * TILE_CELLS) / 2;
        const pc = (col + (x & 1) * TILE_CELLS) / 2;
        const at = (a: number, b: number): number => parent.heights[a * TILE_SAMPLES + b]!;
        const drawn = 0.5 * (at(Math.floor(pr), Math.ceil(pc)) + at(Math.ceil(pr), Math.floor(pc)));
        subError[sub] = Math.max(subError[sub]!, Math.abs(h - drawn));
      }
    }
  }
  return { subMin, subMax, subError };
}

/** Value noise, -1..1, smooth. */
export function noise2(x: number, y: number, seed: number): number {
  const i = Math.floor(x);
  const j = Math.floor(y);
  const value = (a: number, b: number): number => {
    let h = (Math.imul(a, 374761393) ^ Math.imul(b, 668265263) ^ Math.imul(seed, 2246822519)) >>> 0;
    h = Math.imul(h ^ (h >>> 13), 1274126177) >>> 0;
    return ((h ^ (h >>> 16)) >>> 0) / 2 ** 31 - 1;
  };
  const s = (t: number): number => t * t * t * (t * (t * 6 - 15) + 10);
  const u = s(x - i);
  const v = s(y - j);
  const south = value(i, j) * (1 - u) + value(i + 1, j) * u;
  const north = value(i, j + 1) * (1 - u) + value(i + 1, j + 1) * u;
  return south * (1 - v) + north * v;
}

export function fbm(x: number, y: number, octaves: number, seed: number): number {
  let sum = 0;
  let gain = 0.5;
  let f = 1;
  for (let k = 0; k < octaves; k += 1) {
    sum += gain * noise2(x * f, y * f, seed + k);
    gain *= 0.5;
    f *= 2;
  }
  return sum;
}

/** Distance from a point to a polyline, and how far along (0..1) the nearest point is. */
function toLine(x: number, y: number, line: readonly (readonly [number, number])[]): { d: number; t: number } {
  let best = { d: Number.POSITIVE_INFINITY, t: 0 };
  for (let i = 0; i + 1 < line.length; i += 1) {
    const [ax, ay] = line[i]!;
    const [bx, by] = line[i + 1]!;
    const dx = bx - ax;
    const dy = by - ay;
    const u = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)));
    const d = Math.hypot(x - ax - u * dx, y - ay - u * dy);
    if (d < best.d) best = { d, t: (i + u) / (line.length - 1) };
  }
  return best;
}

/** A ridge with concave flanks like those that strokes make. */
function ridge(
  x: number,
  y: number,
  line: readonly (readonly [number, number])[],
  height: number,
  foot: number,
): number {
  const { d, t } = toLine(x, y, line);
  const crest = height * Math.sin(Math.PI * Math.min(1, Math.max(0, 0.08 + t * 0.84))) ** 0.7;
  const q = Math.max(0, 1 - d / foot);
  return crest * q ** 1.6;
}

/** Ridges, a valley and a plateau over 4096 m, with the roughness of ground when `rough`. */
export function alpineField(rough: number): HeightField {
  const main: [number, number][] = [
    [500, 2300],
    [1300, 2650],
    [2100, 2450],
    [2900, 2900],
    [3700, 2700],
  ];
  const spurs: [number, number][][] = [
    [
      [1300, 2650],
      [1150, 2000],
      [1300, 1500],
    ],
    [
      [2100, 2450],
      [2300, 1900],
      [2150, 1300],
    ],
    [
      [2900, 2900],
      [3100, 2200],
      [3400, 1700],
    ],
    [
      [1700, 2600],
      [1600, 3200],
      [1900, 3700],
    ],
    [
      [2900, 2900],
      [2700, 3400],
      [3000, 3900],
    ],
  ];
  return (x, y) => {
    let h = ridge(x, y, main, 880, 900);
    for (const spur of spurs)
      h = Math.max(h, ridge(x, y, spur, 520, 560)) + 0.12 * Math.min(h, ridge(x, y, spur, 520, 560));
    h += ridge(
      x,
      y,
      [
        [600, 700],
        [1500, 420],
        [2400, 600],
      ],
      150,
      420,
    );
    const relief = Math.min(1, h / 220);
    return h + rough * relief * (90 * fbm(x / 310, y / 310, 6, 5) + 26 * Math.abs(fbm(x / 90, y / 90, 4, 9)));
  };
}

/** A random ground, rough in places, whose levels differ as previews do. */
export function filteredField(seed: number, amplitude: number, sizeM = 4096): HeightField {
  return (x, y, level) => {
    let sum = 0;
    const rough = amplitude * (0.02 + Math.max(0, 0.25 + noise2((3 * x) / sizeM, (3 * y) / sizeM, seed + 50)) ** 2);
    for (let k = 0; k <= level + 3; k += 1) {
      const f = (4 * 2 ** k) / sizeM;
      sum += (k < 2 ? amplitude : rough) * 0.62 ** k * noise2(x * f, y * f, seed + k);
    }
    return sum * (1 + 0.05 * Math.sin(level * 7));
  };
}

/** A perspective camera looking from `eye` to `target`. */
export function lookAt(
  eye: Vec3,
  target: Vec3,
  width: number,
  height: number,
  fovDeg = 45,
  near = 2,
  far = 30000,
): CameraState {
  const up: Vec3 = [0, 0, 1];
  const projection = mat4.perspective((fovDeg * Math.PI) / 180, width / height, near, far);
  const viewProj = mat4.multiply(projection, mat4.lookAt([...eye], [...target], [...up]));
  return {
    mode: "orbit",
    eye,
    target,
    up,
    fovDeg,
    orthoHeight: 0,
    near,
    far,
    width,
    height,
    viewProj: Float32Array.from(viewProj),
  };
}

/** The map camera: straight down, north up. */
export function mapCamera(centre: Vec3, orthoHeight: number, width: number, height: number): CameraState {
  const w = (orthoHeight * width) / height / 2;
  const eye: Vec3 = [centre[0], centre[1], 10000];
  const projection = mat4.ortho(-w, w, -orthoHeight / 2, orthoHeight / 2, 1, 20000);
  const viewProj = mat4.multiply(projection, mat4.lookAt([...eye], [centre[0], centre[1], 0], [0, 1, 0]));
  return {
    mode: "map",
    eye,
    target: centre,
    up: [0, 1, 0],
    fovDeg: 45,
    orthoHeight,
    near: 1,
    far: 20000,
    width,
    height,
    viewProj: Float32Array.from(viewProj),
  };
}

const zero: ChannelGrid = { side: 2, values: new Float32Array(4) };

/** No stroke asks for anything: roughness 0.5, all others 0. */
export const PLAIN_CHANNELS: ChannelView = {
  stamp: 0,
  amplitude: zero,
  roughness: { side: 2, values: new Float32Array(4).fill(0.5) },
  snow: zero,
  grass: zero,
  forest: zero,
  wetness: zero,
  survey: { side: 2, values: new Float32Array(4).fill(-1) },
  erosion: zero,
  far: { side: 2, values: new Float32Array(4).fill(1) },
};

/** Levels up to `solved` everywhere, finer ones only where asked for: what the page holds near the ground. */
export class SparseView implements TileView {
  stamp = 1;
  private readonly held = new Map<number, Tile>();

  constructor(
    readonly sizeM: number,
    readonly levels: number,
    readonly solved: number,
    private field: HeightField,
  ) {
    for (let level = 0; level <= solved; level += 1)
      for (let y = 0; y < 1 << level; y += 1) for (let x = 0; x < 1 << level; x += 1) this.make(level, x, y);
  }

  tile(level: number, x: number, y: number): Tile | undefined {
    return this.held.get(tileKey(level, x, y));
  }

  tiles(): Iterable<Tile> {
    return this.held.values();
  }

  heightAt(x: number, y: number): number {
    return this.field(x, y, this.levels);
  }

  /** Holds the tiles within `reach(level)` tiles of a place, as far as their parents are held. */
  refineAround(x: number, y: number, reach: (level: number) => number): void {
    this.stamp += 1;
    for (let level = this.solved + 1; level <= this.levels; level += 1) {
      const side = 1 << level;
      const around = reach(level);
      const tx = Math.min(side - 1, Math.floor((x / this.sizeM) * side));
      const ty = Math.min(side - 1, Math.floor((y / this.sizeM) * side));
      for (let j = Math.max(0, ty - around); j <= Math.min(side - 1, ty + around); j += 1)
        for (let i = Math.max(0, tx - around); i <= Math.min(side - 1, tx + around); i += 1)
          if (this.tile(level - 1, i >> 1, j >> 1) !== undefined) this.make(level, i, j);
    }
  }

  /** Height of the finest tile that is held there. */
  shownHeightAt(x: number, y: number): number {
    for (let level = this.levels; level > 0; level -= 1) {
      const w = this.sizeM / (1 << level);
      if (this.tile(level, Math.floor(x / w), Math.floor(y / w)) !== undefined) return this.field(x, y, level);
    }
    return this.field(x, y, 0);
  }

  /** Drops refined tiles at random, each with all below it. */
  lose(lost: () => boolean): void {
    this.stamp += 1;
    for (const [key, tile] of [...this.held].sort((a, b) => a[1].level - b[1].level)) {
      if (tile.level <= this.solved) continue;
      if (lost() || this.tile(tile.level - 1, tile.x >> 1, tile.y >> 1) === undefined) this.held.delete(key);
    }
  }

  /** Drops all tiles above the solved levels. */
  forgetRefined(): void {
    this.stamp += 1;
    for (const [key, tile] of this.held) if (tile.level > this.solved) this.held.delete(key);
  }

  /** Replaces the ground under all that is held. */
  change(field: HeightField): void {
    this.stamp += 1;
    this.field = field;
    for (const { level, x, y } of [...this.held.values()].sort((a, b) => a.level - b.level)) this.make(level, x, y);
  }

  /** Drops one tile. */
  drop(level: number, x: number, y: number): void {
    this.stamp += 1;
    this.held.delete(tileKey(level, x, y));
  }

  /** Holds one tile more. */
  hold(level: number, x: number, y: number): void {
    this.stamp += 1;
    this.make(level, x, y);
  }

  private make(level: number, x: number, y: number): void {
    const cell = this.sizeM / (TILE_CELLS << level);
    const heights = new Float32Array(TILE_SAMPLES * TILE_SAMPLES);
    for (let r = 0; r < TILE_SAMPLES; r += 1)
      for (let c = 0; c < TILE_SAMPLES; c += 1)
        heights[r * TILE_SAMPLES + c] = this.field((x * TILE_CELLS + c) * cell, (y * TILE_CELLS + r) * cell, level);
    const parent = level > 0 ? this.tile(level - 1, x >> 1, y >> 1) : undefined;
    const tile = { level, x, y, version: 1, exact: true, stamp: this.stamp, heights };
    this.held.set(tileKey(level, x, y), { ...tile, ...subFigures(heights, x, y, parent) });
  }
}

/** Ground with features of every size down to a few metres; levels differ a little, as filtered ones do. */
export function craggyField(seed: number, sizeM: number): HeightField {
  const waves = Array.from({ length: 8 }, (_, k) => ({
    f: (4 * Math.PI * 3.7 ** k) / sizeM,
    a: 0.02 * sizeM * 0.3 ** k,
    turn: seed + 1.7 * k,
    east: Math.cos(seed + 1.7 * k),
    north: Math.sin(seed + 1.7 * k),
  }));
  return (x, y, level) => {
    let sum = 0;
    for (const { f, a, turn, east, north } of waves) {
      const u = east * x + north * y;
      const v = east * y - north * x;
      sum += a * Math.sin(f * u + turn) * Math.cos(0.83 * f * v);
    }
    return sum * (1 + 0.002 * Math.sin(level * 7));
  };
}
