/** Keys as people read them: in tooltips, in the help dialog, in the user guide. */

import { msg } from "@lit/localize";

export interface KeyedAction {
  readonly title: string;
  readonly keys: readonly string[];
}

const NAMES: Readonly<Record<string, string>> = {
  " ": msg("Space"),
  Space: msg("Space"),
  ArrowUp: "↑",
  ArrowDown: "↓",
  ArrowLeft: "←",
  ArrowRight: "→",
  Delete: msg("Del"),
  Escape: msg("Esc"),
  Backspace: "Backspace",
};

/** Splits a combination such as `Ctrl+Shift+z` into the parts that are printed: ["Ctrl", "Shift", "Z"]. */
export function keyParts(combination: string): string[] {
  return combination.split(/\+(?=.)/).map((part) => NAMES[part] ?? (part.length === 1 ? part.toUpperCase() : part));
}

export function keyLabel(combination: string): string {
  return keyParts(combination).join("+");
}

/** A label with the first key of its action: "Mountain (B)". */
export function keyText(label: string, action: KeyedAction | undefined): string {
  const key = action?.keys[0];
  return key === undefined ? label : `${label} (${keyLabel(key)})`;
}
