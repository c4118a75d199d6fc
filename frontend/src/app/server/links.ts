/** Building and reading the links that people share (DESIGN 13). */

import { msg, str } from "@lit/localize";
import { route } from "./router.ts";

export interface TerrainLink {
  readonly id: string;
  readonly secret: string;
}

/** Reads what somebody typed or pasted into the Join field. */
export type JoinInput =
  | ({ readonly kind: "link" } & TerrainLink)
  | { readonly kind: "code"; readonly code: string }
  | { readonly kind: "unreadable"; readonly message: string };

/** The path and fragment of a terrain. The secret stands in the fragment, which browsers never send. */
export function terrainPath(id: string, secret: string): string {
  return `/t/${encodeURIComponent(id)}#${encodeURIComponent(secret)}`;
}

/** The wall of a class, for an owner of the terrain that it was made from. */
export function wallPath(id: string, lesson: string, secret: string): string {
  return `/wall/${encodeURIComponent(id)}/${encodeURIComponent(lesson)}#${encodeURIComponent(secret)}`;
}

/** What the picture of a code holds: the page on which a name is asked for, or the terrain. */
export function joinLink(origin: string, code: string): string {
  return `${origin}/join#${encodeURIComponent(code)}`;
}

/** The projector's page of a code. */
export function roomPath(code: string): string {
  return `/room#${encodeURIComponent(code)}`;
}

/**
 * The whole link, to copy or to show as a QR code. `preview`: the token by which programs that unfold links may see the
 * terrain's picture; it opens nothing else.
 */
export function terrainLink(origin: string, id: string, secret: string, preview: string | null = null): string {
  const query = preview === null ? "" : `?p=${encodeURIComponent(preview)}`;
  return origin + terrainPath(id, secret).replace("#", `${query}#`);
}

/** Reads a join code ("K7M 2QX") or a link to a terrain of this server. */
export function readJoinInput(text: string, origin: string): JoinInput {
  const trimmed = text.trim();
  const code = trimmed.replace(/[\s-]/g, "").toUpperCase();
  if (/^[A-Z0-9]{6,9}$/.test(code)) return { kind: "code", code };
  if (trimmed === "") return { kind: "unreadable", message: msg("Type the code or paste the link.") };
  let url: URL;
  try {
    url = new URL(trimmed, origin);
  } catch {
    return { kind: "unreadable", message: msg("This is neither a code nor a link.") };
  }
  const target = route(url);
  if (target.page === "join" && url.origin === origin && target.code !== "") return { kind: "code", code: target.code };
  if (target.page !== "terrain") {
    return { kind: "unreadable", message: msg("This is neither a code nor a link to a terrain.") };
  }
  if (url.origin !== origin) {
    return {
      kind: "unreadable",
      message: msg(str`This link belongs to another server (${url.host}). Open it in its own tab.`),
    };
  }
  if (target.secret === "") {
    return {
      kind: "unreadable",
      message: msg("The part after # is missing. Copy the whole link, including what follows #."),
    };
  }
  return { kind: "link", id: target.id, secret: target.secret };
}
