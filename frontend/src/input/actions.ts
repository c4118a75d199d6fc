/** Everything that can be done, each on a key: the toolbar, the keyboard and the help sheet read one map. */

import type { Signal } from "@preact/signals-core";
import type { Camera, CameraMode } from "../core/camera.ts";
import type { Ground } from "../core/types.ts";
import type { SyncDoc } from "../doc/sync.ts";
import type { Op, Paint, Stroke } from "../generated/contract.ts";
import { brushActions } from "./brushactions.ts";
import type { PenToolId, ToolDefaults } from "./defaults.ts";
import { moveOps, raiseOps } from "./handledrag.ts";
import { handlesOf } from "./handles.ts";
import type { KeyPen } from "./keypen.ts";
import { layActions } from "./layactions.ts";
import { drapedOf, shapeOf } from "./picking.ts";
import type { Laying } from "./placement.ts";
import { createOps, metres } from "./strokeops.ts";

export type ToolId = "select" | PenToolId;

export type ActionId =
  | ToolId
  | "undo"
  | "redo"
  | "delete"
  | "duplicate"
  | "mirror"
  | "lock"
  | "hide"
  | "raise"
  | "lower"
  | "brush-smaller"
  | "brush-larger"
  | "brush-weaker"
  | "brush-stronger"
  | "brush-channel"
  | "brush-opposite"
  | "set-point"
  | "turn-grid-left"
  | "turn-grid-right"
  | "next-stroke"
  | "previous-stroke"
  | "cancel"
  | `nudge-${Direction}`
  | "frame-selection"
  | "home"
  | `camera-${CameraMode}`
  | "zoom-in"
  | "zoom-out"
  | "turn-left"
  | "turn-right"
  | "finger-draws"
  | `view-${1 | 2 | 3}`
  | `save-view-${1 | 2 | 3}`;

type Direction = "up" | "down" | "left" | "right";

export interface Action {
  readonly title: string;
  /** Combinations such as `Ctrl+Shift+z`, as `combination` (keyboard.ts) writes them. The first one is shown. */
  readonly keys: readonly string[];
  run(): void;
  enabled(): boolean;
}

export interface ActionContext {
  readonly camera: Camera;
  readonly doc: SyncDoc;
  readonly ground: () => Ground;
  /** The same, held fast. */
  readonly freeze: () => Ground;
  readonly canEdit: () => boolean;
  readonly tool: Signal<ToolId>;
  readonly selection: Signal<string | null>;
  /** The elevation grid that is being laid. */
  readonly laying: Signal<Laying | null>;
  readonly fingerDraws: Signal<boolean>;
  readonly defaults: ToolDefaults;
  readonly newId: () => string;
  readonly onMessage: (text: string) => void;
  /** Gives up what is being drawn or dragged; true when there was something. */
  readonly cancel: () => boolean;
  /** The pen that the arrow keys move. */
  readonly keyPen: Pick<KeyPen, "show" | "usable">;
  readonly now: () => number;
}

/** Key repeats within this time belong to one gesture, so that a held key is one step of undo. */
const GESTURE_MS = 800;
const TOOL_TITLES: Readonly<Record<ToolId, string>> = {
  select: "Select and shape",
  mountain: "Draw mountains",
  crevice: "Draw crevices",
  plateau: "Draw plateaux",
  paint: "Paint snow, plants, wetness and roughness",
};

