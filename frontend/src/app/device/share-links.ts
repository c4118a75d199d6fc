/** The share links that this device has made, so that they can be shown again: the server keeps only their hashes. */

import type { Role } from "../../generated/contract.ts";
import type { Store } from "./storage.ts";

export type ShareRole = Exclude<Role, "owner">;

export interface MadeLink {
  readonly link: string;
  readonly secret: string;
}

export type MadeLinks = Readonly<Partial<Record<ShareRole, MadeLink>>>;

const key = (terrain: string): string => `esker.links.${terrain}`;

function isMade(value: unknown): value is MadeLink {
  const v = value as Partial<Record<keyof MadeLink, unknown>> | null;
  return typeof v === "object" && v !== null && typeof v.link === "string" && typeof v.secret === "string";
}

/** A secret of 192 random bits, as the server makes them. */
export function newSecret(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(24));
  return btoa(String.fromCharCode(...bytes))
    .replaceAll("+", "-")
    .replaceAll("/", "_");
}

const renewingKey = (terrain: string): string => `esker.renewing.${terrain}`;

/** Keeps the secret that my own link is about to get; null: it has it, or did not get it. */
export function keepRenewing(store: Store, terrain: string, secret: string | null): void {
  try {
    if (secret === null) store.removeItem(renewingKey(terrain));
    else store.setItem(renewingKey(terrain), secret);
  } catch {
    // A blocked store: then the answer must come through.
  }
}

/** A secret that my own link may have got without my hearing of it. */
export function renewing(store: Store, terrain: string): string | null {
  return store.getItem(renewingKey(terrain));
}

export function madeLinks(store: Store, terrain: string): MadeLinks {
  try {
    const parsed = JSON.parse(store.getItem(key(terrain)) ?? "{}") as Record<string, unknown>;
    const out: Partial<Record<ShareRole, MadeLink>> = {};
    for (const role of ["edit", "view"] as const) if (isMade(parsed[role])) out[role] = parsed[role];
    return out;
  } catch {
    return {};
  }
}

export function rememberLink(store: Store, terrain: string, role: ShareRole, made: MadeLink | null): MadeLinks {
  const { [role]: _, ...rest } = madeLinks(store, terrain);
  const next: MadeLinks = made ? { ...rest, [role]: made } : rest;
  try {
    store.setItem(key(terrain), JSON.stringify(next));
  } catch {
    // The link still works; it only has to be made again to be shown again.
  }
  return next;
}
