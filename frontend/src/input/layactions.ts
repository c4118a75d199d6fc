/** Keys for the elevation grid that is being laid: place it, move it, turn it. */

import { moved, rounded, turned } from "../core/lattice.ts";
import type { ActionContext, Put } from "./actions.ts";

/** Key repeats within this time belong to one gesture. */
const GESTURE_MS = 800;
const TURN_DEG = 1;
/** One step of an arrow key, as a share of the terrain. */
const STEP = 1 / 256;

/**
 * Adds the actions. The result moves the grid by a small step as seen on the screen; false when none is being laid.
 * `direction`: metres on the map of a step to the right and away.
 */
export function layActions(
  c: ActionContext,
  direction: (right: number, away: number) => readonly [number, number],
  put: Put,
): (right: number, away: number) => boolean {
  const gestures = new Gestures(c.now);
  const usable = (): boolean => c.laying.value !== null && c.canEdit();
  const turn = (by: number): void => {
    const laying = c.laying.value;
    if (laying === null) return;
    const place = laying.place.peek();
    say(c, laying.lay(rounded(turned(laying, place, place.rotation_deg + by)), gestures.name(laying.id, "turn")));
  };
  put(
    "set-point",
    "Draw with the arrow keys: shows the pen, sets points (or places a grid)",
    ["Enter"],
    () => (c.laying.value === null ? c.keyPen.show() : c.laying.value.finish()),
    () => usable() || (c.laying.value === null && c.keyPen.usable()),
  );
  put("turn-grid-left", "Turn the grid left", ["<"], () => turn(TURN_DEG), usable);
  put("turn-grid-right", "Turn the grid right", [">"], () => turn(-TURN_DEG), usable);
  return (right, away) => {
    const laying = c.laying.value;
    if (laying === null || !c.canEdit()) return false;
    const step = c.ground().sizeM * STEP;
    const [dx, dy] = direction(right * step, away * step);
    say(c, laying.lay(rounded(moved(laying.place.peek(), dx, dy)), gestures.name(laying.id, "nudge")));
    return true;
  };
}

function say(c: ActionContext, refusal: string | null): void {
  if (refusal !== null) c.onMessage(refusal);
}

/** One name for repeats of a key, so that a held key is one step of undo. */
class Gestures {
  #last = { kind: "", name: "", at: -Infinity };
  readonly #now: () => number;

  constructor(now: () => number) {
    this.#now = now;
  }

  name(id: string, what: string): string {
    const now = this.#now();
    const kind = `${what}/${id}`;
    if (this.#last.kind !== kind || now - this.#last.at > GESTURE_MS)
      this.#last = { kind, name: `${what}-${id}-${Math.floor(now)}`, at: now };
    this.#last.at = now;
    return this.#last.name;
  }
}
