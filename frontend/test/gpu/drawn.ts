/** What a cut draws, computed on the CPU from the held tiles: twin of ground/patch.wgsl, and a small rasteriser. */

import type { CameraState, TileView } from "../../src/core/types.ts";
import { PATCH_CELLS, TILE_CELLS, TILE_SAMPLES } from "../../src/generated/contract.ts";
import {
  EDGE_EAST,
  EDGE_NORTH,
  EDGE_SOUTH,
  EDGE_WEST,
  RECORD_WORDS,
  recordBorder,
  recordColumn,
  recordEdges,
  recordLevel,
  recordMorph,
  recordRow,
} from "../../src/tiles/patches/records.ts";
import type { Cut } from "../../src/tiles/patches/selection.ts";

/** Vertices a side. */
export const SIDE = PATCH_CELLS + 1;

export interface DrawnPatch {
  readonly level: number;
  /** Of the south-west vertex, in samples of the level. */
  readonly column: number;
  readonly row: number;
  /** Sides on the domain's border, as in a record. */
  readonly border: number;
  /** Metres between samples. */
  readonly cell: number;
  /** Places of the vertices [row * SIDE + col] in the patch, cells, snapped beside coarser neighbours: xy pairs. */
  readonly at: Uint8Array;
  /** Their heights as they are drawn, morphed. */
  readonly heights: Float64Array;
}

/** A sample of a level's tiles. */
export type Samples = (level: number, column: number, row: number) => number;

/** Weights of a patch's corners: south-west, south-east, north-west, north-east. */
function cornersOf(cut: Cut, index: number): number[] {
  const weights = cut.records[index * RECORD_WORDS + 3]!;
  return [0, 8, 16, 24].map((shift) => ((weights >>> shift) & 255) / 255);
}

/** Height of the vertex at (x, y), 0 to 16, of a drawn patch, as long as it is not snapped, metres. */
export function shownVertex(
  cut: Cut,
  index: number,
  x: number,
  y: number,
  height: Samples,
  corners: readonly number[] = cornersOf(cut, index),
): number {
  const level = recordLevel(cut.records, index);
  const column = recordColumn(cut.records, index) + x;
  const row = recordRow(cut.records, index) + y;
  const m = morphAt(corners, recordMorph(cut.records, index), x, y);
  const own = m < 1 ? height(level, column, row) : 0;
  if (m === 0) return own;
  const [i, j] = [column >> 1, row >> 1];
  const up = 0.5 * (height(level - 1, i + (column & 1), j) + height(level - 1, i, j + (row & 1)));
  return own * (1 - m) + up * m;
}

/** One drawn patch. */
export function drawnPatch(cut: Cut, index: number, sizeM: number, height: Samples): DrawnPatch {
  const { records } = cut;
  const level = recordLevel(records, index);
  const edges = recordEdges(records, index);
  const corners = cornersOf(cut, index);
  const heights = new Float64Array(SIDE * SIDE);
  const at = new Uint8Array(2 * SIDE * SIDE);
  for (let r = 0; r < SIDE; r += 1) {
    for (let c = 0; c < SIDE; c += 1) {
      let [x, y] = [c, r];
      if ((c === 0 && edges & EDGE_WEST) || (c === PATCH_CELLS && edges & EDGE_EAST)) y -= y & 1;
      if ((r === 0 && edges & EDGE_SOUTH) || (r === PATCH_CELLS && edges & EDGE_NORTH)) x -= x & 1;
      at[2 * (r * SIDE + c)] = x;
      at[2 * (r * SIDE + c) + 1] = y;
      heights[r * SIDE + c] = shownVertex(cut, index, x, y, height, corners);
    }
  }
  return {
    level,
    column: recordColumn(records, index),
    row: recordRow(records, index),
    border: recordBorder(records, index),
    cell: sizeM / (TILE_CELLS * 2 ** level),
    at,
    heights,
  };
}

/** Cells from an edge on which corners count (ground/patch.wgsl). */
const EDGE_BAND = 2;

/** Weight of a vertex from the weights of the corners (south-west, south-east, north-west, north-east) and the patch's own. */
function morphAt(c: readonly number[], own: number, x: number, y: number): number {
  const [u, v] = [x / PATCH_CELLS, y / PATCH_CELLS];
  const south = c[0]! * (1 - u) + c[1]! * u;
  const north = c[2]! * (1 - u) + c[3]! * u;
  const inside = Math.min(x, PATCH_CELLS - x, y, PATCH_CELLS - y);
  const share = Math.max(0, 1 - inside / EDGE_BAND);
  return own * (1 - share) + (south * (1 - v) + north * v) * share;
}

/** Height of a drawn patch at a place of the domain that it covers, metres. Not for snapped edges. */
export function shownHeight(patch: DrawnPatch, x: number, y: number): number {
  const u = Math.min(PATCH_CELLS, Math.max(0, x / patch.cell - patch.column));
  const v = Math.min(PATCH_CELLS, Math.max(0, y / patch.cell - patch.row));
  const c = Math.min(PATCH_CELLS - 1, Math.floor(u));
  const r = Math.min(PATCH_CELLS - 1, Math.floor(v));
  const [f, g] = [u - c, v - r];
  const at = (i: number, j: number): number => patch.heights[(r + j) * SIDE + c + i]!;
  return f + g <= 1
    ? at(0, 0) + f * (at(1, 0) - at(0, 0)) + g * (at(0, 1) - at(0, 0))
    : at(1, 1) + (1 - f) * (at(0, 1) - at(1, 1)) + (1 - g) * (at(1, 0) - at(1, 1));
}

