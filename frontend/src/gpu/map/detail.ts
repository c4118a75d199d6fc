/** The overlay of roughness and amplitude on the 2D map: one small picture of the whole domain, stretched over the map. */

import type { ChannelGrid, ChannelView } from "../../core/types.ts";
import { channelTexels } from "../atlas/channeltexture.ts";

type Rgb = readonly [number, number, number];

/** The colours of ui/panels/legend.ts. */
const SMOOTH: Rgb = [0x3d, 0x7d, 0xa3];
const MIDDLE: Rgb = [0xa9, 0xa0, 0x6c];
const ROUGH: Rgb = [0xb3, 0x4a, 0x58];
const NONE: Rgb = [0x8d, 0x8d, 0x8d];

const mix = (a: Rgb, b: Rgb, t: number): Rgb => [
  a[0] + (b[0] - a[0]) * t,
  a[1] + (b[1] - a[1]) * t,
  a[2] + (b[2] - a[2]) * t,
];

/** Colour for amplitude in parts of the greatest and roughness, both 0..1: hue by roughness, strength by amplitude. */
export function detailColour(amplitude: number, roughness: number): Rgb {
  const hue = roughness < 0.5 ? mix(SMOOTH, MIDDLE, 2 * roughness) : mix(MIDDLE, ROUGH, 2 * roughness - 1);
  return mix(NONE, hue, 0.25 + 0.75 * Math.sqrt(amplitude));
}

export class DetailPicture {
  #canvas: HTMLCanvasElement | null = null;
  #source: ChannelView | null = null;
  #stamp = -1;

  /** The picture, north up. */
  of(channels: ChannelView): HTMLCanvasElement {
    if (this.#canvas !== null && this.#source === channels && this.#stamp === channels.stamp) return this.#canvas;
    this.#source = channels;
    this.#stamp = channels.stamp;
    const { bytes, side } = channelTexels(channels);
    this.#canvas ??= document.createElement("canvas");
    Object.assign(this.#canvas, { width: side, height: side });
    const context = this.#canvas.getContext("2d")!;
    const image = context.createImageData(side, side);
    for (let row = 0; row < side; row += 1) {
      for (let col = 0; col < side; col += 1) {
        const from = 4 * (row * side + col);
        const colour = detailColour(bytes[from]! / 255, bytes[from + 1]! / 255);
        image.data.set([...colour, 255], 4 * ((side - 1 - row) * side + col));
      }
    }
    context.putImageData(image, 0, 0);
    return this.#canvas;
  }
}

/** The colours of influence_tint in overlay/overlay.wgsl. */
const FELT_FAR: Rgb = [0xc9, 0xb8, 0x6e];
const FELT_NEAR: Rgb = [0xd3, 0x5a, 0x3c];

/** The colour of a watershed on the map. */
const SHED: Rgb = [0x2f, 0x72, 0xb8];

/** The colours of painted_tint in overlay/overlay.wgsl and of ui/panels/legend.ts. */
const LESS: Rgb = [0xb3, 0x74, 0x42];
const MORE: Rgb = [0x35, 0x95, 0xb3];

/** Colour for a painted channel: 0 less of it, 0.5 as it grows, 1 more. */
export function paintedColour(share: number): Rgb {
  const strength = Math.sqrt(Math.min(1, Math.max(0, 2 * Math.abs(share - 0.5) - 0.01)));
  return mix(NONE, share < 0.5 ? LESS : MORE, strength);
}

/** The paint of one channel, as a picture to lay over the map. */
export class PaintedPicture {
  #canvas: HTMLCanvasElement | null = null;
  #source: ChannelGrid | null = null;

  /** The picture, north up. `shares`: 0..1, south row first (`overlayGrid`). */
  of(shares: ChannelGrid): HTMLCanvasElement {
    if (this.#canvas !== null && this.#source === shares) return this.#canvas;
    this.#source = shares;
    const { side, values } = shares;
    this.#canvas ??= document.createElement("canvas");
    Object.assign(this.#canvas, { width: side, height: side });
    const context = this.#canvas.getContext("2d")!;
    const image = context.createImageData(side, side);
    values.forEach((share, k) => {
      const row = side - 1 - Math.floor(k / side);
      image.data.set([...paintedColour(share), 255], 4 * (row * side + (k % side)));
    });
    context.putImageData(image, 0, 0);
    return this.#canvas;
  }
}

/** A watershed, as a picture to lay over the map. */
export class ShedPicture {
  #canvas: HTMLCanvasElement | null = null;
  #source: ChannelGrid | null = null;

  /** The picture, north up, clear beyond the watershed. */
  of(shed: ChannelGrid): HTMLCanvasElement {
    if (this.#canvas !== null && this.#source === shed) return this.#canvas;
    this.#source = shed;
    const { side, values } = shed;
    this.#canvas ??= document.createElement("canvas");
    Object.assign(this.#canvas, { width: side, height: side });
    const context = this.#canvas.getContext("2d")!;
    const image = context.createImageData(side, side);
    values.forEach((share, k) => {
      const row = side - 1 - Math.floor(k / side);
      image.data.set([...SHED, 150 * share], 4 * (row * side + (k % side)));
    });
    context.putImageData(image, 0, 0);
    return this.#canvas;
  }
}

/** Where the selected stroke is felt, as a picture to lay over the map. */
export class InfluencePicture {
  #canvas: HTMLCanvasElement | null = null;
  #source: ChannelGrid | null = null;

  /** The picture, north up, clear where nothing is felt. */
  of(influence: ChannelGrid): HTMLCanvasElement {
    if (this.#canvas !== null && this.#source === influence) return this.#canvas;
    this.#source = influence;
    const { side, values } = influence;
    this.#canvas ??= document.createElement("canvas");
    Object.assign(this.#canvas, { width: side, height: side });
    const context = this.#canvas.getContext("2d")!;
    const image = context.createImageData(side, side);
    values.forEach((felt, k) => {
      const colour = mix(FELT_FAR, FELT_NEAR, Math.min(1, Math.max(0, (felt - 0.35) / 0.65)));
      const row = side - 1 - Math.floor(k / side);
      image.data.set([...colour, 255 * Math.min(1, 2 * felt)], 4 * (row * side + (k % side)));
    });
    context.putImageData(image, 0, 0);
    return this.#canvas;
  }
}
