/**
 * Shaded relief in the Swiss manner for the 2D map: tints by height, light from the north-west (from where readers of maps
 * expect it, whatever the scene's sun does), warm lit slopes and cool shadows, contours. Pure functions on arrays.
 *
 * Source of the manner: E. Imhof, "Cartographic Relief Presentation" (1982), chapters 9 and 13.
 */

import type { ChannelGrid, Tile } from "../../core/types.ts";
import type { Look } from "../../generated/contract.ts";
import { NO_LAKE, TILE_CELLS } from "../../generated/contract.ts";
import { INDEX_EVERY } from "../../tiles/flat.ts";
import { type Lakes, lakeOver } from "../../tiles/lakes/lakes.ts";
import { BORDER, SLOT_TEXELS } from "../atlas/apron.ts";
import { sampleOf } from "../atlas/channeltexture.ts";

type Rgb = readonly [number, number, number];

/** The settings by which a tile of the map is shaded. */
export interface MapStyle {
  readonly look: Look;
  readonly sizeM: number;
  readonly seaM: number | null;
  /** Where lakes stand, and how high; null without a lake. */
  readonly lakes: Lakes | null;
  readonly contourM: number;
  /** How far contours show over the domain; null: everywhere. */
  readonly contourShares?: ChannelGrid | null;
  /** How many times as wide they are. */
  readonly lineScale?: number;
  readonly contours: boolean;
  readonly slope: boolean;
}

interface Ramp {
  /** Height as a fraction of the domain, display colour 0..255. */
  readonly stops: readonly (readonly [number, Rgb])[];
  readonly steep: Rgb;
  readonly line: Rgb;
}

const RAMPS: Readonly<Record<Look, Ramp>> = {
  natural: {
    stops: [
      [-0.05, [150, 176, 150]],
      [0, [196, 211, 172]],
      [0.03, [214, 219, 176]],
      [0.08, [227, 215, 172]],
      [0.14, [222, 202, 168]],
      [0.2, [232, 224, 212]],
      [0.26, [250, 249, 247]],
    ],
    steep: [178, 164, 148],
    line: [122, 88, 56],
  },
  alpine: {
    stops: [
      [-0.05, [176, 190, 196]],
      [0, [214, 224, 224]],
      [0.06, [226, 232, 234]],
      [0.14, [240, 243, 246]],
      [0.24, [252, 253, 255]],
    ],
    steep: [166, 168, 174],
    line: [88, 104, 128],
  },
  desert: {
    stops: [
      [-0.05, [206, 168, 122]],
      [0, [238, 214, 170]],
      [0.08, [234, 196, 146]],
      [0.16, [220, 162, 116]],
      [0.26, [240, 214, 184]],
    ],
    steep: [186, 116, 82],
    line: [138, 74, 44],
  },
  paper: {
    stops: [
      [-0.05, [228, 219, 200]],
      [0, [244, 238, 224]],
      [0.25, [252, 249, 242]],
    ],
    steep: [226, 216, 198],
    line: [128, 108, 84],
  },
};

const SLOPE_STOPS: readonly (readonly [number, Rgb])[] = [
  [0, [206, 222, 190]],
  [15, [196, 214, 150]],
  [27, [240, 216, 110]],
  [35, [232, 150, 74]],
  [42, [206, 80, 62]],
  [60, [120, 40, 90]],
];

const SHADOW: Rgb = [0.42, 0.46, 0.6];
const LIT: Rgb = [1.06, 1.03, 0.95];

function ramp(stops: readonly (readonly [number, Rgb])[], v: number, out: Float32Array): void {
  let i = 0;
  while (i + 2 < stops.length && v > stops[i + 1]![0]) i += 1;
  const [a, ca] = stops[i]!;
  const [b, cb] = stops[i + 1]!;
  const t = Math.min(1, Math.max(0, (v - a) / (b - a)));
  for (let k = 0; k < 3; k += 1) out[k] = ca[k]! + (cb[k]! - ca[k]!) * t;
}

/** Brightness of a slope, 0..1, flat ground about 0.72: three lights from the north-west quarter. */
export function hillshade(gx: number, gy: number): number {
  const inv = 1 / Math.sqrt(1 + gx * gx + gy * gy);
  // Unit vectors to the lights: north-west at 45 degrees; west and north lower and weaker.
  const main = (0.5 * gx - 0.5 * gy + Math.SQRT1_2) * inv;
  const west = (0.766 * gx + 0.6428) * inv;
  const north = (-0.766 * gy + 0.6428) * inv;
  return 0.62 * Math.max(0, main) + 0.22 * Math.max(0, west) + 0.16 * Math.max(0, north) + 0.03;
}

/** Ink of contour lines, 0..1, at height z where it changes by `rate` metres a pixel. */
function contourInk(height: number, rate: number, every: number, scale: number): number {
  // A hair above the round value: ground that is flat at exactly that height is not one wide line.
  const z = height - 0.01 * every;
  const width = Math.max(rate, 1e-6);
  const line = (interval: number, half: number): number => {
    const away = Math.abs(z / interval - Math.round(z / interval)) * interval;
    const fade = Math.min(1, Math.max(0, 1.6 - (4 * width) / interval));
    return Math.min(1, Math.max(0, half + 0.5 - away / width)) * fade;
  };
  return Math.max(0.34 * line(every, 0.3 * scale), 0.6 * line(INDEX_EVERY * every, 0.55 * scale));
}

