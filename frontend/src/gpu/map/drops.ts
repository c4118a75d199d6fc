/** Drops of rain on the 2D map. */

import type { DropsVisual } from "../../core/types.ts";

const FLOATS = 4;
const RADIUS_PX = 1.4;
const COLOUR = "rgba(36,112,200,0.75)";

/** Draws all drops as dots; those that are hardly shown are left out. `to`: from metres to pixels. */
export function drawDrops(
  context: CanvasRenderingContext2D,
  { data, count }: DropsVisual,
  to: (x: number, y: number) => readonly [number, number],
  unit: number,
): void {
  const side = 2 * RADIUS_PX * unit;
  context.fillStyle = COLOUR;
  for (let k = 0; k < FLOATS * count; k += FLOATS) {
    const shown = data[k + 3]! >= 2 ? data[k + 3]! - 2 : data[k + 3]!;
    if (shown < 0.3) continue;
    const [x, y] = to(data[k]!, data[k + 1]!);
    context.fillRect(x - side / 2, y - side / 2, side, side);
  }
}
