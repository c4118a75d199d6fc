/** The two kinds of grids that are laid by hand: a file that has no place yet, and a layer that is moved. */

import { computed, type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import { firstPlace, type GridPlace, type Point } from "../../core/lattice.ts";
import type { PlacingVisual } from "../../core/types.ts";
import type { SyncDoc } from "../../doc/sync.ts";
import { type ImportReport, LAYER_HEIGHT_MARGIN, type Layer, type Op } from "../../generated/contract.ts";
import type { Placing } from "../../input/tools/placement.ts";
import { visualOf } from "./footprints.ts";
import { SIZE_QUESTION } from "./import-questions.ts";

const IDENTITY: GridPlace = { anchor: [0, 0], rotation_deg: 0, spacing_m: [1, 1], scale: 1, lift_m: 0 };

/** A file that has no place of its own: nobody else sees it before it is placed. */
export class PendingPlacing implements Placing {
  readonly id: string;
  readonly rows: number;
  readonly cols: number;
  readonly place: Signal<GridPlace>;
  /** The coarse picture of it where it lies. */
  readonly visual: ReadonlySignal<PlacingVisual | null>;
  readonly #range: ReadonlySignal<Point>;
  readonly #finish: () => void;
  readonly #cancel: () => void;

  /** `range`: lowest and highest sample in metres, as answered so far. */
  constructor(
    id: string,
    report: ImportReport,
    range: ReadonlySignal<Point>,
    start: GridPlace,
    finish: () => void,
    cancel: () => void,
  ) {
    this.id = id;
    this.rows = report.rows;
    this.cols = report.cols;
    this.#range = range;
    this.place = signal(start);
    this.visual = computed(() => visualOf(this, this.place.value, report.preview));
    this.#finish = finish;
    this.#cancel = cancel;
  }

  get low_m(): number {
    return this.#range.value[0];
  }

  get high_m(): number {
    return this.#range.value[1];
  }

  moveTo(place: GridPlace): null {
    this.place.value = place;
    return null;
  }

  finish(): void {
    this.#finish();
  }

  cancel(): void {
    this.#cancel();
  }
}

/**
 * Where a grid without a place begins: in the middle, of its own size if it has one that fits, else of a share of the
 * terrain; lifted so that its lowest sample lies on the ground when it would stand apart from it.
 */
export function startingPlace(report: ImportReport, sizeM: number, share: number, groundM: number): GridPlace {
  const sized = !report.questions.some((q) => q.id === SIZE_QUESTION);
  const place = firstPlace(report, sizeM, sized ? report.spacing_m : null, report.rotation_deg, share);
  const [low, high] = [report.low_m ?? 0, report.high_m ?? 0];
  const relief = Math.max(high - low, 1);
  const apart = low > groundM + relief || high < groundM - relief;
  const held = Math.max(Math.abs(low), Math.abs(high)) <= LAYER_HEIGHT_MARGIN * sizeM;
  // A terrain that holds nothing yet takes heights as they are, if it can.
  return apart && (groundM !== 0 || !held) ? { ...place, lift_m: Math.round(groundM - low) } : place;
}

/** A layer that is moved: live for everybody, one step of undo a gesture. */
export class LayerPlacing implements Placing {
  readonly id: string;
  readonly rows: number;
  readonly cols: number;
  readonly low_m: number;
  readonly high_m: number;
  readonly place: ReadonlySignal<GridPlace>;
  readonly #submit: (op: Op, gesture: string) => string | null;
  readonly #end: () => void;
  readonly #from: GridPlace;

  constructor(layer: Layer, doc: SyncDoc, submit: (op: Op, gesture: string) => string | null, end: () => void) {
    this.id = layer.id;
    this.rows = layer.facts.rows;
    this.cols = layer.facts.cols;
    this.low_m = layer.facts.low_m;
    this.high_m = layer.facts.high_m;
    this.#submit = submit;
    this.#end = end;
    this.place = computed(() => doc.doc.value?.layers.get(this.id) ?? IDENTITY);
    this.#from = placeOf(layer);
  }

  moveTo(place: GridPlace, gesture: string): string | null {
    const { anchor, rotation_deg, spacing_m, scale, lift_m } = place;
    const fields = { anchor: pair(anchor), rotation_deg, spacing_m: pair(spacing_m), scale, lift_m };
    return this.#submit({ type: "layer.set", layer: this.id, fields }, gesture);
  }

  finish(): void {
    this.#end();
  }

  cancel(): void {
    if (JSON.stringify(placeOf(this.place.peek())) !== JSON.stringify(this.#from))
      this.moveTo(this.#from, `unplace-${this.id}-${Date.now()}`);
    this.#end();
  }
}

/** The place alone. */
export function placeOf({ anchor, rotation_deg, spacing_m, scale, lift_m }: GridPlace): GridPlace {
  return { anchor, rotation_deg, spacing_m, scale, lift_m };
}

const pair = (p: Point): [number, number] => [p[0], p[1]];
