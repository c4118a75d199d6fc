/** A task while a teacher writes it: what stands in the form, and what of it the server may be sent. */

import { msg, str } from "@lit/localize";
import { type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import type { Heights } from "../../../core/difference.ts";
import { targetAt } from "../../../core/difference.ts";
import { plainTask } from "../../../core/plain.ts";
import { MAX_TASK_PICTURES, type Task } from "../../../generated/contract.ts";
import { smallPicture } from "./pictures.ts";
import { encode } from "./target.ts";
import { readTask, type TaskFile, writeTask } from "./task-file.ts";
import type { Goal, GoalType } from "./words.ts";

type Place = readonly [number, number];

/** Heights of a profile that are asked for along its line. */
const PROFILE_SAMPLES = 129;
const NEW: Task = { title: "", text: "", goal: null, difference: true };

/** What a goal still lacks, as a sentence. */
export const LACKS = {
  target: msg("Press *Use this terrain as the target* first: what the ground is now is what is asked for."),
  line: msg("Choose the line on the ground first."),
  path: msg("Choose the path on the ground first."),
  point: msg("Choose the point on the ground first."),
} as const;

/** Numbers of a goal that a person types. */
export interface Numbers {
  readonly toleranceM: number;
  readonly intervalM: number;
  readonly levelM: number;
  readonly amount: number;
  readonly grade: number;
  readonly dry: boolean;
}

export class TaskDraft {
  readonly title: Signal<string>;
  readonly text: Signal<string>;
  readonly difference: Signal<boolean>;
  readonly kind: Signal<GoalType>;
  readonly numbers: Signal<Numbers>;
  readonly places: Signal<readonly Place[]>;
  readonly pictures: Signal<readonly string[]>;
  /** The goal as it was written before, whose target or heights stay until others are taken. */
  readonly #goal: Signal<Goal | null>;
  readonly #wrong = signal<string | null>(null);
  readonly #sizeM: number;

  constructor(task: Task | null, pictures: readonly string[], sizeM: number) {
    this.#sizeM = sizeM;
    this.title = signal("");
    this.text = signal("");
    this.difference = signal(true);
    this.kind = signal<GoalType>("none");
    this.numbers = signal(defaults(sizeM));
    this.places = signal<readonly Place[]>([]);
    this.pictures = signal(pictures);
    this.#goal = signal<Goal | null>(null);
    this.#fill(task ?? NEW);
  }

  /** Why the last thing could not be done. */
  get wrong(): ReadonlySignal<string | null> {
    return this.#wrong;
  }

  /** Whether the goal has its target or its heights. */
  get taken(): boolean {
    return this.#goal.value?.type === this.kind.value;
  }

  set(change: Partial<Numbers>): void {
    this.numbers.value = { ...this.numbers.peek(), ...change };
  }

  /** The ground as it is becomes what is asked for. */
  async take(ground: () => Heights): Promise<void> {
    await this.#trying(async () => {
      const kind = this.kind.peek();
      const { toleranceM: tolerance_m, intervalM: interval_m } = this.numbers.peek();
      if (kind === "profile") {
        const [first, last] = this.#ends();
        const heights = ground();
        const along = Array.from({ length: PROFILE_SAMPLES }, (_, i) => {
          const t = i / (PROFILE_SAMPLES - 1);
          return targetAt(
            heights,
            this.#sizeM,
            first[0] + (last[0] - first[0]) * t,
            first[1] + (last[1] - first[1]) * t,
          );
        });
        this.#goal.value = { type: "profile", first: [...first], last: [...last], heights: along, tolerance_m };
        return;
      }
      const target = await encode(ground(), this.#sizeM);
      this.#goal.value =
        kind === "contours"
          ? { type: "contours", target, tolerance_m, interval_m }
          : { type: "terrain", target, tolerance_m };
    });
  }

  /** The places that were chosen on the ground: a point, the ends of a line, or a path. */
  choose(points: readonly Place[]): void {
    this.places.value = points.map(([x, y]) => [Math.round(x * 10) / 10, Math.round(y * 10) / 10]);
    if (this.kind.peek() === "profile") this.#goal.value = null;
  }

  async addPicture(file: Blob): Promise<void> {
    await this.#trying(async () => {
      if (this.pictures.peek().length >= MAX_TASK_PICTURES)
        throw new Error(msg(str`A task has at most ${MAX_TASK_PICTURES} pictures.`));
      this.pictures.value = [...this.pictures.peek(), await smallPicture(file)];
    });
  }

  dropPicture(index: number): void {
    this.pictures.value = this.pictures.peek().filter((_, i) => i !== index);
  }

  /** The task as it stands; null, with a sentence in `wrong`, while something is missing. */
  finish(): Task | null {
    try {
      const goal = this.#made();
      this.#wrong.value = null;
      return plainTask({
        title: this.title.peek().trim(),
        text: this.text.peek(),
        goal,
        difference: this.difference.peek(),
      });
    } catch (error) {
      this.#wrong.value = error instanceof Error ? error.message : String(error);
      return null;
    }
  }

  /** The file of the task; null while something is missing. */
  file(): string | null {
    const task = this.finish();
    return task && writeTask({ task, pictures: this.pictures.peek() }, this.#sizeM);
  }

  open(text: string): void {
    try {
      const found: TaskFile = readTask(text, this.#sizeM);
      this.pictures.value = found.pictures;
      this.#fill(found.task);
      this.#wrong.value = null;
    } catch (error) {
      this.#wrong.value = error instanceof Error ? error.message : String(error);
    }
  }

  async #trying(run: () => Promise<void>): Promise<void> {
    try {
      await run();
      this.#wrong.value = null;
    } catch (error) {
      this.#wrong.value = error instanceof Error ? error.message : String(error);
    }
  }

  #fill({ title, text, goal, difference }: Task): void {
    this.title.value = title;
    this.text.value = text;
    this.difference.value = difference;
    this.kind.value = goal?.type ?? "none";
    this.#goal.value = goal;
    this.places.value = placesOf(goal);
    this.numbers.value = { ...this.numbers.peek(), ...numbersOf(goal) };
  }

  #ends(): readonly [Place, Place] {
    const [first, last] = [this.places.peek()[0], this.places.peek().at(-1)];
    if (first === undefined || last === undefined || this.places.peek().length < 2) throw new Error(LACKS.line);
    return [first, last];
  }

  #point(): [number, number] {
    const point = this.places.peek()[0];
    if (point === undefined) throw new Error(LACKS.point);
    return [...point];
  }

  #made(): Goal | null {
    const { toleranceM: tolerance_m, intervalM: interval_m, levelM: level_m, amount, grade, dry } = this.numbers.peek();
    const kept = this.#goal.peek();
    switch (this.kind.peek()) {
      case "none":
        return null;
      case "terrain":
        if (kept?.type !== "terrain") throw new Error(LACKS.target);
        return { ...kept, tolerance_m };
      case "contours":
        if (kept?.type !== "contours") throw new Error(LACKS.target);
        return { ...kept, tolerance_m, interval_m };
      case "profile":
        this.#ends();
        if (kept?.type !== "profile") throw new Error(LACKS.target);
        return { ...kept, tolerance_m };
      case "volume":
        return { type: "volume", point: this.#point(), level_m, at_least_m3: amount };
      case "slope": {
        const path = this.places.peek().map(([x, y]) => [x, y] as [number, number]);
        if (path.length < 2) throw new Error(LACKS.path);
        return { type: "slope", path, at_most: grade };
      }
      case "area":
        return { type: "area", level_m, at_least_m2: amount, dry };
      case "watershed":
        return { type: "watershed", point: this.#point(), at_least_m2: amount };
    }
  }
}

