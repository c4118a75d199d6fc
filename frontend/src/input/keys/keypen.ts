/**
 * A pen that the arrow keys move (DESIGN 12: every action has a key). It lives on the screen as every pen does, so that a
 * silhouette can be drawn in the air: Enter sets points, a smooth line runs through them and on to the pen, Enter without a
 * movement ends it. The rays are those of the view in which the line was begun.
 */

import { msg, str } from "@lit/localize";
import { effect, type ReadonlySignal, signal, untracked } from "@preact/signals-core";
import type { Camera } from "../../core/camera/camera.ts";
import { clamp } from "../../core/math.ts";
import type { Ray, Vec3 } from "../../core/types.ts";
import type { Sample } from "../sketch/sketch.ts";
import { type Pixel, through } from "../sketch/spline.ts";
import type { Placing } from "../tools/placement.ts";
import type { Ruler } from "../tools/ruler.ts";
import type { FinishedStroke, StrokeTool } from "../tools/stroketool.ts";
import type { ToolId } from "./action.ts";

/** The pen as it is shown: device pixels. */
export interface KeyPenVisual {
  readonly at: Pixel;
  /** Points that are set, of the line under way. */
  readonly points: readonly Pixel[];
}

export interface KeyPenContext {
  readonly camera: Camera;
  readonly canEdit: () => boolean;
  readonly tool: ReadonlySignal<ToolId>;
  readonly placing: ReadonlySignal<Placing | null>;
  readonly ruler: Ruler;
  readonly strokes: StrokeTool;
  /** Ground under a device pixel. */
  readonly hit: (x: number, y: number) => Vec3 | null;
  readonly onCursor: (p: Vec3 | null) => void;
  readonly onMessage: (text: string) => void;
  /** A line is done. */
  readonly onDrawn: (made: FinishedStroke) => void;
}

/** An arrow key moves by this part of the height of the picture; with Shift by the second. */
const STEP = 0.025;
const FINE = 0.0025;
const ARROWS: Readonly<Record<string, Pixel>> = {
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
};
/** Keys that keep their meaning while a line is under way. */
const FREE: ReadonlySet<string> = new Set(["Tab", "Shift", "Control", "Alt", "Meta", "?"]);

const READY = msg("Arrow keys move the pen. Enter begins the line, Esc puts the pen away.");
const BEGUN = msg("Begun. Move the pen into the air or along the ground; Enter sets the next point.");
const UNDER_WAY = msg(
  "Enter sets the next point; Enter again ends the line. Backspace takes a point back, Esc all of it.",
);
const MEASURING = msg("Arrow keys move the pen, Enter sets a point, Backspace takes the last one back, Esc ends.");
const MANY_POINTS = msg("A line has no room for more points.");
const MOVE_FIRST = msg("Move the pen with the arrow keys first.");
const OFF_GROUND = msg("Begin the line on the land.");
const BUSY = msg("A line is under way: Enter twice ends it, Esc gives it up.");

export class KeyPen {
  readonly #c: KeyPenContext;
  readonly #visual = signal<KeyPenVisual | null>(null);
  readonly #words = signal("");
  readonly #stop: () => void;
  /** Where it was left, in parts of the picture. */
  #rest: Pixel = [0.5, 0.55];
  /** The view in which the line was begun; null while the pen is up. */
  #ray: ((x: number, y: number) => Ray) | null = null;
  /** The tool with which the line under way was begun. */
  #tool: ToolId | null = null;

