/** What a newcomer is told at the foot of the picture, one sentence at a time; null where hands are busy or know better. */

import { redraws } from "../input/oversketch.ts";
import type { Stage } from "./stage.ts";
import { flag } from "./storage.ts";

/** This device has drawn before; it has drawn a second line or changed the first. */
export const DRAWN = "drawn";
export const DRAWN_ON = "drawn-on";

/** `busy`: real ground is on its way, so that the land will not stay empty. */
export function hintWords(stage: Stage, busy: boolean): string | null {
  const { session, input, camera } = stage;
  const doc = session.doc.doc.value;
  if (!doc || !session.canEdit.value || session.past.active.value || stage.following.value !== null) return null;
  if (input.inputMode.value === "draw" || input.laying.value !== null || input.keyPen.visual.value !== null)
    return null;
  if (doc.strokes.size === 1) {
    const stroke = doc.strokes.get(input.selection.value ?? "");
    const knows = flag(session.store, DRAWN_ON);
    if (knows || stroke === undefined || !redraws(input.tool.value, stroke)) return null;
    return camera.state.value.mode === "map"
      ? "Draw another line, or shape this one with Select."
      : "Now draw over the line to change it, or draw another one beside it.";
  }
  if (doc.strokes.size > 0 || doc.layers.size > 0 || busy) return null;
  if (input.tool.value === "select") return "An empty land. Pick a tool and draw a line.";
  if (flag(session.store, DRAWN)) return "An empty land. Draw a line.";
  return camera.state.value.mode === "map"
    ? "Draw a ridge on the map — the ground rises along it."
    : "Draw a line across the land — the ground rises to meet it.";
}
