/** This device's memory of a terrain that is open: the link by which it comes back, and whether that still works. */

import type { ErrorMessage, Role } from "../../generated/contract.ts";
import { terrainPath } from "../server/links.ts";
import { keepRenewing, renewing } from "./share-links.ts";
import { forgetSecret, rememberTerrain, type Store } from "./storage.ts";

export class KeptTerrain {
  readonly #store: Store;
  readonly #id: string;
  #secret: string;

  constructor(store: Store, id: string, secret: string) {
    this.#store = store;
    this.#id = id;
    this.#secret = secret;
  }

  get secret(): string {
    return this.#secret;
  }

  /** The terrain was opened, or has another title. */
  remember(title: string, role: Role): void {
    rememberTerrain(this.#store, { id: this.#id, secret: this.#secret, title, role, opened: Date.now() });
  }

  forget(): void {
    forgetSecret(this.#store, this.#id, this.#secret);
  }

  /** Goes on with a new secret for the same link, in the address bar too. */
  adopt(secret: string): void {
    this.forget();
    this.#secret = secret;
    window.history.replaceState(null, "", terrainPath(this.#id, secret));
  }

  /**
   * The link opens nothing any more. A dead link must not stand among the recent terrains, nor keep a living one from taking
   * its place.
   */
  ended(code: ErrorMessage["code"]): void {
    this.forget();
    // I was replacing my own link when the answer got lost: the new secret is the one that works.
    const next = renewing(this.#store, this.#id);
    keepRenewing(this.#store, this.#id, null);
    if (next !== null && code === "bad_secret") window.location.replace(terrainPath(this.#id, next));
  }
}
