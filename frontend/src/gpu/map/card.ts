/** A whole copy as a small relief map: the tiles that are held of it, shaded as on the 2D map, on one canvas. */

import type { Tile, TileView } from "../../core/types.ts";
import type { TerrainSettings } from "../../generated/contract.ts";
import { assembleBordered, SLOT_TEXELS } from "../atlas/apron.ts";
import { contourInterval } from "../looks.ts";
import { type MapStyle, shadeTile } from "./shade.ts";

/** Contours of a card are few: it is looked at from the last row. */
const CONTOURS = 12;
/** A card on nearly flat ground shows no contours: they would be noise. */
const LEAST_RELIEF = 0.004;

const slot = new Float32Array(SLOT_TEXELS * SLOT_TEXELS);

/** A tile is drawn with at least so many pixels along one side. */
const LEAST_TILE_PX = 16;

/** Draws the finest level that is held whole, `side` pixels along a side. Returns false where nothing is held yet. */
export function drawCard(view: TileView, settings: TerrainSettings, canvas: HTMLCanvasElement, side: number): boolean {
  const level = wholeLevel(view);
  if (level < 0) return false;
  const n = 1 << level;
  const tilePx = Math.max(LEAST_TILE_PX, Math.round(side / n));
  if (canvas.width !== n * tilePx) canvas.width = canvas.height = n * tilePx;
  const context = canvas.getContext("2d", { alpha: false })!;
  const style = styleOf(view, settings);
  const image = context.createImageData(tilePx, tilePx);
  for (let y = 0; y < n; y += 1) {
    for (let x = 0; x < n; x += 1) {
      const tile = view.tile(level, x, y)!;
      assembleBordered(tile.heights, (dx, dy) => neighbour(view, tile, dx, dy)?.heights, slot);
      shadeTile(slot, tile, tilePx, style, image.data);
      context.putImageData(image, x * tilePx, (n - 1 - y) * tilePx);
    }
  }
  return true;
}

/** The finest level of which every tile is held; -1 where there is none. */
export function wholeLevel(view: TileView): number {
  let found = -1;
  for (let level = 0; level <= view.levels; level += 1) {
    const n = 1 << level;
    for (let k = 0; k < n * n; k += 1) if (view.tile(level, k % n, Math.floor(k / n)) === undefined) return found;
    found = level;
  }
  return found;
}

function styleOf(view: TileView, settings: TerrainSettings): MapStyle {
  const root = view.tile(0, 0, 0)!;
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  for (const h of root.heights) {
    low = Math.min(low, h);
    high = Math.max(high, h);
  }
  return {
    look: settings.look,
    sizeM: settings.size_m,
    seaM: settings.sea_level_m,
    lakes: null,
    contourM: contourInterval(high - low, CONTOURS),
    contours: high - low > LEAST_RELIEF * settings.size_m,
    slope: false,
  };
}

function neighbour(view: TileView, tile: Tile, dx: number, dy: number): Tile | undefined {
  const [x, y, side] = [tile.x + dx, tile.y + dy, 1 << tile.level];
  return x < 0 || y < 0 || x >= side || y >= side ? undefined : view.tile(tile.level, x, y);
}
