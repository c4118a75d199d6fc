/** Numbers and times in words. */

import { msg, str } from "@lit/localize";
import { fixed, region } from "../../core/language.ts";

/** How long ago, in words. */
export function ago(ms: number): string {
  const minutes = Math.round(ms / 60_000);
  if (minutes < 2) return msg("just now");
  if (minutes < 60) return msg(str`${minutes} minutes ago`);
  const hours = Math.round(minutes / 60);
  if (hours < 24) return hours === 1 ? msg("an hour ago") : msg(str`${hours} hours ago`);
  const days = Math.round(hours / 24);
  if (days < 14) return days === 1 ? msg("yesterday") : msg(str`${days} days ago`);
  return new Date(Date.now() - ms).toLocaleDateString(region(), { day: "numeric", month: "short", year: "numeric" });
}

/** A length in metres, with as many digits as help: "8.4 m", "312 m", "4.1 km". */
export function metres(m: number): string {
  const a = Math.abs(m);
  if (a >= 1000) return `${fixed(m / 1000, a >= 10_000 ? 0 : 1)} km`;
  return `${fixed(m, a < 10 ? 1 : 0)} m`;
}

/** A signed height: always metres, one digit below 100 m. */
export function height(m: number): string {
  return `${fixed(m, Math.abs(m) < 100 ? 1 : 0)} m`;
}

const POINTS = [
  msg("north"),
  msg("north-east"),
  msg("east"),
  msg("south-east"),
  msg("south"),
  msg("south-west"),
  msg("west"),
  msg("north-west"),
] as const;

/** The compass point of an azimuth in degrees, clockwise from north. */
export function compass(azimuthDeg: number): string {
  return POINTS[Math.round((((azimuthDeg % 360) + 360) % 360) / 45) % 8] ?? POINTS[0];
}

/** The largest round number (1, 2, 5 times a power of ten) that is not above `x`; 0 for no positive number. */
export function roundBelow(x: number): number {
  if (!(x > 0) || !Number.isFinite(x)) return 0;
  const power = 10 ** Math.floor(Math.log10(x));
  const lead = x / power;
  return (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * power;
}

/** The initials of a name for an avatar. */
export function initials(name: string): string {
  const parts = name.trim().split(/\s+/).filter(Boolean);
  if (parts.length === 0) return "";
  const first = [...parts[0]!][0] ?? "";
  const last = parts.length > 1 ? ([...parts[parts.length - 1]!][0] ?? "") : "";
  return (first + last).toUpperCase();
}

/** A size of a file: "840 kB", "3.3 MB". */
export function bytes(n: number): string {
  if (n < 1000) return msg(str`${n} bytes`);
  if (n < 1e6) return `${Math.round(n / 1000)} kB`;
  return `${fixed(n / 1e6, n < 1e7 ? 1 : 0)} MB`;
}
