/** Keys to actions: which combination an event is, and whether it is meant for the canvas at all. */

import type { Camera } from "../../core/camera/camera.ts";
import type { Navigation } from "../tools/navigation.ts";
import type { Action } from "./action.ts";
import type { KeyPen } from "./keypen.ts";

/** Elements in which one types. A switch is an input too, but takes few keys: see `CONTROLS`. */
const TICKED = ":not([type='checkbox'], [type='radio'], [type='range'], [type='button'], [type='file'])";
const EDITABLE = `input${TICKED}, textarea, select, [contenteditable=''], [contenteditable='true']`;
const MODAL = "dialog, wa-dialog, wa-drawer, [role='dialog'], [role='menu'], [role='listbox']";
/** Elements that Space, Enter and the arrows belong to. */
const CONTROLS =
  "button, input, a[href], summary, [role='button'], [role='slider'], [role='radio'], [role='tab'], wa-button, wa-slider, wa-switch, wa-checkbox, wa-radio, wa-tab, wa-select, wa-dropdown";
const CONTROL_KEYS: ReadonlySet<string> = new Set([
  " ",
  "Enter",
  "ArrowUp",
  "ArrowDown",
  "ArrowLeft",
  "ArrowRight",
  "Home",
  "End",
  "PageUp",
  "PageDown",
]);

export type KeyLike = Pick<KeyboardEvent, "key" | "code" | "ctrlKey" | "metaKey" | "altKey" | "shiftKey">;

/**
 * The combination as `Ctrl+Alt+Shift+key`: letters in lower case, digits and (on keyboards without Latin letters)
 * letters by their place, printable signs as typed without a Shift. ⌘ counts as Ctrl.
 */
export function combination(event: KeyLike): string {
  const digit = /^Digit(\d)$/.exec(event.code)?.[1];
  const place = /^Key([A-Z])$/.exec(event.code)?.[1]?.toLowerCase();
  let key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (digit !== undefined && (event.altKey || event.ctrlKey || event.metaKey || /^\d$/.test(event.key))) key = digit;
  else if (place !== undefined && !/^[a-z]$/.test(key) && key.length === 1) key = place;
  const letterLike = key.length > 1 || /^[a-z0-9 ]$/.test(key);
  const modifiers = [
    event.ctrlKey || event.metaKey ? "Ctrl+" : "",
    event.altKey ? "Alt+" : "",
    event.shiftKey && letterLike ? "Shift+" : "",
  ];
  return modifiers.join("") + key;
}

/**
 * Says whether the key event is meant for the terrain: not for a field, a dialog, or the control that has the focus.
 */
export function meantForCanvas(event: KeyboardEvent): boolean {
  if (event.defaultPrevented || event.isComposing) return false;
  for (const node of event.composedPath()) {
    if (!(node instanceof Element)) continue;
    if (node.matches(EDITABLE) || node.matches(MODAL)) return false;
    if (CONTROL_KEYS.has(event.key) && node.matches(CONTROLS)) return false;
  }
  return true;
}

/** The first enabled action with this combination. */
export function actionFor(actions: ReadonlyMap<string, Action>, keys: string): Action | null {
  for (const action of actions.values()) if (action.keys.includes(keys) && action.enabled()) return action;
  return null;
}

/** Listens to the keys of the window: the pen that they move, flight, the Space that pans, and the actions. */
export class Keyboard {
  readonly #camera: Camera;
  readonly #navigation: Navigation;
  readonly #actions: ReadonlyMap<string, Action>;
  readonly #pen: Pick<KeyPen, "key">;
  readonly #abort = new AbortController();
  #spaceHeld = false;

  constructor(camera: Camera, navigation: Navigation, actions: ReadonlyMap<string, Action>, pen: Pick<KeyPen, "key">) {
    this.#camera = camera;
    this.#pen = pen;
    this.#navigation = navigation;
    this.#actions = actions;
    const { signal } = this.#abort;
    window.addEventListener("keydown", (e) => this.#down(e), { signal });
    window.addEventListener("keyup", (e) => this.#up(e), { signal });
    window.addEventListener("blur", () => this.#blur(), { signal });
  }

  get spaceHeld(): boolean {
    return this.#spaceHeld;
  }

  dispose(): void {
    this.#abort.abort();
  }

  #down(e: KeyboardEvent): void {
    if (!meantForCanvas(e)) return;
    if (this.#pen.key(e)) {
      e.preventDefault();
      return;
    }
    if (e.key === " ") {
      this.#spaceHeld = true;
      e.preventDefault();
      return;
    }
    const plain = !e.ctrlKey && !e.metaKey && !e.altKey;
    const flies = plain && this.#camera.state.value.mode === "fly";
    if (flies && this.#navigation.flightKey(e.key.toLowerCase(), e.shiftKey ? 3 : 1)) {
      e.preventDefault();
      return;
    }
    const action = actionFor(this.#actions, combination(e));
    if (action === null) return;
    e.preventDefault();
    action.run();
  }

  #up(e: KeyboardEvent): void {
    if (e.key === " ") this.#spaceHeld = false;
    this.#navigation.flightKey(e.key.toLowerCase(), 0);
  }

  #blur(): void {
    this.#spaceHeld = false;
    this.#navigation.stopFlight();
  }
}
