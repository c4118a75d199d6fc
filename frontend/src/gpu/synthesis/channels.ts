/**
 * Channels as the synthesis reads them, all on one grid (synthesis/synthesise.wgsl, channel_value): what strokes ask of
 * the detail, and the data level that holds it back.
 */

import type { ChannelGrid, ChannelView } from "../../core/types.ts";
import { BASE_FAR, BASE_SURVEY } from "../../generated/contract.ts";

export interface ChannelFacts {
  /** The grid has 2^bits cells a side. */
  readonly bits: number;
  /** The channels differ from place to place. */
  readonly varied: boolean;
  /** Snow, grass, forest or wetness is asked for anywhere. */
  readonly biased: boolean;
  /** Elevation data hold detail back somewhere. */
  readonly surveyed: boolean;
  /** Paint asks for gullies somewhere. */
  readonly gullied: boolean;
  /** Values of a node in pairs: 3, or 5 with data, distances or paint of gullies. */
  readonly stride: number;
  /** Cells along one side of the grid of distances itself. */
  readonly farCells: number;
}

export interface ChannelWords extends ChannelFacts {
  /** Per node: amplitude, roughness, snow, grass, forest, wetness; of wide nodes survey, far, erosion and nothing. Row 0 south. */
  readonly values: Float32Array<ArrayBuffer>;
}

/** Facts of a terrain of which no channel is known yet. */
export const NO_CHANNELS: ChannelFacts = {
  bits: 0,
  varied: false,
  biased: false,
  surveyed: false,
  gullied: false,
  stride: 3,
  farCells: 1,
};

/** The finest of the grids serves; coarser ones are bilinear on it, which changes nothing between their nodes. */
export function channelWords(view: ChannelView): ChannelWords {
  const grids = [view.amplitude, view.roughness, view.snow, view.grass, view.forest, view.wetness];
  const surveyed = view.survey.values.some((v) => v !== BASE_SURVEY);
  const worn = [view.far, view.erosion].some((grid, k) => grid.values.some((v) => v !== [BASE_FAR, 0][k]));
  const stride = surveyed || worn ? 5 : 3;
  if (stride > 3) grids.push(view.survey, view.far, view.erosion);
  const cells = Math.max(...grids.map((grid) => grid.side - 1));
  const bits = Math.log2(cells);
  if (!Number.isInteger(bits)) throw new RangeError(`channels have ${cells} cells a side: not a power of two`);
  const side = cells + 1;
  const values = new Float32Array(2 * stride * side * side);
  grids.forEach((grid, channel) => {
    spread(grid, side, values, channel, 2 * stride);
  });
  const biased = grids.slice(2, 6).some((grid) => grid.values.some((v) => v !== 0));
  const varied = biased || grids.some((grid) => grid.values.some((v) => v !== grid.values[0]));
  const gullied = view.erosion.values.some((v) => v > 0);
  return { values, bits, varied, biased, surveyed, gullied, stride, farCells: view.far.side - 1 };
}

function spread(grid: ChannelGrid, side: number, out: Float32Array, first: number, stride: number): void {
  const scale = (grid.side - 1) / (side - 1);
  for (let row = 0; row < side; row += 1) {
    const j = Math.min(grid.side - 2, Math.floor(row * scale));
    const v = row * scale - j;
    for (let col = 0; col < side; col += 1) {
      const i = Math.min(grid.side - 2, Math.floor(col * scale));
      const u = col * scale - i;
      const at = j * grid.side + i;
      const south = grid.values[at]! * (1 - u) + grid.values[at + 1]! * u;
      const north = grid.values[at + grid.side]! * (1 - u) + grid.values[at + grid.side + 1]! * u;
      out[first + stride * (row * side + col)] = south * (1 - v) + north * v;
    }
  }
}
