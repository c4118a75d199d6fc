/** Lines of a terrain that was opened are not shown until somebody wants them: the land comes first. */

import { effect, type ReadonlySignal, signal } from "@preact/signals-core";

/** Signs that somebody wants to see the strokes. */
export interface Hands {
  readonly tool: ReadonlySignal<string>;
  readonly selection: ReadonlySignal<string | null>;
  readonly hovered: ReadonlySignal<string | null>;
}

export class QuietStrokes {
  readonly #quiet = signal(false);
  #stop: (() => void) | null = null;

  /** True while finished strokes that nobody points at are not drawn at all. */
  get quiet(): ReadonlySignal<boolean> {
    return this.#quiet;
  }

  /** From now on, until a stroke is pointed at or selected, or a tool is taken in hand. */
  begin(hands: Hands): void {
    this.stop();
    this.#quiet.value = true;
    const tool = hands.tool.peek();
    this.#stop = effect(() => {
      if (hands.tool.value !== tool || hands.selection.value !== null || hands.hovered.value !== null) this.end();
    });
  }

  /** The strokes are wanted. */
  end(): void {
    this.#quiet.value = false;
    this.stop();
  }

  stop(): void {
    const stop = this.#stop;
    this.#stop = null;
    if (stop !== null) queueMicrotask(stop);
  }
}
