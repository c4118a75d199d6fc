/** Keys as people read them: in tooltips, in the help dialog, in the user guide. */

export interface KeyedAction {
  readonly title: string;
  readonly keys: readonly string[];
}

const NAMES: Readonly<Record<string, string>> = {
  " ": "Space",
  Space: "Space",
  ArrowUp: "↑",
  ArrowDown: "↓",
  ArrowLeft: "←",
  ArrowRight: "→",
  Delete: "Del",
  Escape: "Esc",
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
