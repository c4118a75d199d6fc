/** Where the ground is too high and too low for a task, as a picture to lay over the map. */

import { differenceColour } from "../../core/difference.ts";
import type { ChannelGrid } from "../../core/types.ts";

export class DifferencePicture {
  #canvas: HTMLCanvasElement | null = null;
  #source: ChannelGrid | null = null;

  /** The picture, north up, clear where the ground is as it is asked for. */
  of(off: ChannelGrid): HTMLCanvasElement {
    if (this.#canvas !== null && this.#source === off) return this.#canvas;
    this.#source = off;
    const { side, values } = off;
    this.#canvas ??= document.createElement("canvas");
    Object.assign(this.#canvas, { width: side, height: side });
    const context = this.#canvas.getContext("2d")!;
    const image = context.createImageData(side, side);
    values.forEach((share, k) => {
      const [r, g, b, a] = differenceColour(share);
      const row = side - 1 - Math.floor(k / side);
      image.data.set([r, g, b, 255 * a], 4 * (row * side + (k % side)));
    });
    context.putImageData(image, 0, 0);
    return this.#canvas;
  }
}
