/**
 * Hints for a newcomer at the foot of the picture, one sentence at a time; null where hands are busy or know better.
 */

import { msg } from "@lit/localize";
import { redraws } from "../../input/sketch/oversketch.ts";
import { flag } from "../device/storage.ts";
import type { Stage } from "../view/stage.ts";

/**
 * Names under which this device remembers that it has drawn before, and that it has drawn a second line or changed the
 * first.
 */
export const DRAWN = "drawn";
export const DRAWN_ON = "drawn-on";
/** Name under which this device remembers that it has drawn a ridge on the map. */
export const DRAWN_ON_MAP = "drawn-on-map";

/** Tools whose line, drawn from above, becomes the straight ridge between its ends. */
const STRAIGHTENED: readonly (string | null)[] = ["mountain", "crevice"];

/** `busy`: real ground is on its way, so that the land will not stay empty. */
export function hintWords(stage: Stage, busy: boolean): string | null {
  const { session, input, camera } = stage;
  const doc = session.doc.doc.value;
  if (!doc || !session.canEdit.value || session.historyView.active.value || stage.following.value !== null) return null;
  if (input.inputMode.value === "draw" || input.placing.value !== null || input.keyPen.visual.value !== null)
    return null;
  const map = camera.state.value.mode === "map";
  if (map && !busy && STRAIGHTENED.includes(input.tool.value) && !flag(session.store, DRAWN_ON_MAP))
    return msg("Draw a ridge on the map. From above a curved line becomes a straight one, between its ends.");
  if (doc.strokes.size === 1) {
    const stroke = doc.strokes.get(input.selection.value ?? "");
    const knows = flag(session.store, DRAWN_ON);
    if (knows || stroke === undefined || !redraws(input.tool.value, stroke)) return null;
    return map
      ? msg("Draw another line, or shape this one with Select.")
      : msg("Now draw over the line to change it, or draw another one beside it.");
  }
  if (doc.strokes.size > 0 || doc.layers.size > 0 || busy) return null;
  if (input.tool.value === "select") return msg("An empty land. Pick a tool and draw a line.");
  if (flag(session.store, DRAWN)) return msg("An empty land. Draw a line.");
  return msg("Draw a line across the land — the ground rises to meet it.");
}