/** Builds the map of actions. Its owner may add more (page-only ones such as the help sheet). */
export function createActions(c: ActionContext): Map<string, Action> {
  const actions = new Map<string, Action>();
  const put = (
    id: ActionId,
    title: string,
    keys: string[],
    run: () => void,
    enabled: () => boolean = () => true,
  ): void => void actions.set(id, { title, keys, run, enabled });
  const edits = new StrokeActions(c);
  for (const [id, keys] of [
    ["select", ["v"]],
    ["mountain", ["b", "1"]],
    ["crevice", ["c", "2"]],
    ["plateau", ["p", "3"]],
    ["paint", ["k", "4"]],
  ] as const)
    put(id, TOOL_TITLES[id], [...keys], () => {
      c.tool.value = id;
    });
  put(
    "undo",
    "Undo",
    ["Ctrl+z"],
    () => edits.travel("undo"),
    () => c.canEdit() && c.doc.canUndo.value,
  );
  put(
    "redo",
    "Redo",
    ["Ctrl+Shift+z", "Ctrl+y"],
    () => edits.travel("redo"),
    () => c.canEdit() && c.doc.canRedo.value,
  );
  put("delete", "Delete the stroke", ["Delete", "Backspace"], () => edits.remove(), edits.usable);
  put("duplicate", "Duplicate the stroke", ["Ctrl+d"], () => edits.duplicate(), edits.selected);
  put("mirror", "Swap the stroke's flanks", ["m"], () => edits.mirror(), edits.shaped);
  put("lock", "Lock or unlock the stroke", ["l"], () => edits.toggle("locked"), edits.selected);
  put("hide", "Hide or show the stroke", ["h"], () => edits.toggle("hidden"), edits.usable);
  put("raise", "Raise the stroke", ["PageUp"], () => edits.raise(1), edits.shaped);
  put("lower", "Lower the stroke", ["PageDown"], () => edits.raise(-1), edits.shaped);
  brushActions(c, edits, put);
  put("next-stroke", "Select the next stroke", ["n"], () => edits.step(1), edits.any);
  put("previous-stroke", "Select the previous stroke", ["Shift+n"], () => edits.step(-1), edits.any);
  put("cancel", "Cancel, or select nothing", ["Escape"], () => {
    if (c.cancel()) return;
    if (c.laying.value !== null) c.laying.value.cancel();
    else c.selection.value = null;
  });
  const nudgeGrid = layActions(c, (right, away) => edits.direction(right, away), put);
  nudgeActions(c, edits, put, nudgeGrid);
  cameraActions(c, edits, put);
  put("finger-draws", "One finger draws, or orbits", ["Shift+f"], () => {
    c.fingerDraws.value = !c.fingerDraws.value;
    c.onMessage(c.fingerDraws.value ? "One finger draws now." : "One finger moves the view now.");
  });
  return actions;
}

export type Put = (id: ActionId, title: string, keys: string[], run: () => void, enabled?: () => boolean) => void;

function nudgeActions(
  c: ActionContext,
  edits: StrokeActions,
  put: Put,
  nudgeGrid: (right: number, away: number) => boolean,
): void {
  const arrows = [
    ["up", 0, 1],
    ["down", 0, -1],
    ["left", -1, 0],
    ["right", 1, 0],
  ] as const;
  for (const [name, right, away] of arrows) {
    const key = `Arrow${name[0]!.toUpperCase()}${name.slice(1)}`;
    const title = `Move the pen (or the stroke, the grid, the view) ${{ up: "away", down: "nearer", left: "left", right: "right" }[name]}`;
    put(`nudge-${name}`, title, [key], () => {
      if (nudgeGrid(right, away)) return;
      if (edits.stroke() !== null && c.canEdit()) edits.nudge(right, away);
      else
        c.camera.pan(
          -right * c.camera.state.value.height * 0.06,
          away * c.camera.state.value.height * 0.06,
          c.ground(),
        );
    });
  }
}

function cameraActions(c: ActionContext, edits: StrokeActions, put: Put): void {
  const { camera } = c;
  put("frame-selection", "Look at the selection", ["f"], () => edits.frame());
  put("home", "See the whole terrain", ["Home"], () => camera.home());
  put("camera-orbit", "Orbit camera", ["o"], () => camera.setMode("orbit"));
  put("camera-fly", "Fly camera (W A S D, Q E)", ["g"], () => camera.setMode("fly"));
  put("camera-map", "Map from above", ["t"], () => camera.setMode("map"));
  put("zoom-in", "Zoom in", ["+", "="], () => camera.zoom(1.25, undefined, true));
  put("zoom-out", "Zoom out", ["-"], () => camera.zoom(0.8, undefined, true));
  put("turn-left", "Turn the view left", [","], () => camera.twist(-15));
  put("turn-right", "Turn the view right", ["."], () => camera.twist(15));
  for (const slot of [1, 2, 3] as const) {
    put(
      `view-${slot}`,
      `Go to view ${slot}`,
      [`Alt+${slot}`],
      () => void camera.restoreView(String(slot)),
      () => camera.views.value.has(String(slot)),
    );
    put(`save-view-${slot}`, `Remember view ${slot}`, [`Alt+Shift+${slot}`], () => {
      camera.saveView(String(slot));
      c.onMessage(`View ${slot} is remembered. Alt+${slot} brings it back.`);
    });
  }
}

/** What can be done to the selected stroke. */
export class StrokeActions {
  readonly #c: ActionContext;
  #gesture = { name: "", kind: "", at: -Infinity };

  constructor(context: ActionContext) {
    this.#c = context;
  }

  /** The selected stroke, or null. */
  stroke(): Stroke | null {
    return this.#c.doc.doc.value?.strokes.get(this.#c.selection.value ?? "") ?? null;
  }

