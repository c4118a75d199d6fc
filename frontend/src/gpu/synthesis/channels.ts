/**
 * Channels as the synthesis reads them, all on one grid (compute_synthesis.wgsl, channel_value): what strokes ask of
 * the detail, and the data level that holds it back.
 */

import type { ChannelGrid, ChannelView } from "../../core/types.ts";
import { BASE_SURVEY } from "../../generated/contract.ts";

export interface ChannelFacts {
  /** The grid has 2^bits cells a side. */
  readonly bits: number;
  /** The channels differ from place to place. */
  readonly varied: boolean;
  /** Snow, grass, forest or wetness is asked for anywhere. */
  readonly biased: boolean;
  /** Elevation data hold detail back somewhere. */
  readonly surveyed: boolean;
}

export interface ChannelWords extends ChannelFacts {
  /** Per node: amplitude, roughness, snow, grass, forest, wetness; with data survey and nothing. Row 0 south. */
  readonly values: Float32Array<ArrayBuffer>;
}

/** The finest of the grids serves; coarser ones are bilinear on it, which changes nothing between their nodes. */
export function channelWords(view: ChannelView): ChannelWords {
  const grids = [view.amplitude, view.roughness, view.snow, view.grass, view.forest, view.wetness];
  const surveyed = view.survey.values.some((v) => v !== BASE_SURVEY);
  if (surveyed) grids.push(view.survey);
  const cells = Math.max(...grids.map((grid) => grid.side - 1));
  const bits = Math.log2(cells);
  if (!Number.isInteger(bits)) throw new RangeError(`channels have ${cells} cells a side: not a power of two`);
  const side = cells + 1;
  const stride = surveyed ? 8 : 6;
  const values = new Float32Array(stride * side * side);
  grids.forEach((grid, channel) => {
    spread(grid, side, values, channel, stride);
  });
  const biased = grids.slice(2, 6).some((grid) => grid.values.some((v) => v !== 0));
  const varied = biased || grids.some((grid) => grid.values.some((v) => v !== grid.values[0]));
  return { values, bits, varied, biased, surveyed };
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
