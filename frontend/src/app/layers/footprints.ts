/** Outlines of elevation grids on the ground, and the coarse picture of one that is being placed. */

import {
  cornersOf,
  type GridPlace,
  type GridShape,
  latticeCorners,
  latticePoint,
  type Point,
} from "../../core/lattice.ts";
import type { FootprintVisual, Ground, PlacingVisual } from "../../core/types.ts";
import type { Doc } from "../../doc/document.ts";
import { EDGE_POINTS, type GridFacts, type Layer } from "../../generated/contract.ts";
import { drape } from "../../input/picking.ts";
import { solvedHeight } from "../../input/sketch/strokeops.ts";
import type { Placing } from "../../input/tools/placement.ts";
import { hexColour, lighten, withAlpha } from "../view/colours.ts";
import { layerColour } from "./layers.ts";

/** Points of an outline lie at most this share of the domain apart. */
const STEP = 1 / 192;
/** Colours of grids that are being placed, and of grids that are. */
const PLACING_COLOUR = hexColour("#ff8a5c");
const PLACED_COLOUR = hexColour("#ffb48f");
/** Greatest value of `ImportReport.preview`. */
const PREVIEW_MOST = 255;

/** Outlines, for as long as neither layer nor ground changes: renderers know lines by their array. */
const drawn = new WeakMap<Layer, { readonly ground: Ground; readonly points: Float32Array }>();

/** Places on the edge of a grid, counter-clockwise: its corners, and points between them where the grid bends with the Earth. */
function edgeOf(shape: GridShape, place: GridPlace, bend: GridFacts["edge"] | undefined): Point[] {
  if (bend?.length !== EDGE_POINTS) return cornersOf(shape, place);
  const corners = latticeCorners(shape);
  const side = EDGE_POINTS / 4;
  return bend.map(([du, dv], i) => {
    const [a, b] = [corners[Math.floor(i / side)]!, corners[(Math.floor(i / side) + 1) % 4]!];
    const t = (i % side) / side;
    return latticePoint(place, a[0] + (b[0] - a[0]) * t + du, a[1] + (b[1] - a[1]) * t + dv);
  });
}

/** The closed outline of a grid on the solved ground (xyz triples); `bend`: how its edge leaves the straight lines. */
export function outlineOf(shape: GridShape, place: GridPlace, ground: Ground, bend?: GridFacts["edge"]): Float32Array {
  const edge = edgeOf(shape, place, bend);
  const line = [...edge, edge[0]!].flatMap(([x, y]) => [x, y, 0]);
  return new Float32Array(drape(line, ground.sizeM * STEP, (x, y) => solvedHeight(ground, x, y)));
}

function layerOutline(layer: Layer, ground: Ground): Float32Array {
  const known = drawn.get(layer);
  if (known?.ground === ground) return known.points;
  const points = outlineOf(layer.facts, layer, ground, layer.facts.edge);
  drawn.set(layer, { ground, points });
  return points;
}

export interface FootprintMarks {
  readonly selected: string | null;
  readonly hovered: string | null;
  readonly placing: Placing | null;
  /** A drawing tool is in hand: the selected outline does not stand out. */
  readonly calm: boolean;
}

/**
 * Outlines of all layers that are shown, the selected one strong, and of the grid that is being placed. An outline that nobody
 * wants to see (strength 0) shows while it is selected or pointed at.
 */
export function footprintVisuals(doc: Doc | null, marks: FootprintMarks, ground: Ground): FootprintVisual[] {
  const out: FootprintVisual[] = [];
  for (const layer of doc?.layers.values() ?? []) {
    const { placing } = marks;
    const strong = layer.id === marks.selected && (!marks.calm || layer.id === placing?.id);
    const hovered = layer.id === marks.hovered;
    if (!strong && !hovered && (layer.hidden || layer.outline === 0)) continue;
    const colour = hexColour(layerColour(layer.id));
    out.push({
      id: layer.id,
      points: layerOutline(layer, ground),
      colour: withAlpha(strong || hovered ? lighten(colour, 0.25) : colour, strong || hovered ? 0.95 : layer.outline),
      strong,
    });
  }
  const { placing } = marks;
  if (placing !== null && !doc?.layers.has(placing.id))
    out.push({
      id: placing.id,
      points: outlineOf(placing, placing.place.value, ground),
      colour: PLACING_COLOUR,
      strong: true,
    });
  return out;
}

/** Upright lines from the ground to the corners of the coarse picture: they tell how high it stands. */
export function stemsOf(placing: Placing, placed: PlacingVisual | null, ground: Ground): FootprintVisual[] {
  if (placed === null) return [];
  const { side, points } = placed;
  const out: FootprintVisual[] = [];
  for (const corner of [0, side - 1, side * side - 1, side * (side - 1)]) {
    const [x, y, z] = points.subarray(3 * corner, 3 * corner + 3) as unknown as [number, number, number];
    if (Number.isNaN(z)) continue;
    const line = new Float32Array([x, y, ground.heightAt(x, y), x, y, z]);
    out.push({ id: `${placing.id}/${corner}`, points: line, colour: withAlpha(PLACING_COLOUR, 0.6), strong: false });
  }
  return out;
}

/** A coarse picture where it would lie; `preview`: rows of heights 0..255 between low and high, -1 where there is none. */
export function visualOf(
  placing: Placing,
  place: GridPlace,
  preview: readonly (readonly number[])[],
): PlacingVisual | null {
  const side = preview.length;
  if (side < 2) return null;
  const points = new Float32Array(3 * side * side);
  for (const [row, values] of preview.entries())
    for (const [col, value] of values.entries()) {
      const u = (col / (side - 1)) * (placing.cols - 1);
      const v = (row / (side - 1)) * (placing.rows - 1);
      const [x, y] = latticePoint(place, u, v);
      const height = placing.low_m + (value / PREVIEW_MOST) * (placing.high_m - placing.low_m);
      points.set([x, y, value < 0 ? Number.NaN : place.scale * height + place.lift_m], 3 * (row * side + col));
    }
  return { side, points, colour: PLACED_COLOUR };
}