  readonly selected = (): boolean => this.#c.canEdit() && this.stroke() !== null;
  readonly usable = (): boolean => this.selected() && this.stroke()?.locked === false;
  /** There is height and a section to change: paint has neither. */
  readonly shaped = (): boolean => this.usable() && this.stroke()?.kind !== "paint";
  readonly any = (): boolean => (this.#c.doc.doc.value?.strokes.size ?? 0) > 0;

  travel(way: "undo" | "redo"): void {
    this.#c.cancel();
    const { skipped } = this.#c.doc[way]();
    for (const sentence of new Set(skipped)) this.#c.onMessage(sentence);
  }

  remove(): void {
    const stroke = this.stroke();
    if (stroke === null || !this.#submit([{ type: "stroke.delete", stroke: stroke.id }])) return;
    this.#c.selection.value = null;
  }

  /** A copy a little to the right on the screen, selected. */
  duplicate(): void {
    const stroke = this.stroke();
    if (stroke === null) return;
    const step = this.#c.ground().sizeM / 40;
    const [dx, dy] = this.direction(step, -step);
    const moved = (p: Stroke["first"]): Stroke["first"] => metres([p[0] + dx, p[1] + dy, p[2]]);
    const id = this.#c.newId();
    const copy: Stroke = {
      ...stroke,
      id,
      first: moved(stroke.first),
      last: moved(stroke.last),
      locked: false,
      finished: true,
    };
    if (this.#submit(createOps(copy), `duplicate-${id}`)) this.#c.selection.value = id;
  }

  mirror(): void {
    const s = this.stroke();
    if (s !== null) this.#submit([{ type: "stroke.set", stroke: s.id, fields: { left: s.right, right: s.left } }]);
  }

  toggle(field: "locked" | "hidden"): void {
    const s = this.stroke();
    if (s !== null) this.#submit([{ type: "stroke.set", stroke: s.id, fields: { [field]: !s[field] } }]);
  }

  raise(sign: number): void {
    const s = this.stroke();
    if (s !== null) this.#submit(raiseOps(s, (sign * this.#c.ground().sizeM) / 400), this.#repeated("raise"));
  }

  /** Changes the paint of the selected stroke; repeats within a moment are one step of undo. */
  repaint(paint: Paint): void {
    const s = this.stroke();
    if (s !== null) this.#submit([{ type: "stroke.set", stroke: s.id, fields: { paint } }], this.#repeated("paint"));
  }

  /** Moves the stroke by a small step as seen on the screen. */
  nudge(right: number, away: number): void {
    const s = this.stroke();
    if (s === null) return;
    const step = this.#c.ground().sizeM / 256;
    const [dx, dy] = this.direction(right * step, away * step);
    this.#submit(moveOps(s, dx, dy, this.#c.ground()), this.#repeated("nudge"));
  }

  step(by: number): void {
    const ids = [...(this.#c.doc.doc.value?.strokes.keys() ?? [])];
    if (ids.length === 0) return;
    const at = ids.indexOf(this.#c.selection.value ?? "");
    this.#c.selection.value = ids[at < 0 ? (by > 0 ? 0 : ids.length - 1) : (at + by + ids.length) % ids.length]!;
  }

  frame(): void {
    const s = this.stroke();
    if (s === null || s.curve.length === 0) {
      this.#c.camera.home();
      return;
    }
    const { points } = s.kind === "paint" ? drapedOf(s, this.#c.freeze()) : shapeOf(s);
    const crest = Array.from(
      { length: points.length / 3 },
      (_, i) => [...points.subarray(3 * i, 3 * i + 3)] as Stroke["first"],
    );
    this.#c.camera.frame([...crest, ...handlesOf(s, this.#c.ground(), null).map((h) => h.position)]);
  }

  /** Metres on the map of a step to the right and away, as seen on the screen. */
  direction(right: number, away: number): [number, number] {
    const { eye, target, up } = this.#c.camera.state.value;
    let [fx, fy] = [target[0] - eye[0], target[1] - eye[1]];
    if (Math.hypot(fx, fy) < 1e-6) [fx, fy] = [up[0], up[1]];
    const n = Math.hypot(fx, fy) || 1;
    return [(right * fy + away * fx) / n, (-right * fx + away * fy) / n];
  }

  #repeated(kind: string): string {
    const now = this.#c.now();
    const id = this.#c.selection.value;
    if (this.#gesture.kind !== `${kind}/${id}` || now - this.#gesture.at > GESTURE_MS)
      this.#gesture = { name: `${kind}-${id}-${Math.floor(now)}`, kind: `${kind}/${id}`, at: now };
    this.#gesture.at = now;
    return this.#gesture.name;
  }

  #submit(ops: readonly Op[], gesture?: string): boolean {
    for (const op of ops) {
      const refusal = this.#c.doc.submit(op, gesture);
      if (refusal === null) continue;
      this.#c.onMessage(refusal.message);
      return false;
    }
    return true;
  }
}
