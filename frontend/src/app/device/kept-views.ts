/** Remembered views of a terrain, kept on this device. */

import type { SavedView } from "../../core/camera/camera.ts";
import type { Vec3 } from "../../core/types.ts";
import type { Store } from "./storage.ts";

const key = (terrain: string): string => `esker.views.${terrain}`;

function isVec3(value: unknown): value is Vec3 {
  return Array.isArray(value) && value.length === 3 && value.every((v) => typeof v === "number" && Number.isFinite(v));
}

function isView(value: unknown): value is SavedView {
  const v = value as { mode?: unknown; eye?: unknown; target?: unknown } | null;
  if (typeof v !== "object" || v === null) return false;
  return ["orbit", "fly", "map"].includes(String(v.mode)) && isVec3(v.eye) && isVec3(v.target);
}

/** The views that were kept; damaged ones are left out. */
export function keptViews(store: Store, terrain: string): [string, SavedView][] {
  try {
    const parsed: unknown = JSON.parse(store.getItem(key(terrain)) ?? "{}");
    if (typeof parsed !== "object" || parsed === null) return [];
    return Object.entries(parsed).filter((entry): entry is [string, SavedView] => isView(entry[1]));
  } catch {
    return [];
  }
}

export function keepViews(store: Store, terrain: string, views: ReadonlyMap<string, SavedView>): void {
  if (views.size === 0) return;
  try {
    store.setItem(key(terrain), JSON.stringify(Object.fromEntries(views)));
  } catch {
    // The views then last as long as the page.
  }
}
