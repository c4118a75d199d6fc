/** The connection and "saved" state in words that tell the truth. */

import { msg, str } from "@lit/localize";

export type ConnectionState = "connecting" | "online" | "reconnecting" | "closed";

export interface StatusInput {
  readonly connection: ConnectionState;
  /** Why the connection closed, as a sentence. */
  readonly reason: string | null;
  /** Operations that the server has not acknowledged as written to its journal. */
  readonly pending: number;
  /** Whether this link may draw at all. */
  readonly canEdit: boolean;
}

export interface Status {
  readonly tone: "ok" | "busy" | "warn" | "bad";
  readonly icon: string;
  readonly text: string;
  readonly detail: string;
}

const changes = (n: number): string => (n === 1 ? msg("1 change") : msg(str`${n} changes`));

/** "Saved" is said only while connected and with nothing unacknowledged. */
export function status({ connection, reason, pending, canEdit }: StatusInput): Status {
  if (connection === "closed") return closed(reason, pending);
  if (connection === "connecting") {
    return { tone: "busy", icon: "cloud", text: msg("Connecting…"), detail: msg("Opening the terrain.") };
  }
  if (connection === "reconnecting") {
    const kept = msg(str`${changes(pending)} kept on this page until the connection is back. Do not close it.`);
    return {
      tone: "warn",
      icon: "cloud-off",
      text: pending > 0 ? msg(str`Offline · ${changes(pending)} kept`) : msg("Offline"),
      detail: pending > 0 ? kept : msg("Nothing is waiting. Trying to reconnect."),
    };
  }
  if (pending > 0) {
    return {
      tone: "busy",
      icon: "cloud",
      text: msg(str`Saving ${changes(pending)}…`),
      detail: msg("On the way to the server's journal."),
    };
  }
  if (!canEdit)
    return { tone: "ok", icon: "eye", text: msg("Watching"), detail: msg("This link lets you look, not draw.") };
  return { tone: "ok", icon: "cloud-check", text: msg("Saved"), detail: msg("Everything is in the server's journal.") };
}

function closed(reason: string | null, pending: number): Status {
  const lost = pending > 0 ? ` ${msg(str`${changes(pending)} did not reach the server.`)}` : "";
  return {
    tone: "bad",
    icon: "cloud-off",
    text: msg("Closed"),
    detail: `${reason ?? msg("The connection was closed.")}${lost}`,
  };
}
