/** How finely this device draws: a choice of this browser, not of the terrain. */

import { msg } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { QualityMode } from "../../core/types.ts";
import { DEFAULT_TAU_PX } from "../../generated/contract.ts";
import type { Store } from "./storage.ts";

const KEY = "esker.quality";

/** Screen-error bound of each choice, pixels. The automatic one raises it while frames are slow. */
export const TAU_PX: Readonly<Record<QualityMode, number>> = {
  automatic: DEFAULT_TAU_PX,
  fast: 2 * DEFAULT_TAU_PX,
  balanced: DEFAULT_TAU_PX,
  fine: DEFAULT_TAU_PX / 2,
};

/** The choices in the order of the menu. */
export const QUALITIES: readonly { readonly value: QualityMode; readonly label: string; readonly title: string }[] = [
  { value: "automatic", label: msg("Automatic"), title: msg("As fine as this device can draw smoothly") },
  { value: "fast", label: msg("Fast"), title: msg("Coarser ground, lower resolution while the view moves") },
  { value: "balanced", label: msg("Balanced"), title: msg("Some detail, whatever the frame rate") },
  { value: "fine", label: msg("Fine"), title: msg("The finest ground at full resolution, whatever the frame rate") },
];

export class QualityChoice {
  readonly #mode = signal<QualityMode>("automatic");
  readonly #store: Store;

  /** Takes up what this device chose before. */
  constructor(store: Store) {
    this.#store = store;
    const kept = store.getItem(KEY);
    this.#mode.value = QUALITIES.find((q) => q.value === kept)?.value ?? "automatic";
  }

  get mode(): ReadonlySignal<QualityMode> {
    return this.#mode;
  }

  choose(mode: QualityMode): void {
    this.#mode.value = mode;
    try {
      this.#store.setItem(KEY, mode);
    } catch {
      // A full store: the choice lasts as long as the page.
    }
  }
}
