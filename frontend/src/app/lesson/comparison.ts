/**
 * Two copies of a class side by side under one camera. Each side has a renderer of its own on the tiles that the wall holds of
 * its copy, so there is nothing that could be changed. Synthesised detail and gullies are left out: what is seen is what was drawn.
 */

import { computed, effect, type ReadonlySignal, signal } from "@preact/signals-core";
import { Camera } from "../../core/camera/camera.ts";
import { DIFFERENCE_SIDE, differenceGrid, type Heights } from "../../core/difference.ts";
import type { ChannelGrid, Ground } from "../../core/types.ts";
import { type TerrainSettings, TOLERANCES_OFF } from "../../generated/contract.ts";
import { Looking } from "../../input/looking.ts";
import { ChannelStore } from "../../tiles/detail/channels.ts";
import type { TileStore } from "../../tiles/store.ts";
import { TAU_PX } from "../device/quality-choice.ts";
import type { ViewChoices } from "../device/view-choices.ts";
import { Throttle } from "../throttle.ts";
import { landOfTiles } from "../view/eye/land.ts";
import { FrameLoop } from "../view/frame-loop.ts";
import { Graphics } from "../view/graphics.ts";

/** One copy of the two. */
export interface ComparedSide {
  readonly tiles: TileStore;
  readonly settings: ReadonlySignal<TerrainSettings>;
  /** The element that its picture fills. */
  readonly viewport: HTMLElement;
}

export type ComparedOverlay = "none" | "contours" | "difference";

/** The difference follows the ground so often a second. */
const HERTZ = 4;
/** Red and blue are full where the copies are this share of their relief apart. */
const FULL_SHARE = 0.1;
/** They are never full for less, metres. */
const LEAST_FULL_M = 1;

/** What lies between the two grounds. */
interface Difference {
  /** Metres apart from which on a colour is full. */
  readonly fullM: number;
  /** For each side, where it is higher (above a half) and lower than the other. */
  readonly grids: readonly [ChannelGrid, ChannelGrid];
}

export class Comparison {
  readonly camera: Camera;
  readonly overlay = signal<ComparedOverlay>("none");
  /** Why there is no 3D view, as a sentence; null while both sides have one. */
  readonly reason: ReadonlySignal<string | null>;
  readonly difference: ReadonlySignal<Difference | null>;
  readonly #sides: readonly [ComparedSide, ComparedSide];
  /** Settings of each side without what is made up. */
  readonly #settings: readonly ReadonlySignal<TerrainSettings>[];
  readonly #view: ViewChoices;
  readonly #graphics: readonly [Graphics, Graphics];
  readonly #channels: ChannelStore;
  readonly #loop: FrameLoop;
  readonly #looking: Looking;
  readonly #calm = window.matchMedia("(prefers-reduced-motion: reduce)");
  readonly #difference = signal<Difference | null>(null);
  readonly #stops: (() => void)[] = [];
  /** The eye stays above both grounds. */
  readonly #floor: Ground;

