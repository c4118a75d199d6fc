/**
 * What the ruler measures, anew whenever its points or the ground change. All numbers come from the exact samples of tiles, without
 * the synthesised detail: at each place those of the finest tile that this page holds.
 */

import { msg } from "@lit/localize";
import { computed, effect, type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import { type AreaFigures, measureArea } from "../../../core/measure/area.ts";
import { type Impossible, isImpossible, type Place } from "../../../core/measure/places.ts";
import { type Profile, profileAt, profileOf } from "../../../core/measure/profile.ts";
import type { FootprintVisual, Rgba, Vec3 } from "../../../core/types.ts";
import { TILE_CELLS } from "../../../generated/contract.ts";
import { drape } from "../../../input/picking.ts";
import type { Ruler } from "../../../input/tools/ruler.ts";
import type { TileGround } from "../../../tiles/ground.ts";
import type { TileStore } from "../../../tiles/store.ts";
import { Throttle } from "../../throttle.ts";

/** A ground that somebody compares with. */
export interface Moment {
  readonly ground: TileGround;
  /** What it is: "since measuring began". */
  readonly words: string;
}

const COLOUR: Rgba = [1, 0.82, 0.4, 1];
/** Measured so often a second while the ground moves. */
const LINE_HERTZ = 12;
const AREA_HERTZ = 3;
/** Points of the shown line lie at most this share of the domain apart. */
const SHOWN_STEP = 1 / 256;

export const SINCE_BEGAN = msg("since measuring began");

export class Instruments {
  readonly ruler: Ruler;
  /** The level against which volumes are measured, metres. */
  readonly levelM: Signal<number> = signal(0);
  /** How many times heights are drawn larger in the section; 0 fills it. */
  readonly exaggeration: Signal<number> = signal(0);
  /** Metres along the line under a pointer on the section. */
  readonly marker: Signal<number | null> = signal(null);
  readonly before: ReadonlySignal<Moment | null>;
  /** Null while no line is measured. */
  readonly profile: ReadonlySignal<Profile | Impossible | null>;
  /** Heights of the other moment at the profile's samples; null where they are the same. */
  readonly beforeHeights: ReadonlySignal<Float64Array | null>;
  /** Heights that a task asks for at the profile's samples; null where it asks for none. */
  readonly askedHeights: ReadonlySignal<Float64Array | null>;
  readonly area: ReadonlySignal<AreaFigures | Impossible | null>;
  /** The line on the ground. */
  readonly lines: ReadonlySignal<readonly FootprintVisual[]>;
  /** The place under the pointer on the section, on the ground. */
  readonly marked: ReadonlySignal<Vec3 | null>;
  readonly #tiles: TileStore;
  readonly #before = signal<Moment | null>(null);
  readonly #line: Signal<TileGround>;
  readonly #ground: Signal<TileGround>;
  readonly #stops: (() => void)[] = [];

  /** `asked`: the height that a task asks for at a place. */
  constructor(
    ruler: Ruler,
    tiles: TileStore,
    asked: ReadonlySignal<((x: number, y: number) => number | null) | null> = signal(null),
  ) {
    this.ruler = ruler;
    this.#tiles = tiles;
    this.#line = signal(tiles.freeze());
    this.#ground = signal(tiles.freeze());
    this.before = this.#before;
    this.profile = computed(() => (ruler.kind.value === "line" ? this.#profile() : null));
    this.beforeHeights = computed(() => this.#beforeHeights());
    this.askedHeights = computed(() => this.#askedHeights(asked.value));
    this.area = computed(() => (ruler.kind.value === "area" ? this.#area() : null));
    this.lines = computed(() => this.#lines());
    this.marked = computed(() => this.#marked());
    this.#follow();
  }

  /** Compares with the ground that is shown now. */
  keep(words: string): void {
    this.#before.value = { ground: this.#tiles.freeze(), words };
  }

  dispose(): void {
    for (const stop of this.#stops) stop();
  }

  /** The ground is looked at again when it changes, while something is measured; no more often than one can read. */
  #follow(): void {
    const look = (into: Signal<TileGround>) => (): void => {
      into.value = this.#tiles.freeze();
    };
    const [line, area] = [new Throttle(LINE_HERTZ, look(this.#line)), new Throttle(AREA_HERTZ, look(this.#ground))];
    this.#stops.push(
      effect(() => {
        this.#tiles.revision.value;
        if (this.ruler.kind.value === null) return;
        line.request();
        if (this.ruler.kind.value === "area") area.request();
      }),
      effect(() => {
        if (this.ruler.kind.value === null) this.#before.value = null;
        else if (this.#before.peek() === null && this.#tiles.size > 0) this.keep(SINCE_BEGAN);
      }),
      () => line.stop(),
      () => area.stop(),
    );
  }

  #profile(): Profile | Impossible {
    const ground = this.#line.value;
    const points = this.ruler.points.value;
    const finest = Math.max(this.#tiles.solved, ...points.map(([x, y]) => ground.levelAt(x, y)));
    return profileOf(points, (x, y) => ground.heightAt(x, y), ground.sizeM / (TILE_CELLS * 2 ** finest));
  }

  #beforeHeights(): Float64Array | null {
    const [profile, before] = [this.profile.value, this.#before.value];
    if (profile === null || isImpossible(profile) || before === null) return null;
    const heights = Float64Array.from(profile.x, (x, i) => before.ground.heightAt(x, profile.y[i]!));
    return heights.some((z, i) => z !== profile.height[i]) ? heights : null;
  }

  #askedHeights(asked: ((x: number, y: number) => number | null) | null): Float64Array | null {
    const profile = this.profile.value;
    if (profile === null || isImpossible(profile) || asked === null) return null;
    const heights = Array.from(profile.x, (x, i) => asked(x, profile.y[i]!));
    return heights.includes(null) ? null : Float64Array.from(heights as number[]);
  }

  #area(): AreaFigures | Impossible {
    const ground = this.#ground.value;
    const before = this.#before.value?.ground;
    return measureArea(this.ruler.points.value, (x, y) => ground.heightAt(x, y), {
      levelM: this.levelM.value,
      before: before ? (x, y) => before.heightAt(x, y) : null,
      sizeM: ground.sizeM,
      finestCells: TILE_CELLS * 2 ** this.#tiles.solved,
    });
  }

  #lines(): readonly FootprintVisual[] {
    const points = this.ruler.points.value;
    const kind = this.ruler.kind.value;
    if (kind === null || points.length < 2) return [];
    const ground = this.#line.value;
    const ring: readonly Place[] = kind === "area" && points.length > 2 ? [...points, points[0]!] : points;
    const flat = ring.flatMap(([x, y]) => [x, y, 0]);
    const line = drape(flat, ground.sizeM * SHOWN_STEP, (x, y) => ground.heightAt(x, y));
    return [{ id: "measured", points: new Float32Array(line), colour: COLOUR, strong: true }];
  }

  #marked(): Vec3 | null {
    const [profile, at] = [this.profile.value, this.marker.value];
    if (profile === null || isImpossible(profile) || at === null) return null;
    const { x, y, m } = profileAt(profile, at);
    return [x, y, m];
  }
}
