/** The task of an open terrain as this page shows it: its target, how far the ground is from that, lines on the ground, the score. */

import { msg } from "@lit/localize";
import { computed, effect, type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import { type ContourLine, contourLines } from "../../../core/contour-lines.ts";
import { differenceGrid, type Heights, targetAt } from "../../../core/difference.ts";
import type { ChannelGrid, FootprintVisual, Rgba, Scene } from "../../../core/types.ts";
import type { Doc } from "../../../doc/document.ts";
import { RING_SHARE, type Target, type Task } from "../../../generated/contract.ts";
import { drape } from "../../../input/picking.ts";
import type { TileGround } from "../../../tiles/ground.ts";
import type { TileStore } from "../../../tiles/store.ts";
import { Throttle } from "../../throttle.ts";
import { decode } from "./target.ts";
import type { Goal } from "./words.ts";

/** Differences and lines follow the ground so often a second. */
const HERTZ = 8;
const CONTOUR: Rgba = [0.36, 0.18, 0.05, 0.95];
const MARK: Rgba = [1, 0.82, 0.4, 1];
const STEP = 1 / 128;
/** A place so near to the line of a profile, as a share of the domain, is on it. */
const ON_LINE = 1 / 512;

export interface TaskHost {
  readonly doc: ReadonlySignal<Doc | null>;
  readonly tiles: TileStore;
  readonly overlay: Signal<Scene["overlay"]>;
  /** Whether this page leads, and so sees every difference. */
  readonly conducts: () => boolean;
}

/** The target of a goal, where it has one. */
export function targetOf(goal: Goal | null | undefined): Target | null {
  return goal?.type === "terrain" || goal?.type === "contours" ? goal.target : null;
}

export class TaskView {
  readonly task: ReadonlySignal<Task | null>;
  readonly pictures: ReadonlySignal<readonly string[]>;
  /** The target's heights; null where there is none, or it is still being read. */
  readonly target: ReadonlySignal<Heights | null>;
  /** Why the target cannot be shown. */
  readonly broken = signal<string | null>(null);
  /** Whether the target's contours lie on the ground. */
  readonly contours = signal(false);
  /** Whether this page may show where the ground is too high and too low. */
  readonly mayDiffer: ReadonlySignal<boolean>;
  readonly difference: ReadonlySignal<ChannelGrid | null>;
  readonly lines: ReadonlySignal<readonly FootprintVisual[]>;
  /** The target's contours on the map. */
  readonly contourMap: ReadonlySignal<readonly ContourLine[]>;
  /** Height that the task asks for at a place of a section; null where it asks for none. */
  readonly asked: ReadonlySignal<((x: number, y: number) => number | null) | null>;
  readonly #host: TaskHost;
  readonly #target = signal<Heights | null>(null);
  readonly #ground: Signal<TileGround>;
  readonly #stops: (() => void)[] = [];
  #reading = 0;

  constructor(host: TaskHost) {
    this.#host = host;
    this.#ground = signal(host.tiles.freeze());
    this.target = this.#target;
    this.task = computed(() => host.doc.value?.settings.task ?? null);
    this.pictures = computed(() => host.doc.value?.settings.task_pictures ?? []);
    this.mayDiffer = computed(() => {
      const task = this.task.value;
      if (task === null || (!task.difference && !host.conducts())) return false;
      return this.#target.value !== null || task.goal?.type === "profile";
    });
    this.difference = computed(() => this.#difference());
    this.contourMap = computed(() => this.#contourMap());
    this.lines = computed(() => this.#lines());
    this.asked = computed(() => this.#asked());
    this.#follow();
  }

  get sizeM(): number {
    return this.#host.tiles.sizeM;
  }

  /** Whether red and blue are on the ground. */
  get differs(): boolean {
    return this.#host.overlay.value === "difference";
  }

  differ(on: boolean): void {
    this.#host.overlay.value = on ? "difference" : "none";
  }

  /** Metres by which the ground at a place is above what is asked; null where nothing is. */
  offAt(place: readonly number[] | null): number | null {
    const target = this.#target.value;
    if (place === null || target === null) return null;
    const [x, y] = [place[0]!, place[1]!];
    return this.#ground.value.heightAt(x, y) - targetAt(target, this.sizeM, x, y);
  }

  dispose(): void {
    for (const stop of this.#stops) stop();
  }

  #follow(): void {
    const look = new Throttle(HERTZ, () => {
      this.#ground.value = this.#host.tiles.freeze();
    });
    const data = computed(() => targetOf(this.task.value?.goal)?.data ?? null);
    this.#stops.push(
      effect(() => {
        this.#host.tiles.revision.value;
        if (this.differs || this.task.value !== null) look.request();
      }),
      effect(() => {
        data.value;
        void this.#read(targetOf(this.task.peek()?.goal));
      }),
      effect(() => {
        if (this.differs && !this.mayDiffer.value) this.differ(false);
      }),
      () => look.stop(),
    );
  }

  async #read(target: Target | null): Promise<void> {
    const turn = ++this.#reading;
    this.broken.value = null;
    this.#target.value = null;
    if (target === null) return;
    if (target.size_m !== this.sizeM) {
      this.broken.value = msg("This task was made for a terrain of another size.");
      return;
    }
    try {
      const found = await decode(target);
      if (turn === this.#reading) this.#target.value = found;
    } catch (error) {
      if (turn === this.#reading) this.broken.value = error instanceof Error ? error.message : String(error);
    }
  }

  #difference(): ChannelGrid | null {
    const goal = this.task.value?.goal;
    const target = this.#target.value;
    if (!this.differs || !this.mayDiffer.value || target === null) return null;
    if (goal?.type !== "terrain" && goal?.type !== "contours") return null;
    const ground = this.#ground.value;
    return differenceGrid((x, y) => ground.heightAt(x, y), target, this.sizeM, goal.tolerance_m);
  }

  #contourMap(): readonly ContourLine[] {
    const goal = this.task.value?.goal;
    const target = this.#target.value;
    if (goal?.type !== "contours" || target === null) return [];
    return contourLines(target, this.sizeM, goal.interval_m);
  }

  #asked(): ((x: number, y: number) => number | null) | null {
    const goal = this.task.value?.goal;
    if (!this.mayDiffer.value || !goal) return null;
    const target = this.#target.value;
    if (target !== null) return (x, y) => targetAt(target, this.sizeM, x, y);
    return goal.type === "profile" ? (x, y) => alongProfile(goal, x, y, ON_LINE * this.sizeM) : null;
  }

  /** What a task shows on the ground: contours, the line of a profile, a path, a point. */
  #lines(): readonly FootprintVisual[] {
    const goal = this.task.value?.goal;
    if (!goal) return [];
    const ground = this.#ground.value;
    const onGround = (id: string, xy: ArrayLike<number>, colour: Rgba, strong: boolean): FootprintVisual => {
      const flat = Array.from({ length: (xy.length / 2) * 3 }, (_, i) =>
        i % 3 === 2 ? 0 : xy[2 * Math.floor(i / 3) + (i % 3)]!,
      );
      const line = drape(flat, this.sizeM * STEP, (x, y) => ground.heightAt(x, y));
      return { id, points: new Float32Array(line), colour, strong };
    };
    if (this.contours.value)
      return this.contourMap.value.map((line, i) => onGround(`asked-${i}`, line.points, CONTOUR, false));
    if (goal.type === "profile") return [onGround("asked-line", [...goal.first, ...goal.last], MARK, true)];
    if (goal.type === "slope") return [onGround("asked-path", goal.path.flat(), MARK, true)];
    if (goal.type === "volume" || goal.type === "watershed")
      return [onGround("asked-point", ring(goal.point, this.sizeM * RING_SHARE), MARK, true)];
    return [];
  }
}

function ring([x, y]: readonly [number, number], radius: number): number[] {
  const out: number[] = [];
  for (let k = 0; k <= 32; k += 1) {
    const a = (k / 32) * 2 * Math.PI;
    out.push(x + radius * Math.cos(a), y + radius * Math.sin(a));
  }
  return out;
}

/** What a profile asks for at a place of its line; null beside it. */
export function alongProfile(
  { first, last, heights }: { first: [number, number]; last: [number, number]; heights: readonly number[] },
  x: number,
  y: number,
  nearM: number,
): number | null {
  const [dx, dy] = [last[0] - first[0], last[1] - first[1]];
  const length = Math.hypot(dx, dy);
  if (length === 0) return null;
  const along = ((x - first[0]) * dx + (y - first[1]) * dy) / length;
  const beside = Math.abs((x - first[0]) * dy - (y - first[1]) * dx) / length;
  if (beside > nearM || along < -nearM || along > length + nearM) return null;
  const at = Math.min(Math.max(along / length, 0), 1) * (heights.length - 1);
  const k = Math.min(Math.floor(at), heights.length - 2);
  return heights[k]! + (heights[k + 1]! - heights[k]!) * (at - k);
}