/** Samples of the tiles that a view holds. Throws when a sample's tile is not held. */
export function samplesOf(view: TileView): Samples {
  return (level, column, row) => {
    const last = 2 ** level - 1;
    const x = Math.min(last, Math.floor(column / TILE_CELLS));
    const y = Math.min(last, Math.floor(row / TILE_CELLS));
    // A sample on an edge belongs to whichever tile is there.
    for (let beside = 0; beside < 4; beside += 1) {
      const [tx, ty] = [x - (beside & 1), y - (beside >> 1)];
      const [c, r] = [column - tx * TILE_CELLS, row - ty * TILE_CELLS];
      const tile = c <= TILE_CELLS && r <= TILE_CELLS ? view.tile(level, tx, ty) : undefined;
      if (tile !== undefined) return tile.heights[r * TILE_SAMPLES + c]!;
    }
    throw new Error(`no tile has the sample ${level}/${column}/${row}`);
  };
}

/** Nearer than this nothing is drawn, metres. */
const NEAR = 0.01;

interface Picture {
  readonly width: number;
  readonly height: number;
  readonly front: Int32Array;
  readonly depth: Float64Array;
}

/** Pixel position and w. */
type Corner = readonly [number, number, number];

/** Vertices along each side, and the bit of the side. */
const SIDES = [
  [EDGE_WEST, (i: number): number => i * SIDE],
  [EDGE_EAST, (i: number): number => i * SIDE + PATCH_CELLS],
  [EDGE_SOUTH, (i: number): number => i],
  [EDGE_NORTH, (i: number): number => PATCH_CELLS * SIDE + i],
] as const;

/**
 * A picture of patches: for every pixel the index of the patch in front, -1 where there is none. On the border of the
 * domain walls go down to `base`.
 */
export function rasterise(
  patches: readonly DrawnPatch[],
  camera: CameraState,
  { width, height, base }: { width: number; height: number; base: number },
): Int32Array {
  const front = new Int32Array(width * height).fill(-1);
  const depth = new Float64Array(width * height).fill(Number.POSITIVE_INFINITY);
  const picture = { width, height, front, depth };
  const m = camera.viewProj;
  const clip = (x: number, y: number, z: number): Corner => [
    m[0]! * x + m[4]! * y + m[8]! * z + m[12]!,
    m[1]! * x + m[5]! * y + m[9]! * z + m[13]!,
    m[3]! * x + m[7]! * y + m[11]! * z + m[15]!,
  ];
  patches.forEach((patch, index) => {
    const corner = (k: number, z: number): Corner =>
      clip((patch.column + patch.at[2 * k]!) * patch.cell, (patch.row + patch.at[2 * k + 1]!) * patch.cell, z);
    const points = Array.from(patch.heights, (z, k) => corner(k, z));
    for (const [side, at] of SIDES) {
      if ((patch.border & side) === 0) continue;
      for (let i = 0; i < PATCH_CELLS; i += 1) {
        const [a, b] = [at(i), at(i + 1)];
        draw(picture, index, [points[a]!, points[b]!, corner(a, base)]);
        draw(picture, index, [points[b]!, corner(b, base), corner(a, base)]);
      }
    }
    for (let r = 0; r < PATCH_CELLS; r += 1) {
      for (let c = 0; c < PATCH_CELLS; c += 1) {
        const a = r * SIDE + c;
        draw(picture, index, [points[a]!, points[a + 1]!, points[a + SIDE]!]);
        draw(picture, index, [points[a + SIDE]!, points[a + 1]!, points[a + SIDE + 1]!]);
      }
    }
  });
  return front;
}

/** Cuts a triangle off at the near plane and fills what is left. */
function draw(picture: Picture, index: number, corners: readonly Corner[]): void {
  const kept: Corner[] = [];
  corners.forEach((a, i) => {
    const b = corners[(i + 1) % 3]!;
    if (a[2] >= NEAR) kept.push(a);
    if (a[2] >= NEAR === b[2] >= NEAR) return;
    const t = (NEAR - a[2]) / (b[2] - a[2]);
    kept.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), NEAR]);
  });
  const { width, height } = picture;
  const onScreen = kept.map(([x, y, w]): Corner => [(0.5 + x / w / 2) * width, (0.5 - y / w / 2) * height, w]);
  for (let i = 2; i < onScreen.length; i += 1) fill(picture, index, onScreen[0]!, onScreen[i - 1]!, onScreen[i]!);
}

/** Pixel centres inside of a triangle. Perspective: 1 / w is linear on the screen. */
function fill(picture: Picture, index: number, a: Corner, b: Corner, c: Corner): void {
  const { width, height, front, depth } = picture;
  const [[ax, ay, wa], [bx, by, wb], [cx, cy, wc]] = [a, b, c];
  const x0 = Math.max(0, Math.ceil(Math.min(ax, bx, cx) - 0.5));
  const x1 = Math.min(width - 1, Math.floor(Math.max(ax, bx, cx) - 0.5));
  const y0 = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5));
  const y1 = Math.min(height - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
  const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
  if (x0 > x1 || y0 > y1 || area === 0) return;
  for (let y = y0; y <= y1; y += 1) {
    for (let x = x0; x <= x1; x += 1) {
      const [px, py] = [x + 0.5, y + 0.5];
      const u = ((bx - px) * (cy - py) - (by - py) * (cx - px)) / area;
      const v = ((cx - px) * (ay - py) - (cy - py) * (ax - px)) / area;
      // Both triangles beside an edge take what lies on it.
      if (u < -1e-9 || v < -1e-9 || u + v > 1 + 1e-9) continue;
      const w = 1 / (u / wa + v / wb + (1 - u - v) / wc);
      if (w >= depth[y * width + x]!) continue;
      depth[y * width + x] = w;
      front[y * width + x] = index;
    }
  }
}
