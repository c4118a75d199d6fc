/** The grids on the 2D map: outlines, and the coarse picture of one that is being placed. */

import type { FootprintVisual, PlacingVisual, Rgba } from "../../core/types.ts";
import { placingShades } from "../passes/placing.ts";

/** World metres to pixels of the map. */
export type ToMap = (x: number, y: number) => [number, number];

const css = ([r, g, b]: Rgba, a: number): string =>
  `rgba(${Math.round(r * 255)},${Math.round(g * 255)},${Math.round(b * 255)},${a})`;

export function drawFootprints(
  context: CanvasRenderingContext2D,
  footprints: readonly FootprintVisual[],
  to: ToMap,
  unit: number,
): void {
  context.lineJoin = "round";
  for (const { points, colour, strong, halfWidthPx } of footprints) {
    context.beginPath();
    for (let i = 0; i + 2 < points.length; i += 3) {
      const [x, y] = to(points[i]!, points[i + 1]!);
      if (i === 0) context.moveTo(x, y);
      else context.lineTo(x, y);
    }
    if (halfWidthPx === undefined) {
      context.lineWidth = (strong ? 5 : 3) * unit;
      context.strokeStyle = `rgba(255,253,247,${0.8 * colour[3]})`;
      context.stroke();
    }
    context.lineWidth = (halfWidthPx === undefined ? (strong ? 2.4 : 1.4) : 2 * halfWidthPx) * unit;
    context.strokeStyle = css(colour, colour[3]);
    context.stroke();
  }
}

/** The picture is a parallelogram: its own small canvas, drawn through the affine map of its corners. */
export class MapPlacing {
  #held: PlacingVisual | null = null;
  #picture: HTMLCanvasElement | null = null;

  draw(context: CanvasRenderingContext2D, placed: PlacingVisual, to: ToMap): void {
    const { side, points } = placed;
    if (placed !== this.#held) {
      this.#picture = paint(placed, this.#picture);
      this.#held = placed;
    }
    const corner = (row: number, col: number): [number, number] => {
      const i = 3 * (row * side + col);
      return to(points[i]!, points[i + 1]!);
    };
    const [o, e, n] = [corner(0, 0), corner(0, side - 1), corner(side - 1, 0)];
    const span = side - 1;
    context.save();
    // Row 0 of the picture is the south one; pixels stand around their points.
    context.transform(
      (e[0] - o[0]) / span,
      (e[1] - o[1]) / span,
      (n[0] - o[0]) / span,
      (n[1] - o[1]) / span,
      o[0],
      o[1],
    );
    context.globalAlpha = 0.75;
    context.drawImage(this.#picture!, -0.5, -0.5);
    context.restore();
  }
}

function paint(placed: PlacingVisual, old: HTMLCanvasElement | null): HTMLCanvasElement {
  const { side, colour } = placed;
  const canvas = old ?? document.createElement("canvas");
  canvas.width = canvas.height = side;
  const context = canvas.getContext("2d")!;
  const image = context.createImageData(side, side);
  for (const [i, shade] of placingShades(placed).entries()) {
    if (Number.isNaN(shade)) continue;
    for (let k = 0; k < 3; k++) {
      const [dark, bright] = [colour[k]! * 0.25, colour[k]! * 0.45 + 0.55];
      image.data[4 * i + k] = 255 * (dark + (bright - dark) * shade);
    }
    image.data[4 * i + 3] = 255 * colour[3];
  }
  context.putImageData(image, 0, 0);
  return canvas;
}