function defaults(sizeM: number): Numbers {
  const round = (v: number): number => Number(v.toPrecision(1));
  return {
    toleranceM: round(sizeM / 200),
    intervalM: round(sizeM / 80),
    levelM: 0,
    amount: round((sizeM * sizeM) / 8),
    grade: 0.08,
    dry: true,
  };
}

function numbersOf(goal: Goal | null): Partial<Numbers> {
  if (goal === null) return {};
  return {
    ...("tolerance_m" in goal ? { toleranceM: goal.tolerance_m } : {}),
    ...("interval_m" in goal ? { intervalM: goal.interval_m } : {}),
    ...("level_m" in goal ? { levelM: goal.level_m } : {}),
    ...("at_least_m3" in goal ? { amount: goal.at_least_m3 } : {}),
    ...("at_least_m2" in goal ? { amount: goal.at_least_m2 } : {}),
    ...(goal.type === "slope" ? { grade: goal.at_most } : {}),
    ...(goal.type === "area" ? { dry: goal.dry } : {}),
  };
}

function placesOf(goal: Goal | null): readonly Place[] {
  if (goal?.type === "profile") return [goal.first, goal.last];
  if (goal?.type === "slope") return goal.path;
  return goal?.type === "volume" || goal?.type === "watershed" ? [goal.point] : [];
}