  constructor(context: KeyPenContext) {
    this.#c = context;
    this.#stop = effect(() => {
      const tool = context.tool.value;
      const away = (tool === "select" && context.ruler.kind.value === null) || context.placing.value !== null;
      untracked(() => {
        if (away) this.hide();
        else if (tool !== this.#tool) this.cancel();
      });
    });
  }

  /** Null while it is put away. */
  get visual(): ReadonlySignal<KeyPenVisual | null> {
    return this.#visual;
  }

  /** A sentence about the next step, or about the last one: shown, and read aloud. */
  get words(): ReadonlySignal<string> {
    return this.#words;
  }

  /** A line is under way. */
  get down(): boolean {
    return this.#ray !== null;
  }

  readonly usable = (): boolean =>
    this.#c.ruler.kind.value !== null || (this.#c.canEdit() && this.#c.tool.value !== "select");

  /** Brings the pen where it was last, at first to the middle of the picture. */
  show(): void {
    if (!this.usable() || this.#visual.peek() !== null) return;
    const { width, height } = this.#c.camera.state.peek();
    this.#place([this.#rest[0] * width, this.#rest[1] * height], []);
    this.#words.value = this.#measures ? MEASURING : READY;
  }

  /** Takes a key that is meant for the terrain; false when it is not the pen's. */
  key(e: KeyboardEvent): boolean {
    const visual = this.#visual.peek();
    if (visual === null || FREE.has(e.key)) return false;
    const undo = e.key.toLowerCase() === "z" && (e.ctrlKey || e.metaKey) && !e.shiftKey;
    const arrow = ARROWS[e.key];
    if (!this.down && (e.ctrlKey || e.metaKey || e.altKey)) return false;
    if (arrow !== undefined) this.#move(arrow, e.shiftKey ? FINE : STEP);
    else if (e.key === "Enter") this.#point();
    else if (e.key === "Escape") this.#giveUp();
    else if (!this.down) return false;
    else if (undo || e.key === "Backspace" || e.key === "Delete") this.#back();
    else this.#c.onMessage(BUSY);
    return true;
  }

  /** Another hand begins: the line ends at its last point, and the pen is put away. */
  leave(): void {
    if (this.down) this.#finish();
    this.hide();
  }

  /** Gives up the line under way; true when there was one. */
  cancel(): boolean {
    if (!this.down) return false;
    this.#ray = null;
    this.#c.strokes.cancel();
    const visual = this.#visual.peek();
    if (visual !== null) this.#place(visual.at, []);
    return true;
  }

  hide(): void {
    this.cancel();
    if (this.#visual.peek() === null) return;
    this.#visual.value = null;
    this.#words.value = "";
    this.#c.onCursor(null);
  }

  dispose(): void {
    this.#stop();
    this.hide();
  }

  #move([dx, dy]: Pixel, share: number): void {
    const { at, points } = this.#visual.peek()!;
    const step = share * this.#c.camera.state.peek().height;
    this.#place([at[0] + dx * step, at[1] + dy * step], points);
    if (this.down) this.#redraw();
  }

  #point(): void {
    const { at, points } = this.#visual.peek()!;
    if (this.#measures) {
      this.#measure(at);
      return;
    }
    if (!this.down) {
      this.#begin(at);
      return;
    }
    const last = points.at(-1)!;
    if (Math.hypot(at[0] - last[0], at[1] - last[1]) < 0.5) {
      if (points.length === 1 && this.#c.tool.peek() !== "paint") this.#c.onMessage(MOVE_FIRST);
      else this.#finish();
      return;
    }
    this.#visual.value = { at, points: [...points, at] };
    this.#words.value = msg(str`Point ${points.length + 1} is set. ${UNDER_WAY}`);
  }

  get #measures(): boolean {
    return this.#c.ruler.kind.peek() !== null;
  }

  #measure(at: Pixel): void {
    const hit = this.#c.hit(...at);
    if (hit === null) this.#c.onMessage(OFF_GROUND);
    else if (!this.#c.ruler.add(hit)) this.#c.onMessage(MANY_POINTS);
    else this.#words.value = msg(str`Point ${this.#c.ruler.points.peek().length} is set. ${MEASURING}`);
  }

  #begin(at: Pixel): void {
    const tool = this.#c.tool.peek();
    if (tool === "select" || !this.#c.canEdit()) return;
    const ray = this.#c.camera.held();
    if (!this.#c.strokes.start(tool, sampleOn(ray, at), false)) {
      this.#c.onMessage(OFF_GROUND);
      return;
    }
    this.#ray = ray;
    this.#tool = tool;
    this.#visual.value = { at, points: [at] };
    this.#words.value = tool === "paint" ? UNDER_WAY : BEGUN;
  }

  /** The pen goes back to the last point; when it is there already, that point is taken back. */
  #back(): void {
    const { at, points } = this.#visual.peek()!;
    const last = points.at(-1)!;
    const moved = Math.hypot(at[0] - last[0], at[1] - last[1]) >= 0.5;
    const left = moved ? points : points.slice(0, -1);
    if (left.length === 0) {
      this.#giveUp();
      return;
    }
    this.#place(left.at(-1)!, left);
    this.#words.value = msg(str`Back at point ${left.length}.`);
    this.#redraw();
  }

  #giveUp(): void {
    if (!this.cancel()) {
      this.hide();
      return;
    }
    this.#words.value = msg(str`The line is given up. ${READY}`);
  }

  #redraw(): void {
    const ray = this.#ray;
    const visual = this.#visual.peek();
    if (ray === null || visual === null) return;
    const line = through([...visual.points, visual.at]);
    this.#c.strokes.redraw(line.slice(1).map((p) => sampleOn(ray, p)));
    if (!this.#c.strokes.active) this.#ray = null; // refused, and said why
  }

  #finish(): void {
    const { points } = this.#visual.peek()!;
    const ray = this.#ray!;
    const { strokes } = this.#c;
    if (points.length > 1)
      strokes.redraw(
        through(points)
          .slice(1)
          .map((p) => sampleOn(ray, p)),
      );
    this.#ray = null;
    const made = points.length > 1 ? strokes.finish() : strokes.touch();
    this.hide();
    if (made === null) return;
    this.#words.value = msg("The line is drawn.");
    this.#c.onDrawn(made);
  }

  /** Puts the pen on a whole pixel of the picture. */
  #place([x, y]: Pixel, points: readonly Pixel[]): void {
    const { width, height } = this.#c.camera.state.peek();
    const at: Pixel = [clamp(Math.round(x), 0, width - 1), clamp(Math.round(y), 0, height - 1)];
    this.#rest = [at[0] / width, at[1] / height];
    this.#visual.value = { at, points };
    this.#c.onCursor(this.#c.hit(...at));
  }
}

function sampleOn(ray: (x: number, y: number) => Ray, [x, y]: Pixel): Sample {
  return { x, y, ray: ray(x, y), pressure: 0.5 };
}
