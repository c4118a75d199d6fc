/**
 * Where index contours carry their height: places on the drawn lines, far enough from each other, where the line is straight
 * for as long as the words and the next line leaves room. Pure: from held tiles and a camera to a short list.
 */

import { fixed } from "../core/language.ts";
import type { CameraState, Tile, TileView } from "../core/types.ts";
import { TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";
import { flatSlope, INDEX_EVERY } from "./flat.ts";

/** A label on an index contour. */
export interface ContourLabel {
  /** Middle of the label, metres. */
  readonly x: number;
  readonly y: number;
  readonly z: number;
  /** Direction of the line, a unit vector; z does not change along it. */
  readonly dx: number;
  readonly dy: number;
  readonly text: string;
}

export interface LabelOptions {
  /** Height between index contours, metres. */
  readonly everyM: number;
  /** Height of the letters in device pixels; everything else follows from it. */
  readonly sizePx: number;
  readonly most?: number;
}

/** A cell is looked at while it covers more pixels than this. */
const CELL_PX = 7;
const MOST_TILES = 320;
/** In heights of a letter: half the length of a label, how far its line may bend away under it, room to the next label. */
const HALF_LENGTH = 1.2;
const BEND = 0.55;
const NEAREST = 7;

interface Candidate extends ContourLabel {
  readonly px: number;
  readonly py: number;
  readonly rank: number;
}

/** The words of a height: whole metres, or as many digits as the interval needs. */
export function heightText(z: number, everyM: number): string {
  let digits = 0;
  while (digits < 6 && Math.abs(everyM * 10 ** digits - Math.round(everyM * 10 ** digits)) > 1e-6) digits += 1;
  const text = fixed(z, digits);
  return `${text.startsWith("-") ? `−${text.slice(1)}` : text} m`;
}

/** Labels to draw, at most `most`; the same camera and tiles give the same labels. */
export function contourLabels(tiles: TileView, camera: CameraState, options: LabelOptions): ContourLabel[] {
  const { everyM, sizePx, most = 48 } = options;
  const found: Candidate[] = [];
  for (const tile of drawnTiles(tiles, camera)) crossings(tile, tiles.sizeM, camera, options, found);
  found.sort((a, b) => a.rank - b.rank);
  const kept: Candidate[] = [];
  for (const c of found) {
    if (kept.length >= most) break;
    const clear = kept.every((k) => {
      const away = Math.hypot(k.px - c.px, (k.py - c.py) * 1.4);
      return away > sizePx * (k.z === c.z ? 2.2 * NEAREST : NEAREST);
    });
    if (clear) kept.push(c);
  }
  return kept.map(({ x, y, z, dx, dy }) => ({ x, y, z, dx, dy, text: heightText(z, everyM) }));
}

/** The held tiles whose cells are about as fine as what is seen. */
function drawnTiles(tiles: TileView, camera: CameraState): Tile[] {
  const out: Tile[] = [];
  const waiting: [number, number, number][] = [[0, 0, 0]];
  for (let next = waiting.shift(); next !== undefined && out.length < MOST_TILES; next = waiting.shift()) {
    const [level, x, y] = next;
    const tile = tiles.tile(level, x, y);
    if (tile === undefined) continue;
    const width = tiles.sizeM / 2 ** level;
    const z = 0.5 * (Math.min(...tile.subMin) + Math.max(...tile.subMax));
    const reach = Math.hypot(0.71 * width, 0.5 * (Math.max(...tile.subMax) - Math.min(...tile.subMin)));
    const at: [number, number, number] = [(x + 0.5) * width, (y + 0.5) * width, z];
    if (!mayShow(camera, at, reach)) continue;
    const cellPx = (width / TILE_CELLS) * pixelsPerMetre(camera, at, reach);
    const children: [number, number, number][] = [0, 1, 2, 3].map((k) => [
      level + 1,
      2 * x + (k & 1),
      2 * y + (k >> 1),
    ]);
    if (cellPx > CELL_PX && level < tiles.levels && children.every(([l, i, j]) => tiles.tile(l, i, j) !== undefined))
      waiting.push(...children);
    else out.push(tile);
  }
  return out;
}

/** Pixels that a metre across the sight covers at the nearest point of a ball. */
function pixelsPerMetre(camera: CameraState, at: readonly [number, number, number], reach: number): number {
  if (camera.orthoHeight > 0) return camera.height / camera.orthoHeight;
  const k = camera.exaggeration ?? 1;
  const away = Math.hypot(at[0] - camera.eye[0], at[1] - camera.eye[1], k * (at[2] - camera.eye[2])) - reach;
  return camera.height / (2 * Math.tan((camera.fovDeg * Math.PI) / 360) * Math.max(away, 1));
}

/** False only where a ball is outside the picture. */
function mayShow(camera: CameraState, at: readonly [number, number, number], reach: number): boolean {
  const m = camera.viewProj;
  const row = (r: number): number => m[r]! * at[0] + m[4 + r]! * at[1] + m[8 + r]! * at[2] + m[12 + r]!;
  const norm = (r: number, s: number): number =>
    Math.hypot(m[r]! * s + m[3]!, m[4 + r]! * s + m[7]!, m[8 + r]! * s + m[11]!);
  const w = row(3);
  for (const r of [0, 1]) for (const s of [1, -1]) if (w + s * row(r) < -reach * norm(r, s)) return false;
  return true;
}

/** Pixel of a place, from the top left; null behind the eye or outside the picture. */
function project(camera: CameraState, x: number, y: number, z: number): [number, number] | null {
  const m = camera.viewProj;
  const w = m[3]! * x + m[7]! * y + m[11]! * z + m[15]!;
  if (w <= 1e-6) return null;
  const u = (m[0]! * x + m[4]! * y + m[8]! * z + m[12]!) / w;
  const v = (m[1]! * x + m[5]! * y + m[9]! * z + m[13]!) / w;
  if (Math.abs(u) > 0.96 || Math.abs(v) > 0.96) return null;
  return [(0.5 + 0.5 * u) * camera.width, (0.5 - 0.5 * v) * camera.height];
}

/** Puts the places where index contours cross the rows of a tile's grid into `found`. */
function crossings(tile: Tile, sizeM: number, camera: CameraState, options: LabelOptions, found: Candidate[]): void {
  const { heights } = tile;
  const every = options.everyM;
  const cell = sizeM / (TILE_CELLS * 2 ** tile.level);
  for (let row = 2; row < TILE_CELLS - 1; row += 2) {
    const from = row * TILE_SAMPLES;
    for (let col = 2; col < TILE_CELLS - 2; col += 1) {
      const a = heights[from + col]!;
      const b = heights[from + col + 1]!;
      const index = Math.ceil(Math.min(a, b) / every);
      if (a === b || index * every >= Math.max(a, b)) continue;
      const candidate = consider(tile, cell, { row, col, z: index * every, a, b }, camera, options);
      if (candidate !== null) found.push(candidate);
    }
  }
}

interface Crossing {
  readonly row: number;
  readonly col: number;
  readonly z: number;
  readonly a: number;
  readonly b: number;
}

/** The label at a crossing, or null where it would not read well. */
function consider(
  tile: Tile,
  cell: number,
  { row, col, z, a, b }: Crossing,
  camera: CameraState,
  { everyM, sizePx }: LabelOptions,
): Candidate | null {
  const at = col + (z - a) / (b - a);
  const gx = (bilinear(tile, at + 1, row) - bilinear(tile, at - 1, row)) / (2 * cell);
  const gy = (bilinear(tile, at, row + 1) - bilinear(tile, at, row - 1)) / (2 * cell);
  const slope = Math.hypot(gx, gy);
  if (slope < Math.max(1e-3, flatSlope(everyM / INDEX_EVERY, cell * TILE_CELLS * 2 ** tile.level))) return null;
  const x = (tile.x * TILE_CELLS + at) * cell;
  const y = (tile.y * TILE_CELLS + row) * cell;
  const middle = project(camera, x, y, z);
  if (middle === null) return null;
  const [dx, dy] = [-gy / slope, gx / slope];
  // On the screen: how long a metre of the line is, and how far the next index contour.
  const along = project(camera, x + dx * cell, y + dy * cell, z);
  const gap = everyM / slope;
  const next = project(camera, x + (gx / slope) * gap, y + (gy / slope) * gap, z + everyM);
  if (along === null || next === null) return null;
  const perMetre = Math.hypot(along[0] - middle[0], along[1] - middle[1]) / cell;
  const across =
    Math.abs((next[0] - middle[0]) * (along[1] - middle[1]) - (next[1] - middle[1]) * (along[0] - middle[0])) /
    Math.max(perMetre * cell, 1e-9);
  if (across < 0.9 * sizePx) return null;
  const half = (HALF_LENGTH * sizePx) / Math.max(perMetre, 1e-9) / cell;
  if (half > TILE_CELLS / 4) return null;
  for (const s of [-half, half]) {
    const [c, r] = [at + s * dx, row + s * dy];
    if (c < 0 || r < 0 || c > TILE_CELLS || r > TILE_CELLS) return null;
    if ((Math.abs(bilinear(tile, c, r) - z) / everyM) * across > BEND * sizePx) return null;
  }
  return { x, y, z, dx, dy, text: "", px: middle[0], py: middle[1], rank: rank(x, y, cell) };
}

function bilinear(tile: Tile, col: number, row: number): number {
  const i = Math.min(TILE_CELLS - 1, Math.max(0, Math.floor(col)));
  const j = Math.min(TILE_CELLS - 1, Math.max(0, Math.floor(row)));
  const [u, v] = [col - i, row - j];
  const k = j * TILE_SAMPLES + i;
  const h = tile.heights;
  const south = h[k]! * (1 - u) + h[k + 1]! * u;
  const north = h[k + TILE_SAMPLES]! * (1 - u) + h[k + TILE_SAMPLES + 1]! * u;
  return south * (1 - v) + north * v;
}

/** An order of places that stays while the camera moves. */
function rank(x: number, y: number, cell: number): number {
  let h = (Math.imul(Math.round(x / cell), 0x27d4eb2d) ^ Math.imul(Math.round(y / cell), 0x165667b1)) >>> 0;
  h = Math.imul(h ^ (h >>> 15), 0x85ebca6b) >>> 0;
  return (h ^ (h >>> 13)) >>> 0;
}
