/** What pages ask of the server about classes (docs/protocol.md). */

import { json, type OpenedTerrain, request } from "../api.ts";

/** A class as its teacher's page lists it. Times are seconds since 1970. */
export interface ClassInfo {
  readonly id: string;
  readonly terrain: string;
  readonly title: string;
  readonly created: number;
  readonly together: number;
  readonly places: number;
  readonly ended: number | null;
  readonly code: string | null;
  readonly expires_s: number;
  readonly pupils: number;
  readonly copies: number;
}

/** Where this device sits. */
export interface SeatInfo {
  readonly id: string;
  readonly class: string;
  readonly title: string;
  readonly number: number;
  readonly name: string;
}

export interface Collecting {
  readonly id: string;
  readonly stage: "waiting" | "collecting" | "done" | "failed" | "cancelled";
  readonly share: number;
  readonly text: string;
  readonly bytes: number;
}

export interface NewClass {
  readonly title?: string;
  readonly together?: number;
  readonly places?: number;
  readonly at?: number;
}

/** By a terrain's owner: its classes. */
export const classApi = {
  make: (terrain: string, secret: string, body: NewClass): Promise<ClassInfo> =>
    json("POST", `/api/terrains/${terrain}/classes`, secret, body),

  list: (terrain: string, secret: string): Promise<ClassInfo[]> =>
    json("GET", `/api/terrains/${terrain}/classes`, secret),

  sit: (door: string, body: { code: string; seat: string; name: string; number?: number }): Promise<SeatInfo> =>
    json("POST", `/api/classes/${door}/seats`, undefined, body),

  seat: (secret: string): Promise<SeatInfo> => json("GET", "/api/seat", secret),
};

/** One class, by its teacher. */
export class ClassOrders {
  readonly #path: string;
  readonly #secret: string;

  constructor(terrain: string, secret: string, lesson: string) {
    this.#path = `/api/terrains/${terrain}/classes/${lesson}`;
    this.#secret = secret;
  }

  #post<T>(what: string, body: unknown = {}): Promise<T> {
    return json("POST", `${this.#path}/${what}`, this.#secret, body);
  }

  door(open: boolean): Promise<ClassInfo> {
    return this.#post("door", { open });
  }

  freeze(frozen: boolean, numbers?: readonly number[]): Promise<unknown> {
    return this.#post("freeze", numbers ? { frozen, numbers } : { frozen });
  }

  restart(numbers: readonly number[]): Promise<{ readonly changed: number }> {
    return this.#post("restart", { numbers });
  }

  push(): Promise<{ readonly changed: number }> {
    return this.#post("push");
  }

  show(number: number | null): Promise<unknown> {
    return this.#post("show", { number });
  }

  open(number: number): Promise<OpenedTerrain> {
    return this.#post("open", { number });
  }

  together(numbers: readonly number[]): Promise<OpenedTerrain> {
    return this.#post("together", { numbers });
  }

  bringBack(): Promise<ClassInfo> {
    return this.#post("restore");
  }

  async delete(atOnce: boolean): Promise<void> {
    await request("DELETE", `${this.#path}${atOnce ? "?at_once=true" : ""}`, this.#secret);
  }

  collect(): Promise<Collecting> {
    return this.#post("collections");
  }

  collected(job: string): Promise<Collecting> {
    return json("GET", `${this.#path}/collections/${job}`, this.#secret);
  }

  async file(job: string): Promise<Blob> {
    return (await request("GET", `${this.#path}/collections/${job}/file`, this.#secret)).blob();
  }
}
