/**
 * How this device shows a terrain: choices of whoever looks, never of the document. They are remembered by the device, and the same for all
 * terrains.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import { MOST_EXAGGERATION } from "../../core/camera/lens.ts";
import type { SurfaceChoice } from "../../core/types.ts";
import { CONTOUR_STEPS } from "../view/instruments/contour-steps.ts";
import type { Store } from "./storage.ts";

const KEY = "esker.view";
/** Contours and their heights are this much larger for people who sit far away; letters are larger by the styles. */
const PROJECTOR_LINES = 1.7;

interface Kept {
  readonly exaggeration: number;
  readonly contourM: number;
  readonly projector: boolean;
  /** Stones, blades and joints close by; null: where the adapter draws them easily. */
  readonly materials: boolean | null;
  readonly shade: boolean;
  /** Trees, rocks and tufts; null: where the adapter draws them easily. */
  readonly instances: boolean | null;
  /** Lines of finished strokes are thin and faint until somebody draws or points at them. */
  readonly quietLines: boolean;
}

const PLAIN: Kept = {
  exaggeration: 1,
  contourM: 0,
  projector: false,
  materials: null,
  shade: true,
  instances: null,
  quietLines: true,
};

export class ViewChoices {
  readonly #store: Store;
  readonly #kept;

  constructor(store: Store) {
    this.#store = store;
    this.#kept = signal<Kept>(read(store));
  }

  get choices(): ReadonlySignal<Kept> {
    return this.#kept;
  }

  /** How many times heights are seen larger than they are, 1 to MOST_EXAGGERATION. */
  get exaggeration(): number {
    return this.#kept.value.exaggeration;
  }

  /** Height between contours, metres; 0: what suits the relief. */
  get contourM(): number {
    return this.#kept.value.contourM;
  }

  /** Large letters and thick lines, for a room. */
  get projector(): boolean {
    return this.#kept.value.projector;
  }

  get surface(): SurfaceChoice {
    const { materials, shade, instances } = this.#kept.value;
    return { materials, shade, instances };
  }

  get quietLines(): boolean {
    return this.#kept.value.quietLines;
  }

  get lineScale(): number {
    return this.projector ? PROJECTOR_LINES : 1;
  }

  choose(change: Partial<Kept>): void {
    this.#kept.value = checked({ ...this.#kept.peek(), ...change });
    try {
      this.#store.setItem(KEY, JSON.stringify(this.#kept.peek()));
    } catch {
      // A full store loses a convenience only.
    }
  }
}

function read(store: Store): Kept {
  try {
    const found: unknown = JSON.parse(store.getItem(KEY) ?? "{}");
    return checked(typeof found === "object" && found !== null ? found : {});
  } catch {
    return PLAIN;
  }
}

/** What was kept, or typed, brought into its bounds. */
function checked(found: Partial<Record<keyof Kept, unknown>>): Kept {
  const times = Number(found.exaggeration);
  const step = CONTOUR_STEPS.find((s) => s === found.contourM);
  return {
    exaggeration: Number.isFinite(times) ? Math.min(MOST_EXAGGERATION, Math.max(1, times)) : PLAIN.exaggeration,
    contourM: step ?? PLAIN.contourM,
    projector: found.projector === true,
    materials: typeof found.materials === "boolean" ? found.materials : PLAIN.materials,
    shade: found.shade !== false,
    instances: typeof found.instances === "boolean" ? found.instances : PLAIN.instances,
    quietLines: found.quietLines !== false,
  };
}

/** Letters of the page for people who sit far away, or as they are (`projector` in ui/styles/theme.css). */
export function largeLetters(on: boolean): void {
  document.documentElement.classList.toggle("projector", on);
}