  constructor(sides: readonly [ComparedSide, ComparedSide], view: ViewChoices) {
    const [left, right] = sides;
    this.#sides = sides;
    this.#settings = sides.map(({ settings }) => computed(() => ({ ...settings.value, detail: 0, erosion: 0 })));
    this.#view = view;
    this.camera = new Camera(left.tiles.sizeM);
    this.camera.calm = this.#calm.matches;
    this.camera.exaggerate(view.exaggeration);
    this.#channels = new ChannelStore(left.tiles.sizeM);
    this.#loop = new FrameLoop((dt, time) => this.#draw(dt, time));
    const graphics = ({ viewport }: ComparedSide): Graphics =>
      new Graphics({ viewport, camera: this.camera, say: () => {}, onOpened: () => this.#loop.invalidate() });
    this.#graphics = [graphics(left), graphics(right)];
    this.reason = computed(() => this.#graphics[0].reason.value ?? this.#graphics[1].reason.value);
    this.difference = this.#difference;
    this.#floor = {
      ...left.tiles.ground,
      heightAt: (x, y) => Math.max(left.tiles.ground.heightAt(x, y), right.tiles.ground.heightAt(x, y)),
    };
    const looked = sides.map(({ viewport, tiles }) => ({ element: viewport, ground: () => tiles.ground }));
    this.#looking = new Looking(this.camera, looked);
    this.camera.home(0);
    this.#watch();
  }

  /** Opens both pictures and starts drawing. */
  async start(): Promise<void> {
    this.#loop.start();
    await Promise.all(this.#graphics.map((graphics) => graphics.open()));
  }

  /** Frees both graphics devices with all that lies on them. */
  dispose(): void {
    this.#loop.stop();
    this.#looking.dispose();
    for (const stop of this.#stops) stop();
    for (const graphics of this.#graphics) graphics.dispose();
  }

  #watch(): void {
    const measure = (): void => {
      this.#difference.value = this.overlay.peek() === "difference" ? apart(this.#sides) : null;
    };
    const follow = new Throttle(HERTZ, measure);
    this.#stops.push(
      effect(() => {
        this.overlay.value;
        measure();
      }),
      effect(() => {
        for (const { tiles } of this.#sides) tiles.revision.value;
        if (this.overlay.peek() === "difference") follow.request();
      }),
      () => follow.stop(),
      effect(() => {
        const { tiles } = this.#sides[0];
        tiles.revision.value;
        const land = landOfTiles(tiles);
        if (land !== null) this.camera.stand(land);
      }),
      effect(() => {
        for (const { tiles, settings } of this.#sides) void [tiles.revision.value, settings.value];
        void [this.camera.state.value, this.overlay.value, this.#difference.value];
        this.#loop.invalidate();
      }),
      // A map cannot turn: both sides are maps, or neither is.
      effect(() => {
        if (this.reason.value !== null && this.camera.state.value.mode !== "map") this.camera.setMode("map");
      }),
    );
    const [{ viewport }] = this.#sides;
    const observer = new ResizeObserver(() => this.#resize());
    observer.observe(viewport);
    this.#stops.push(() => observer.disconnect());
    this.#resize();
  }

  #resize(): void {
    const [{ viewport }] = this.#sides;
    const ratio = Math.min(window.devicePixelRatio, 2);
    this.camera.resize(viewport.clientWidth * ratio, viewport.clientHeight * ratio);
  }

  #draw(dtS: number, timeS: number): boolean {
    let again = this.camera.update(dtS, this.#floor);
    const overlay = this.overlay.peek();
    for (const [k, { tiles }] of this.#sides.entries()) {
      const { renderer } = this.#graphics[k as 0 | 1];
      if (renderer === null) continue;
      const stats = renderer.render({
        camera: this.camera.state.peek(),
        tiles,
        channels: this.#channels,
        settings: this.#settings[k]!.peek(),
        strokes: [],
        ghost: null,
        cursors: [],
        tauPx: TAU_PX.automatic,
        surface: this.#view.surface,
        time: this.#calm.matches ? 0 : timeS,
        overlay: overlay === "difference" && this.#difference.peek() === null ? "none" : overlay,
        influence: this.#difference.peek()?.grids[k as 0 | 1] ?? null,
        showStrokes: false,
        contourM: this.#view.contourM,
        lineScale: this.#view.lineScale,
      });
      again ||= stats.busy;
    }
    return again;
  }
}

/** How far the grounds of two sides are apart; null before both have come. */
export function apart(sides: readonly [Pick<ComparedSide, "tiles">, Pick<ComparedSide, "tiles">]): Difference | null {
  const [left, right] = sides.map(({ tiles }) => heightsOf(tiles));
  if (!left || !right) return null;
  const { sizeM } = sides[0].tiles;
  const fullM = Math.max(LEAST_FULL_M, FULL_SHARE * Math.max(relief(left), relief(right)));
  const grid = (k: 0 | 1, other: Heights): ChannelGrid => {
    const ground = sides[k].tiles.freeze();
    return differenceGrid((x, y) => ground.heightAt(x, y), other, sizeM, fullM / TOLERANCES_OFF);
  };
  return { fullM, grids: [grid(0, right), grid(1, left)] };
}

function heightsOf(tiles: TileStore): Heights | null {
  if (tiles.tile(0, 0, 0) === undefined) return null;
  const ground = tiles.freeze();
  const side = DIFFERENCE_SIDE;
  const step = tiles.sizeM / (side - 1);
  const data = Float32Array.from({ length: side * side }, (_, i) =>
    ground.heightAt((i % side) * step, Math.floor(i / side) * step),
  );
  return { side, data };
}

function relief({ data }: Heights): number {
  return data.reduce((high, h) => Math.max(high, h)) - data.reduce((low, h) => Math.min(low, h));
}
