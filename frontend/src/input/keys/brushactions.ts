/** Keys of the brush: they change the selected paint, else what the brush will paint next. */

import { msg } from "@lit/localize";
import type { Paint } from "../../generated/contract.ts";
import { brushRadius, PAINT_CHANNELS } from "../tools/painttool.ts";
import type { ActionContext, Put } from "./action.ts";
import type { StrokeActions } from "./strokeactions.ts";

/** One press makes the brush this much larger, and this much stronger. */
const RADIUS_STEP = 1.25;
const VALUE_STEP = 0.1;
const WEAKEST = 0.1;

/** The paint with its strength changed by a step, its sign kept. */
function stronger(paint: Paint, sign: number): Paint {
  const size = Math.min(1, Math.max(WEAKEST, Math.abs(paint.value) + sign * VALUE_STEP));
  return { ...paint, value: Math.round(100 * size * (paint.value < 0 ? -1 : 1)) / 100 };
}

export function brushActions(c: ActionContext, edits: StrokeActions, put: Put): void {
  /** Returns the paint of the selected stroke; null where the brush's own counts, since no paint is selected. */
  const selected = (): Paint | null => edits.stroke()?.paint ?? null;
  const change = (to: (paint: Paint) => Paint): void => {
    const paint = selected();
    if (paint !== null) edits.repaint(to(paint));
    else c.defaults.paint.value = to(c.defaults.paint.value);
  };
  const enabled = (): boolean => (selected() !== null ? edits.usable() : c.tool.value === "paint" && c.canEdit());
  const resized = (factor: number) => (paint: Paint) => ({
    ...paint,
    radius_m: brushRadius(paint.radius_m * factor, c.ground().sizeM),
  });
  put("brush-smaller", msg("Smaller brush"), ["["], () => change(resized(1 / RADIUS_STEP)), enabled);
  put("brush-larger", msg("Larger brush"), ["]"], () => change(resized(RADIUS_STEP)), enabled);
  put("brush-weaker", msg("Weaker brush"), ["{"], () => change((p) => stronger(p, -1)), enabled);
  put("brush-stronger", msg("Stronger brush"), ["}"], () => change((p) => stronger(p, 1)), enabled);
  put(
    "brush-channel",
    msg("Next paint: snow, forest, meadow, wetness, roughness, amplitude, gullies"),
    ["u"],
    () =>
      change((p) => {
        const at = PAINT_CHANNELS.indexOf(p.channel);
        return { ...p, channel: PAINT_CHANNELS[(at + 1) % PAINT_CHANNELS.length]! };
      }),
    enabled,
  );
  put(
    "brush-opposite",
    msg("Paint adds, or takes away"),
    ["Shift+u"],
    () => change((p) => ({ ...p, value: -p.value })),
    enabled,
  );
}
