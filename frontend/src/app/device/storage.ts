/**
 * The memory of this device: recent terrains, my name and colour, the theme. Storage may be blocked; then nothing is
 * kept.
 */

import type { Role } from "../../generated/contract.ts";
import { friendlyName } from "./names.ts";

export interface RecentTerrain {
  readonly id: string;
  readonly title: string;
  readonly secret: string;
  readonly role: Role;
  /** Milliseconds since 1970. */
  readonly opened: number;
}

const RECENT_KEY = "esker.recent";
const RECENT_LIMIT = 24;

/** The part of `Storage` that is used; a stand-in serves in tests and where the browser's own is blocked. */
export type Store = Pick<Storage, "getItem" | "setItem" | "removeItem">;

/** The browser's storage, or one that lasts as long as the page. */
export function deviceStore(): Store {
  try {
    const store = window.localStorage;
    store.setItem("esker.probe", "1");
    store.removeItem("esker.probe");
    return store;
  } catch {
    const values = new Map<string, string>();
    return {
      getItem: (key) => values.get(key) ?? null,
      setItem: (key, value) => void values.set(key, value),
      removeItem: (key) => void values.delete(key),
    };
  }
}

function isRecent(value: unknown): value is RecentTerrain {
  if (typeof value !== "object" || value === null) return false;
  const v = value as Record<string, unknown>;
  return (
    typeof v.id === "string" &&
    typeof v.title === "string" &&
    typeof v.secret === "string" &&
    typeof v.opened === "number" &&
    ["owner", "edit", "view"].includes(String(v.role))
  );
}

/** Recent terrains, the last opened first. Damaged entries are left out. */
export function recentTerrains(store: Store): RecentTerrain[] {
  try {
    const parsed: unknown = JSON.parse(store.getItem(RECENT_KEY) ?? "[]");
    if (!Array.isArray(parsed)) return [];
    return parsed.filter(isRecent).sort((a, b) => b.opened - a.opened);
  } catch {
    return [];
  }
}

const RANK: Record<Role, number> = { owner: 2, edit: 1, view: 0 };

/** Puts a terrain first. A weaker link never replaces a stronger one that this device already has. */
export function rememberTerrain(store: Store, entry: RecentTerrain): void {
  const all = recentTerrains(store);
  const known = all.find((r) => r.id === entry.id);
  const keep = known && RANK[known.role] > RANK[entry.role] ? { secret: known.secret, role: known.role } : {};
  const next = [{ ...entry, ...keep }, ...all.filter((r) => r.id !== entry.id)].slice(0, RECENT_LIMIT);
  write(store, RECENT_KEY, JSON.stringify(next));
}

export function forgetTerrain(store: Store, id: string): void {
  write(store, RECENT_KEY, JSON.stringify(recentTerrains(store).filter((r) => r.id !== id)));
}

/** Forgets a terrain if it is remembered with this secret. */
export function forgetSecret(store: Store, id: string, secret: string): void {
  if (recentTerrains(store).some((r) => r.id === id && r.secret === secret)) forgetTerrain(store, id);
}

function write(store: Store, key: string, value: string): void {
  try {
    store.setItem(key, value);
  } catch {
    // A full store loses a convenience, never work: the terrain itself lives on the server.
  }
}

/** My name and colour, as other people see them. */
export interface Identity {
  readonly name: string;
  readonly colour: string;
}

/** Colours that stay apart from each other, from the ground and from the stroke colours. */
export const MEMBER_COLOURS = [
  "#e8590c",
  "#0b8f8a",
  "#7c4dd6",
  "#c2255c",
  "#2b8a3e",
  "#b8860b",
  "#1c7ed6",
  "#a61e4d",
] as const;

/**
 * Returns my name and colour on this device. A person who never chose a name gets a friendly one from `client` (any
 * string of one's own), and it is kept from then on. An empty name that somebody saved means the same.
 */
export function identity(store: Store, random: () => number, client: string): Identity {
  let name = (store.getItem("esker.name") ?? "").trim().slice(0, 80);
  if (name === "") {
    name = friendlyName(client);
    write(store, "esker.name", name);
  }
  const kept = store.getItem("esker.colour") ?? "";
  if (/^#[0-9a-f]{6}$/.test(kept)) return { name, colour: kept };
  const colour = MEMBER_COLOURS[Math.floor(random() * MEMBER_COLOURS.length)] ?? MEMBER_COLOURS[0];
  write(store, "esker.colour", colour);
  return { name, colour };
}

export function rememberIdentity(store: Store, who: Identity): void {
  write(store, "esker.name", who.name);
  write(store, "esker.colour", who.colour);
}

/** A flag such as "the first-run hint was understood". */
export function flag(store: Store, name: string): boolean {
  return store.getItem(`esker.${name}`) === "1";
}

export function setFlag(store: Store, name: string): void {
  write(store, `esker.${name}`, "1");
}

/** A name that the server may know this device by where it takes one file from each person; it opens nothing. */
export function deviceId(store: Store): string {
  const kept = store.getItem("esker.device") ?? "";
  if (/^[0-9a-f]{32}$/.test(kept)) return kept;
  const made = [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");
  write(store, "esker.device", made);
  return made;
}

/** The key of the list of all terrains of this server, on the device of the machine's owner. */
export function serverKey(store: Store): string {
  return store.getItem("esker.server") ?? "";
}

export function keepServerKey(store: Store, key: string | null): void {
  if (key === null) store.removeItem("esker.server");
  else write(store, "esker.server", key);
}
