/** Keys for the elevation grid that is being placed: place it, move it, turn it. */

import { msg } from "@lit/localize";
import { moved, rounded, turned } from "../../core/lattice.ts";
import { type ActionContext, GESTURE_MS, type Put } from "./action.ts";

const TURN_DEG = 1;
/** An arrow key moves a grid by this share of the terrain. */
const STEP = 1 / 256;

/**
 * Adds the actions. The result moves the grid by a small step as seen on the screen; false when none is being placed.
 * `direction`: metres on the map of a step to the right and away.
 */
export function placeActions(
  c: ActionContext,
  direction: (right: number, away: number) => readonly [number, number],
  put: Put,
): (right: number, away: number) => boolean {
  const gestures = new Gestures(c.now);
  const usable = (): boolean => c.placing.value !== null && c.canEdit();
  const turn = (by: number): void => {
    const placing = c.placing.value;
    if (placing === null) return;
    const place = placing.place.peek();
    say(c, placing.moveTo(rounded(turned(placing, place, place.rotation_deg + by)), gestures.name(placing.id, "turn")));
  };
  put(
    "set-point",
    msg("Draw with the arrow keys: shows the pen, sets points (or places a grid)"),
    ["Enter"],
    () => (c.placing.value === null ? c.keyPen.show() : c.placing.value.finish()),
    () => usable() || (c.placing.value === null && c.keyPen.usable()),
  );
  put("turn-grid-left", msg("Turn the grid left"), ["<"], () => turn(TURN_DEG), usable);
  put("turn-grid-right", msg("Turn the grid right"), [">"], () => turn(-TURN_DEG), usable);
  return (right, away) => {
    const placing = c.placing.value;
    if (placing === null || !c.canEdit()) return false;
    const step = c.ground().sizeM * STEP;
    const [dx, dy] = direction(right * step, away * step);
    say(c, placing.moveTo(rounded(moved(placing.place.peek(), dx, dy)), gestures.name(placing.id, "nudge")));
    return true;
  };
}

function say(c: ActionContext, refusal: string | null): void {
  if (refusal !== null) c.onMessage(refusal);
}

/** Repeats of a key share one name, so that a held key is one step of undo. */
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
