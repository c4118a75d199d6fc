import { msg, str } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import { region } from "../../core/language.ts";
import { ApiError, api } from "./api.ts";

/** A terrain that was deleted: until when it can be brought back (seconds since 1970), and whether by this link. */
export interface Deleted {
  readonly until: number;
  readonly restorable: boolean;
}

/** The deletion of this page's terrain: what is known of it, and what an owner does about it. */
export class Deletion {
  readonly #id: string;
  readonly #secret: () => string;
  readonly #deleted = signal<Deleted | null>(null);

  constructor(id: string, secret: () => string) {
    this.#id = id;
    this.#secret = secret;
  }

  /** Null while nothing is known of a deletion. */
  get deleted(): ReadonlySignal<Deleted | null> {
    return this.#deleted;
  }

  /** Deletes the terrain for everybody. The server then closes the connection. Throws ApiError. */
  async delete(): Promise<void> {
    const { until } = await api.deleteTerrain(this.#id, this.#secret());
    this.#deleted.value = { until, restorable: true };
  }

  /** Asks the server why the terrain does not open. Resolves to whether it can be brought back by this link. */
  async ask(): Promise<boolean> {
    try {
      await api.about(this.#id, this.#secret());
    } catch (error) {
      if (!(error instanceof ApiError) || error.code !== "deleted") return false;
      const { until, restorable } = error.facts;
      this.#deleted.value = { until: Number(until), restorable: restorable === true };
    }
    return this.#deleted.peek()?.restorable ?? false;
  }

  /** Brings the terrain back as it was. Throws ApiError. */
  async bringBack(): Promise<void> {
    await api.restoreTerrain(this.#id, this.#secret());
    this.#deleted.value = null;
  }
}

/** "until Monday, 30 November": the day after which a terrain is gone. */
export function untilDay(deleted: Deleted, locale: string = region()): string {
  const day = new Date(deleted.until * 1000);
  return msg(str`until ${day.toLocaleDateString(locale, { weekday: "long", day: "numeric", month: "long" })}`);
}
