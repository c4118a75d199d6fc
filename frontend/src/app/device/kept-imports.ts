/** Imports under way, remembered by this tab: a page that is loaded anew goes on showing them. */

import type { Store } from "./storage.ts";

export interface KeptImport {
  /** Id of the import on the server. */
  readonly id: string;
  readonly file: string;
}

const key = (terrain: string): string => `esker.jobs.${terrain}`;

export function keptImports(terrain: string): KeptImport[] {
  try {
    const parsed: unknown = JSON.parse(window.sessionStorage.getItem(key(terrain)) ?? "[]");
    return Array.isArray(parsed) ? parsed.filter(isKept) : [];
  } catch {
    return [];
  }
}

export function keepImports(terrain: string, kept: readonly KeptImport[]): void {
  try {
    if (kept.length > 0) window.sessionStorage.setItem(key(terrain), JSON.stringify(kept));
    else window.sessionStorage.removeItem(key(terrain));
  } catch {
    // A blocked store costs the memory, never the page.
  }
}

/** Adds an import that was begun on another page of this tab. */
export function keepImport(terrain: string, kept: KeptImport): void {
  keepImports(terrain, [...keptImports(terrain), kept]);
}

/** The last file that became a terrain on the start page. The card of its import can be cancelled from there too. */
export interface StartedImport {
  readonly terrain: string;
  readonly secret: string;
  readonly job: string;
  readonly file: string;
}

const STARTED = "esker.started-import";

export function started(store: Store): StartedImport | null {
  try {
    const v = JSON.parse(store.getItem(STARTED) ?? "null") as Record<string, unknown> | null;
    const whole = v !== null && [v.terrain, v.secret, v.job, v.file].every((each) => typeof each === "string");
    return whole ? (v as unknown as StartedImport) : null;
  } catch {
    return null;
  }
}

export function keepStarted(store: Store, what: StartedImport | null): void {
  try {
    if (what === null) store.removeItem(STARTED);
    else store.setItem(STARTED, JSON.stringify(what));
  } catch {
    // Where storage is blocked, the import is cancelled on its terrain's page only.
  }
}

function isKept(value: unknown): value is KeptImport {
  if (typeof value !== "object" || value === null) return false;
  const { id, file } = value as Record<string, unknown>;
  return typeof id === "string" && typeof file === "string";
}
