/**
 * The water tool: a drop's way and the watershed of a place, rain, floods and the sea. It changes no document but the sea's level,
 * so who only looks may use all of it; the place is the ruler's one point (input/tools/ruler.ts).
 */

import { computed, effect, type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import { areaBelow } from "../../../core/measure/flooded.ts";
import { isImpossible } from "../../../core/measure/places.ts";
import { type Profile, profileAt, profileOf } from "../../../core/measure/profile.ts";
import type { ChannelGrid, DropsVisual, FloodVisual, FootprintVisual, Ground, Vec3 } from "../../../core/types.ts";
import type { Ruler } from "../../../input/tools/ruler.ts";
import { type Gauge, gaugeAt, type Rainfall } from "../../../tiles/water/gauge.ts";
import { FoundWater, type WaterField, type WaterSource } from "./field.ts";
import {
  type Amount,
  type Flood,
  floodOf,
  type Shed,
  sampleAt,
  shedLines,
  shedOf,
  type Way,
  wayFrom,
  wayLine,
} from "./findings.ts";
import type { OtherDrop } from "./others.ts";
import { Shower } from "./shower.ts";

/** What the tool looks at. */
export type WaterView = "drop" | "rain" | "flood" | "sea";

export interface WaterToolOptions extends Omit<WaterSource, "wanted"> {
  readonly ruler: Ruler;
  /** The ground as it is drawn, for lines and drops. */
  readonly shown: () => Ground;
  /** The places from which others follow water. */
  readonly others: () => readonly OtherDrop[];
  /** Whether things may move by themselves. */
  readonly calm: () => boolean;
}

/** Samples of a drop's section lie so many cells apart. */
const SECTION_CELLS = 0.5;

export class WaterTool {
  readonly ruler: Ruler;
  readonly view: Signal<WaterView> = signal<WaterView>("drop");
  readonly rainfall: Signal<Rainfall> = signal<Rainfall>({ mmPerHour: 20, hours: 2 });
  readonly amount: Signal<Amount> = signal<Amount>({ by: "rain", mm: 50, m3: 1e6 });
  /** How many times heights are drawn larger in the section; 0 fills it. */
  readonly exaggeration: Signal<number> = signal(0);
  readonly marker: Signal<number | null> = signal(null);
  readonly isOpen: ReadonlySignal<boolean>;
  /** My place on the ground, for others to see; null without one. */
  readonly place: ReadonlySignal<Vec3 | null>;
  readonly found: ReadonlySignal<WaterField | null>;
  /** All are null while there is no place, or no water was found yet. */
  readonly way: ReadonlySignal<Way | null>;
  readonly profile: ReadonlySignal<Profile | null>;
  /** How high water stands along the section, where it stands above the ground; null where it does nowhere. */
  readonly beforeHeights: ReadonlySignal<Float64Array | null>;
  readonly shed: ReadonlySignal<Shed | null>;
  readonly gauge: ReadonlySignal<Gauge | null>;
  readonly flood: ReadonlySignal<Flood | null>;
  /** What the sea covers, square metres and its share of the map; null without a sea. */
  readonly sea: ReadonlySignal<{ readonly areaM2: number; readonly share: number } | null>;
  /** How deep water stands at the place, metres. */
  readonly depthM: ReadonlySignal<number | null>;
  readonly lines: ReadonlySignal<readonly FootprintVisual[]>;
  /** The watershed, to be tinted. */
  readonly tint: ReadonlySignal<ChannelGrid | null>;
  readonly floodVisual: ReadonlySignal<FloodVisual | null>;
  readonly marked: ReadonlySignal<Vec3 | null>;
  readonly shower: Shower;
  readonly #o: WaterToolOptions;
  readonly #water: FoundWater;
  readonly #index: ReadonlySignal<number | null>;
  readonly #stops: (() => void)[] = [];

  constructor(options: WaterToolOptions) {
    this.#o = options;
    this.ruler = options.ruler;
    this.isOpen = computed(() => options.ruler.kind.value === "water");
    this.place = computed(() => {
      const point = this.isOpen.value ? this.ruler.points.value.at(-1) : undefined;
      return point === undefined ? null : [...point, options.shown().heightAt(...point)];
    });
    this.#water = new FoundWater({ ...options, wanted: () => this.isOpen.value || options.others().length > 0 });
    this.found = this.#water.found;
    this.#index = computed(() => {
      const [field, point] = [this.found.value, this.ruler.points.value.at(-1)];
      return this.isOpen.value && field !== null && point !== undefined ? sampleAt(field, point) : null;
    });
    const at = <T>(make: (field: WaterField, index: number) => T, ...views: WaterView[]): ReadonlySignal<T | null> =>
      computed(() => {
        const index = this.#index.value;
        return index !== null && views.includes(this.view.value) ? make(this.found.value!, index) : null;
      });
    this.way = at(wayFrom, "drop", "flood");
    this.shed = at(shedOf, "drop", "rain");
    this.flood = at((field, index) => floodOf(field, index, this.amount.value), "flood");
    this.gauge = at(
      (field) => gaugeAt(field.water, this.shed.value!.inside, field.cellM, this.rainfall.value),
      "drop",
      "rain",
    );
    this.profile = computed(() => this.#profile());
    this.beforeHeights = computed(() => this.#standing());
    this.sea = computed(() => this.#sea());
    this.depthM = computed(() => {
      const [field, index] = [this.found.value, this.#index.value];
      return index === null || field === null
        ? null
        : (field.water.filled[index]! - field.water.z[index]!) * field.stepM;
    });
    this.lines = computed(() => this.#lines());
    this.tint = computed(() => tintOf(this.shed.value, this.found.value));
    this.floodVisual = computed(() => {
      const [flood, field] = [this.flood.value, this.found.value];
      return flood === null || field === null ? null : { heights: field.heights, lakes: flood.lakes };
    });
    this.marked = computed(() => {
      const [profile, along] = [this.profile.value, this.marker.value];
      if (profile === null || along === null) return null;
      const { x, y, m } = profileAt(profile, along);
      return [x, y, m];
    });
    this.shower = new Shower(options.sizeM, options.shown, options.calm);
    this.#stops.push(
      effect(() => {
        const raining = this.isOpen.value && this.view.value === "rain";
        this.shower.follow(raining ? this.found.value : null, this.ruler.points.value.at(-1) ?? null);
      }),
    );
  }

  /** Lets drops run on; what is to be drawn of them, null while it does not rain. */
  drops(seconds: number): DropsVisual | null {
    return this.shower.step(seconds);
  }

  dispose(): void {
    for (const stop of this.#stops) stop();
    this.#water.dispose();
  }

  #profile(): Profile | null {
    const [way, field] = [this.way.value, this.found.value];
    if (way === null || field === null || this.view.value !== "drop") return null;
    const ground = this.#o.shown();
    const found = profileOf(way.points, (x, y) => ground.heightAt(x, y, field.cellM), SECTION_CELLS * field.cellM);
    // Its points are the samples that the drop passes: no corners that anybody set.
    return isImpossible(found) ? null : { ...found, corners: [] };
  }

  #standing(): Float64Array | null {
    const [profile, field] = [this.profile.value, this.found.value];
    if (profile === null || field === null) return null;
    const { filled, z } = field.water;
    let stands = false;
    const heights = profile.height.map((ground, k) => {
      const i = sampleAt(field, [profile.x[k]!, profile.y[k]!]);
      if (filled[i] === z[i]) return ground;
      stands = true;
      return Math.max(ground, filled[i]! * field.stepM);
    });
    return stands ? heights : null;
  }

  #sea(): { readonly areaM2: number; readonly share: number } | null {
    const [field, level] = [this.found.value, this.#o.seaM()];
    if (field === null || level === null || !this.isOpen.value) return null;
    const areaM2 = areaBelow(field.heights, field.side, field.cellM, level);
    return { areaM2, share: areaM2 / this.#o.sizeM ** 2 };
  }

  #lines(): readonly FootprintVisual[] {
    const [way, shed, field] = [this.way.value, this.shed.value, this.found.value];
    if (field === null) return [];
    const ground = this.#o.shown();
    const others = this.#o.others().flatMap(({ place, colour }, k) => {
      const line = wayLine(wayFrom(field, sampleAt(field, place)), ground, colour);
      return line.map((visual) => ({ ...visual, id: `water-way-${k}` }));
    });
    return [
      ...(shed === null ? [] : shedLines(shed, field, ground)),
      ...others,
      ...(way === null ? [] : wayLine(way, ground)),
    ];
  }
}

/** A watershed as shares 0..1 of the samples; null where it is next to nothing. */
function tintOf(shed: Shed | null, field: WaterField | null): ChannelGrid | null {
  if (shed === null || field === null || shed.samples < 2) return null;
  return { side: field.side, values: Float32Array.from(shed.inside) };
}
