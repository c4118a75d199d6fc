/**
 * The ground as it was when it last lay still. What asks for its detail at thousands of places follows this one: asked with
 * every tile that comes, the page would have no time for anything else.
 */

import { effect, type ReadonlySignal, signal } from "@preact/signals-core";
import type { Ground } from "../../core/types.ts";

/** Ground lies still when nothing of it has changed for so long. */
const STILL_MS = 300;

export class StillGround {
  readonly #ground = signal<Ground | null>(null);
  readonly #stop: () => void;
  #timer: ReturnType<typeof setTimeout> | undefined;

  /** `revision` changes with the ground, which `freeze` gives as it is. */
  constructor(revision: ReadonlySignal<unknown>, freeze: () => Ground) {
    this.#stop = effect(() => {
      revision.value;
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => {
        this.#ground.value = freeze();
      }, STILL_MS);
    });
  }

  /** Null before the ground has lain still for the first time. */
  get ground(): ReadonlySignal<Ground | null> {
    return this.#ground;
  }

  stop(): void {
    this.#stop();
    clearTimeout(this.#timer);
  }
}
