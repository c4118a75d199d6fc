/** The seats that this device has in classes. A seat's secret opens its copy; the server keeps only its hash. */

import type { Store } from "../../device/storage.ts";

export interface KeptSeat {
  readonly lesson: string;
  readonly title: string;
  readonly secret: string;
  readonly name: string;
  /** Milliseconds since 1970. */
  readonly at: number;
}

const KEY = "esker.seats";
const MOST = 12;

function isSeat(value: unknown): value is KeptSeat {
  if (typeof value !== "object" || value === null) return false;
  const v = value as Record<string, unknown>;
  const texts = ["lesson", "title", "secret", "name"].every((key) => typeof v[key] === "string");
  return texts && typeof v.at === "number";
}

/** The newest first. Damaged entries are left out. */
export function keptSeats(store: Store): KeptSeat[] {
  try {
    const parsed: unknown = JSON.parse(store.getItem(KEY) ?? "[]");
    return Array.isArray(parsed) ? parsed.filter(isSeat).sort((a, b) => b.at - a.at) : [];
  } catch {
    return [];
  }
}

export function seatIn(store: Store, lesson: string): KeptSeat | null {
  return keptSeats(store).find((seat) => seat.lesson === lesson) ?? null;
}

export function keepSeat(store: Store, seat: KeptSeat): void {
  const others = keptSeats(store).filter((each) => each.lesson !== seat.lesson);
  write(store, [seat, ...others].slice(0, MOST));
}

export function forgetSeat(store: Store, lesson: string): void {
  write(
    store,
    keptSeats(store).filter((seat) => seat.lesson !== lesson),
  );
}

function write(store: Store, seats: readonly KeptSeat[]): void {
  try {
    store.setItem(KEY, JSON.stringify(seats));
  } catch {
    // A full store: the copy is on the server, and the list of recent terrains may still have it.
  }
}