/** Gradients at all samples of a slot but its outermost ring, metres per metre. */
function gradients(slot: Float32Array, cell: number): { gx: Float32Array; gy: Float32Array } {
  const gx = new Float32Array(slot.length);
  const gy = new Float32Array(slot.length);
  const k = 1 / (2 * cell);
  for (let r = 1; r + 1 < SLOT_TEXELS; r += 1) {
    for (let c = 1; c + 1 < SLOT_TEXELS; c += 1) {
      const i = r * SLOT_TEXELS + c;
      gx[i] = (slot[i + 1]! - slot[i - 1]!) * k;
      gy[i] = (slot[i + SLOT_TEXELS]! - slot[i - SLOT_TEXELS]!) * k;
    }
  }
  return { gx, gy };
}

/**
 * Draws a tile: `slot` is its 69 x 69 samples (row 0 south), `tile` says which, `out` RGBA of `side` x `side` pixels, row 0
 * north.
 */
export function shadeTile(
  slot: Float32Array,
  tile: Pick<Tile, "level" | "x" | "y">,
  side: number,
  style: MapStyle,
  out: Uint8ClampedArray,
): void {
  const { level } = tile;
  const cell = style.sizeM / (TILE_CELLS << level);
  const { gx, gy } = gradients(slot, cell);
  const perPixel = TILE_CELLS / side;
  const colour = new Float32Array(3);
  for (let row = 0; row < side; row += 1) {
    const y = (side - row - 0.5) * perPixel;
    const j = Math.min(TILE_CELLS - 1, Math.floor(y));
    const fy = y - j;
    for (let col = 0; col < side; col += 1) {
      const x = (col + 0.5) * perPixel;
      const i = Math.min(TILE_CELLS - 1, Math.floor(x));
      const fx = x - i;
      const at = (j + BORDER) * SLOT_TEXELS + i + BORDER;
      const z = bilinear(slot, at, fx, fy);
      const [u, v] = [(tile.x * TILE_CELLS + x) * cell, (tile.y * TILE_CELLS + y) * cell];
      const water = waterOver(style, u, v, z);
      const shown = style.contourShares && sampleOf(style.contourShares, v / style.sizeM, u / style.sizeM);
      shadePoint(
        z,
        { water, shown: shown ?? 1 },
        [bilinear(gx, at, fx, fy), bilinear(gy, at, fx, fy)],
        cell * perPixel,
        style,
        colour,
      );
      const to = 4 * (row * side + col);
      out[to] = colour[0]!;
      out[to + 1] = colour[1]!;
      out[to + 2] = colour[2]!;
      out[to + 3] = 255;
    }
  }
}

function bilinear(field: Float32Array, at: number, fx: number, fy: number): number {
  const south = field[at]! + (field[at + 1]! - field[at]!) * fx;
  const north = field[at + SLOT_TEXELS]! + (field[at + SLOT_TEXELS + 1]! - field[at + SLOT_TEXELS]!) * fx;
  return south + (north - south) * fy;
}

/** Level of the water that covers ground of height z; null where it is dry. */
function waterOver({ lakes, seaM, sizeM }: MapStyle, x: number, y: number, z: number): number | null {
  const lake = lakes === null ? NO_LAKE : lakeOver(lakes, x / sizeM, y / sizeM);
  const level = Math.max(lake, seaM ?? NO_LAKE);
  return level > NO_LAKE && z < level ? level : null;
}

function shadePoint(
  z: number,
  { water, shown }: { readonly water: number | null; readonly shown: number },
  [gx, gy]: readonly [number, number],
  pixelM: number,
  style: MapStyle,
  out: Float32Array,
): void {
  const look = RAMPS[style.look];
  const steep = Math.hypot(gx, gy);
  const ground = style.seaM ?? 0;
  if (water !== null) {
    shadeSea((water - z) / style.sizeM, steep * pixelM, style.sizeM, out);
    return;
  }
  if (style.slope) ramp(SLOPE_STOPS, (Math.atan(steep) * 180) / Math.PI, out);
  else {
    ramp(look.stops, (z - ground) / style.sizeM, out);
    const rock = 0.85 * Math.min(1, Math.max(0, (steep - 0.62) / 0.5));
    for (let k = 0; k < 3; k += 1) out[k] = out[k]! + (look.steep[k]! - out[k]!) * rock;
  }
  // Relief twice as steep as it is, as maps draw it.
  const shade = Math.min(1.12, Math.max(0, hillshade(1.7 * gx, 1.7 * gy) / hillshade(0, 0)));
  const t = Math.min(1, shade);
  const light = Math.max(0, shade - 1) / 0.12;
  for (let k = 0; k < 3; k += 1) {
    const cool = SHADOW[k]! + (1 - SHADOW[k]!) * t;
    out[k] = Math.min(255, out[k]! * (cool + (LIT[k]! - 1) * (0.4 + light)));
  }
  if (style.contours && shown > 0) {
    const ink = shown * contourInk(z, steep * pixelM, style.contourM, style.lineScale ?? 1);
    for (let k = 0; k < 3; k += 1) out[k] = out[k]! + (look.line[k]! - out[k]!) * ink;
  }
}

/** Water by depth (a fraction of the domain), with a shore line and faint steps of depth. */
function shadeSea(depth: number, ratePerPixelM: number, sizeM: number, out: Float32Array): void {
  const t = Math.min(1, Math.sqrt(depth / 0.05));
  const step = Math.min(1, Math.floor(depth / 0.004) * 0.12);
  const shallow: Rgb = [196, 220, 226];
  const deep: Rgb = [120, 164, 190];
  const rate = Math.max(ratePerPixelM / sizeM, 1e-9);
  const shore = Math.min(1, Math.max(0, 1.4 - depth / rate));
  for (let k = 0; k < 3; k += 1) {
    const water = shallow[k]! + (deep[k]! - shallow[k]!) * (0.6 * t + 0.4 * step);
    out[k] = water + ([70, 112, 142][k]! - water) * shore * 0.8;
  }
}
