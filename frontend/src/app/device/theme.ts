/** Dark and light: follows the system until somebody chooses, then remembers (public/theme.js does the first paint). */

import { type ReadonlySignal, signal } from "@preact/signals-core";

export type ThemeChoice = "system" | "light" | "dark";

const KEY = "esker.theme";
const choice = signal<ThemeChoice>("system");

/** The choice, not its effect. */
export const themeChoice: ReadonlySignal<ThemeChoice> = choice;

function apply(query: MediaQueryList): void {
  const dark = choice.value === "dark" || (choice.value === "system" && query.matches);
  const root = document.documentElement.classList;
  root.toggle("wa-dark", dark);
  root.toggle("wa-light", !dark);
}

/** Reads the remembered choice and follows the system while there is none. Call once at start. */
export function startTheme(): void {
  const query = window.matchMedia("(prefers-color-scheme: dark)");
  try {
    const kept = localStorage.getItem(KEY);
    if (kept === "dark" || kept === "light") choice.value = kept;
  } catch {
    // Storage is blocked: the system decides.
  }
  query.addEventListener("change", () => apply(query));
  choice.subscribe(() => apply(query));
}

export function chooseTheme(next: ThemeChoice): void {
  try {
    if (next === "system") localStorage.removeItem(KEY);
    else localStorage.setItem(KEY, next);
  } catch {
    // The choice then holds for this page only.
  }
  choice.value = next;
}
