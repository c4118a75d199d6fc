/**
 * Pointers and keys on the terrain: which tool gets them, and what they change (DESIGN 12).
 *
 * One pointer is the main one and does one thing at a time (`pointeractions.ts`): draw, drag a handle, move a stroke, or move the
 * camera. A second finger, or Esc, ends it. Events come in CSS pixels and become device pixels here, at the DOM's edge.
 */

import { msg, str } from "@lit/localize";
import { computed, type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import type { Camera } from "../core/camera/camera.ts";
import type { GhostVisual, Ground, Vec3 } from "../core/types.ts";
import type { SyncDoc } from "../doc/sync.ts";
import type { ToolDefaults } from "./defaults.ts";
import { HitTest, takePointer } from "./hittest.ts";
import type { Action, ToolId } from "./keys/action.ts";
import { createActions } from "./keys/actions.ts";
import { Keyboard } from "./keys/keyboard.ts";
import { KeyPen } from "./keys/keypen.ts";
import { type Activity, PointerActions } from "./pointeractions.ts";
import type { Say } from "./say.ts";
import { OversketchTool } from "./sketch/oversketch.ts";
import { type AnyHandle, HandleSet } from "./tools/handleset.ts";
import { type Finger, Navigation, type NavigationMode } from "./tools/navigation.ts";
import type { Placing } from "./tools/placement.ts";
import { MOST_POINTS, Ruler } from "./tools/ruler.ts";
import { type FinishedStroke, type InkVisual, StrokeTool } from "./tools/stroketool.ts";

export type { ActionId, ToolId } from "./keys/action.ts";
export type { KeyPenVisual } from "./keys/keypen.ts";
export type { AnyHandle } from "./tools/handleset.ts";
export type { Placing } from "./tools/placement.ts";

export type InputMode = "idle" | "draw" | "handle" | NavigationMode;

export interface InputOptions {
  /** The element that takes the pointer; its box is the picture of `camera`. */
  readonly canvas: HTMLElement;
  readonly camera: Camera;
  readonly doc: SyncDoc;
  /** The ground as it is drawn now. */
  readonly ground: () => Ground;
  /** Returns the ground, held fast for one stroke or drag. */
  readonly freeze: () => Ground;
  readonly clientId: string;
  readonly canEdit: () => boolean;
  readonly defaults: ToolDefaults;
  /** Where the pointer is on the ground; null when it has left. */
  readonly onCursor: (p: Vec3 | null) => void;
  readonly onMessage: Say;
  /** The name that new strokes carry. */
  readonly author?: () => string;
  /** Milliseconds. */
  readonly now?: () => number;
}

interface Main {
  readonly pointerId: number;
  readonly startX: number;
  readonly startY: number;
  moved: boolean;
  activity: Activity;
}

/** CSS pixels a pointer may tremble within a click. */
const CLICK_PX = 4;
const FLUSH: Readonly<Record<Exclude<ToolId, "select" | "paint" | "course">, string>> = {
  mountain: msg("This line lies on the ground. Draw it up into the air, or drag its middle handle up."),
  crevice: msg("This line lies on the ground. Draw it as a hollow, or drag its middle handle down."),
  plateau: msg("This plateau lies level with the ground. Drag its handle up to raise it."),
};

export class InputController {
  readonly tool: Signal<ToolId> = signal<ToolId>("mountain");
  readonly selection: Signal<string | null> = signal<string | null>(null);
  /** Whether one finger draws. It becomes false when a pen is seen. */
  readonly fingerDraws: Signal<boolean> = signal(true);
  /** The elevation grid that is being placed: it has the pointer to itself. */
  readonly placing: Signal<Placing | null> = signal<Placing | null>(null);
  /** What is measured: while it is open it has the pointer to itself. */
  readonly ruler = new Ruler();
  readonly actions: Map<string, Action>;
  /** The pen that the arrow keys move. */
  readonly keyPen: KeyPen;
  readonly #o: InputOptions;
  readonly #hovered = signal<string | null>(null);
  readonly #mode = signal<InputMode>("idle");
  readonly #strokes: StrokeTool;
  readonly #oversketch: OversketchTool;
  readonly #inks: ReadonlySignal<InkVisual | null>;
  readonly #handleSet: HandleSet;
  readonly #navigation: Navigation;
  readonly #hitTest: HitTest;
  readonly #keyboard: Keyboard;
  readonly #pointerActions: PointerActions;
  readonly #touches = new Map<number, Finger>();
  readonly #abort = new AbortController();
  #main: Main | null = null;
  #penDown = false;
  #penSeen = false;

  constructor(options: InputOptions) {
    this.#o = options;
    const now = options.now ?? (() => performance.timeOrigin + performance.now());
    this.#navigation = new Navigation(options.camera, options.ground);
    this.#hitTest = new HitTest(options.canvas, options.camera, options.doc);
    this.#strokes = new StrokeTool({ author: () => "", ...options, now });
    this.#oversketch = new OversketchTool({ ...options, now });
    this.#inks = computed(() => this.#oversketch.ink.value ?? this.#strokes.ink.value);
    const { tool, selection, placing, ruler } = this;
    this.#handleSet = new HandleSet({ ...options, tool, selection, placing, ruler, now });
    this.keyPen = new KeyPen({
      ...options,
      tool,
      placing,
      ruler,
      strokes: this.#strokes,
      hit: (x, y) => this.#navigation.hit(x, y),
      onDrawn: (made) => this.#drawn(made),
    });
    this.actions = createActions({
      ...options,
      tool,
      selection,
      placing,
      ruler,
      fingerDraws: this.fingerDraws,
      newId: () => this.#strokes.newId(),
      cancel: () => this.#cancel(),
      keyPen: this.keyPen,
      now,
    });
    this.#keyboard = new Keyboard(options.camera, this.#navigation, this.actions, this.keyPen);
    this.#pointerActions = new PointerActions({
      ...options,
      tool,
      selection,
      placing,
      ruler,
      fingerDraws: this.fingerDraws,
      navigation: this.#navigation,
      hitTest: this.#hitTest,
      strokes: this.#strokes,
      oversketch: this.#oversketch,
      handleSet: this.#handleSet,
      spaceHeld: () => this.#keyboard.spaceHeld,
    });
    this.#listen();
  }

  get hovered(): ReadonlySignal<string | null> {
    return this.#hovered;
  }

  /** Handles of the grid that is being placed, else of the selected stroke in the select tool; of paint with the brush too. */
  get handles(): ReadonlySignal<readonly AnyHandle[]> {
    return this.#handleSet.handles;
  }

  get ghost(): ReadonlySignal<GhostVisual | null> {
    return this.#strokes.ghost;
  }

  /** Id of the stroke under way. */
  get drawing(): ReadonlySignal<string | null> {
    return this.#strokes.drawing;
  }

  /** The line under the pen, in device pixels. */
  get ink(): ReadonlySignal<InkVisual | null> {
    return this.#inks;
  }

  /** The gesture of the main pointer. */
  get inputMode(): ReadonlySignal<InputMode> {
    return this.#mode;
  }

  /** Id of the stroke whose handle is dragged, or of which a part is drawn anew; null: I hold none. */
  readonly held: ReadonlySignal<string | null> = computed(() => {
    const holds =
      this.#mode.value === "handle" || (this.#mode.value === "draw" && this.#strokes.drawing.value === null);
    return holds && this.placing.value === null && this.ruler.kind.value === null ? this.selection.value : null;
  });

  /** Ends what a pointer does as if it were lifted: a stroke is finished as it is. */
  lift(): void {
    const main = this.#main;
    if (main === null) return;
    const { kind } = main.activity;
    if (kind === "draw") this.#strokes.finish();
    else if (kind === "redraw") this.#oversketch.finish();
    else if (kind === "drag") this.#handleSet.finish();
    this.#endMain();
  }

  /** Ends everything under way and all listening. */
  dispose(): void {
    this.#cancel();
    this.#abort.abort();
    this.keyPen.dispose();
    this.#keyboard.dispose();
    this.#navigation.dispose();
  }

  #listen(): void {
    const { canvas } = this.#o;
    const on = <K extends keyof HTMLElementEventMap>(
      type: K,
      run: (e: HTMLElementEventMap[K]) => void,
      passive = true,
    ): void => {
      canvas.addEventListener(type, run, { passive, signal: this.#abort.signal });
    };
    canvas.style.touchAction = "none";
    on("pointerdown", (e) => this.#down(e), false);
    on("pointermove", (e) => this.#move(e));
    on("pointerup", (e) => this.#up(e));
    on("pointercancel", (e) => this.#lost(e));
    on("pointerleave", () => this.#leave());
    on("wheel", (e) => this.#wheel(e), false);
    on("dblclick", (e) => this.#navigation.flyTo(...this.#hitTest.pixel(e)));
    on("contextmenu", (e) => e.preventDefault(), false);
  }

  #down(e: PointerEvent): void {
    if (e.pointerType === "touch" && this.#penDown) return;
    e.preventDefault();
    if (e.pointerType === "pen") this.#pen();
    const [x, y] = this.#hitTest.pixel(e);
    if (e.pointerType === "touch") {
      this.#touches.set(e.pointerId, { id: e.pointerId, x, y });
      if (this.#touches.size > 1) {
        this.#beginPinch();
        return;
      }
    }
    if (this.#main !== null) return;
    this.keyPen.leave();
    takePointer(this.#o.canvas, e.pointerId);
    this.#main = {
      pointerId: e.pointerId,
      startX: x,
      startY: y,
      moved: false,
      activity: this.#pointerActions.begin(e, x, y),
    };
    this.#publishMode();
  }

  /** A pen has come: fingers that rest on the glass are not meant, and from now on one finger moves the view. */
  #pen(): void {
    this.#penDown = true;
    if (!this.#penSeen) this.fingerDraws.value = false;
    this.#penSeen = true;
    if (this.#touches.size > 0) this.#cancel();
    this.#touches.clear();
    this.#navigation.endPinch();
  }

  #beginPinch(): void {
    this.#cancel();
    const [a, b] = [...this.#touches.values()];
    if (this.#touches.size === 2) this.#navigation.beginPinch(a!, b!);
    this.#publishMode();
  }

  #move(e: PointerEvent): void {
    const [x, y] = this.#hitTest.pixel(e);
    const finger = this.#touches.get(e.pointerId);
    if (finger !== undefined) Object.assign(finger, { x, y });
    if (this.#navigation.mode === "pinch" && finger !== undefined) {
      const [a, b] = [...this.#touches.values()];
      if (a !== undefined && b !== undefined) this.#navigation.pinch(a, b);
      return;
    }
    const main = this.#main;
    if (main === null) {
      if (e.pointerType !== "touch") this.#hover(e, x, y);
      return;
    }
    if (e.pointerId !== main.pointerId) return;
    if (!main.moved) {
      if (Math.hypot(x - main.startX, y - main.startY) <= CLICK_PX * this.#hitTest.ratio) return;
      main.moved = true;
      main.activity = this.#pointerActions.moved(main.activity, main.startX, main.startY);
      this.#publishMode();
    }
    this.#continue(main, e, x, y);
  }

  #continue(main: Main, e: PointerEvent, x: number, y: number): void {
    const { activity } = main;
    if (activity.kind === "draw") {
      this.#strokes.move(this.#hitTest.samples(e), this.#hitTest.predicted(e));
      this.#cursor(x, y);
    } else if (activity.kind === "redraw") {
      this.#oversketch.move(this.#hitTest.samples(e), this.#hitTest.predicted(e));
      this.#cursor(x, y);
    } else if (activity.kind === "measure") {
      const hit = this.#navigation.hit(x, y);
      this.ruler.draw(hit);
      this.#o.onCursor(hit);
    } else if (activity.kind === "navigate") this.#navigation.drag(x, y);
    else if (activity.kind === "drag") {
      this.#handleSet.move(x, y, !e.altKey);
      this.#cursor(x, y);
    }
  }

  #up(e: PointerEvent): void {
    if (e.pointerType === "pen") this.#penDown = false;
    this.#touches.delete(e.pointerId);
    if (this.#navigation.mode === "pinch") {
      this.#navigation.endPinch();
      this.#publishMode();
      return;
    }
    const main = this.#main;
    if (main === null || e.pointerId !== main.pointerId) return;
    const { activity } = main;
    if (!main.moved) this.#click(activity, e);
    else if (activity.kind === "draw") {
      const made = this.#strokes.finish();
      if (made !== null) this.#drawn(made);
    } else if (activity.kind === "redraw") this.#oversketch.finish();
    else if (activity.kind === "measure") this.ruler.finish(this.#o.camera.metresPerPixelAt(activity.from));
    else if (activity.kind === "drag") {
      this.#handleSet.move(...this.#hitTest.pixel(e), !e.altKey);
      this.#handleSet.finish();
    }
    this.#endMain();
  }

  /** A new stroke is selected. One that changes nothing to be seen is put in hand, with a word on what to do. */
  #drawn(made: FinishedStroke): void {
    // A person with the brush goes on painting: keys and inspector stay with the brush.
    const tool = this.tool.value;
    this.selection.value = tool === "paint" ? null : made.id;
    if (!made.flush || tool === "paint" || tool === "course" || tool === "select") return;
    this.tool.value = "select";
    this.#o.onMessage(FLUSH[tool]);
  }

  /** A click without movement selects the stroke under it, or nothing; with the brush, beside all paint, it is a dab. */
  #click(activity: Activity, e: PointerEvent): void {
    const picked = this.#pointerActions.pick(e);
    if (activity.kind === "draw" && picked === null) {
      const made = this.#strokes.touch();
      if (made !== null) {
        this.#drawn(made);
        return;
      }
    }
    if (activity.kind === "draw") this.#strokes.cancel();
    if (activity.kind === "refused" && this.ruler.kind.value !== null) this.#o.onMessage(activity.notice);
    if (activity.kind === "measure" && !this.ruler.add(activity.from))
      this.#o.onMessage(msg(str`A line has at most ${MOST_POINTS} points.`));
    if (activity.kind === "redraw") this.#oversketch.cancel();
    if (activity.kind === "drag") this.#handleSet.cancel();
    if (e.button !== 0 || activity.kind === "drag" || activity.kind === "navigate") return;
    if (this.placing.value !== null || this.ruler.kind.value !== null) return;
    this.selection.value = picked?.stroke.id ?? null;
  }

  /** The system took the pointer away: what was being drawn is given up. */
  #lost(e: PointerEvent): void {
    if (e.pointerType === "pen") this.#penDown = false;
    this.#touches.delete(e.pointerId);
    if (this.#navigation.mode === "pinch") this.#navigation.endPinch();
    if (this.#main?.pointerId === e.pointerId) this.#cancel();
    this.#publishMode();
  }

  #leave(): void {
    if (this.#main !== null) return;
    this.#hovered.value = null;
    this.#handleSet.hover(null);
    this.#o.onCursor(null);
  }

  #hover(e: PointerEvent, x: number, y: number): void {
    this.#cursor(x, y);
    if (e.pointerType === "pen" && !this.#penSeen) {
      this.#penSeen = true;
      this.fingerDraws.value = false;
    }
    const handle = this.#hitTest.handle(this.handles.value, e);
    this.#handleSet.hover(handle?.kind ?? null);
    const picks = this.tool.value === "select" || this.tool.value === "paint";
    const over = handle === null && picks ? this.#pointerActions.pick(e) : null;
    const redraws = handle === null && !picks && this.#pointerActions.over(e);
    this.#hovered.value = redraws ? this.selection.value : (over?.stroke.id ?? null);
    this.#showCursor(handle !== null || over !== null, redraws);
  }

  #cursor(x: number, y: number): void {
    this.#o.onCursor(this.#navigation.hit(x, y));
  }

  #wheel(e: WheelEvent): void {
    e.preventDefault();
    this.keyPen.leave();
    const [x, y] = this.#hitTest.pixel(e);
    this.#navigation.wheel(e.deltaY, e.deltaMode, e.ctrlKey, x, y);
  }

  /** Gives up what is under way: a stroke being drawn is deleted, a drag is taken back. True when there was one. */
  #cancel(): boolean {
    const main = this.#main;
    if (main === null) return this.keyPen.cancel();
    this.#endMain();
    const { kind } = main.activity;
    if (kind === "draw") this.#strokes.cancel();
    else if (kind === "redraw") this.#oversketch.cancel();
    else if (kind === "drag") this.#handleSet.cancel();
    else if (kind === "measure") return this.ruler.cancel();
    return kind === "draw" || kind === "redraw" || kind === "drag";
  }

  #endMain(): void {
    this.#main = null;
    this.#navigation.end();
    this.#publishMode();
  }

  #publishMode(): void {
    const activity = this.#main?.activity;
    const navigation = this.#navigation.mode;
    if (navigation !== null) this.#mode.value = navigation;
    else if (activity?.kind === "draw" || activity?.kind === "redraw") this.#mode.value = "draw";
    else this.#mode.value = activity?.kind === "drag" ? "handle" : "idle";
    this.#showCursor(false);
  }

  /** `over`: something can be taken hold of; `redraws`: a line begun here changes the selected one. */
  #showCursor(over: boolean, redraws = false): void {
    const still = (this.tool.value === "select" && this.ruler.kind.value === null) || this.placing.value !== null;
    const idle = redraws ? "cell" : over ? "pointer" : still ? "default" : "crosshair";
    const mode = this.#mode.value;
    this.#o.canvas.style.cursor = mode === "idle" || mode === "draw" ? idle : "grabbing";
  }
}
