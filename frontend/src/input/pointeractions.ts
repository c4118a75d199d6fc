/**
 * The gesture that a pointer begins when it goes down, by tool, button and what lies under it; and its course as the
 * pointer moves.
 */

import { msg } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import type { Camera } from "../core/camera/camera.ts";
import type { Ground, Vec3 } from "../core/types.ts";
import type { SyncDoc } from "../doc/sync.ts";
import type { HitTest } from "./hittest.ts";
import type { ToolId } from "./keys/action.ts";
import type { Picked, PickOrder } from "./picking.ts";
import { BESIDE_PX } from "./sketch/border.ts";
import { type OversketchTool, redraws } from "./sketch/oversketch.ts";
import type { AnyHandle, HandleSet } from "./tools/handleset.ts";
import type { Navigation, NavigationMode } from "./tools/navigation.ts";
import type { Placing } from "./tools/placement.ts";
import type { Ruler } from "./tools/ruler.ts";
import type { StrokeTool } from "./tools/stroketool.ts";

export type Activity =
  | {
      readonly kind: "press";
      readonly picked: Picked | null;
      readonly navigate: NavigationMode;
      readonly notice: string | null;
    }
  | { readonly kind: "draw" }
  /** A line that cannot begin here. Nothing moves under the pen; once it moves, it is told why. */
  | { readonly kind: "refused"; readonly notice: string }
  /** A line over the selected stroke, which takes the place of a part of it. */
  | { readonly kind: "redraw" }
  /** A point, or with movement a line, of what is measured. */
  | { readonly kind: "measure"; readonly from: Vec3 }
  | { readonly kind: "drag" }
  | { readonly kind: "navigate"; readonly mode: NavigationMode };

/** The parts of the page that pointer actions change. */
export interface PressContext {
  readonly camera: Camera;
  /** The ground as it is drawn now, held fast. */
  readonly freeze: () => Ground;
  readonly canEdit: () => boolean;
  readonly onMessage: (text: string) => void;
  readonly tool: ReadonlySignal<ToolId>;
  readonly selection: ReadonlySignal<string | null>;
  readonly placing: ReadonlySignal<Placing | null>;
  readonly fingerDraws: ReadonlySignal<boolean>;
  readonly navigation: Navigation;
  readonly hitTest: HitTest;
  readonly strokes: StrokeTool;
  readonly oversketch: OversketchTool;
  readonly doc: SyncDoc;
  readonly handleSet: HandleSet;
  readonly ruler: Ruler;
  readonly spaceHeld: () => boolean;
}

/** Number of the button that the other end of a pen stands for. */
const ERASER = 5;
/**
 * The order in which a click takes strokes: paint lies over the land like a veil, so it comes last, and the drawing
 * tools do not see it.
 */
const PICKS: Readonly<Record<ToolId, PickOrder>> = {
  select: ["land", "paint"],
  mountain: ["land"],
  crevice: ["land"],
  plateau: ["land"],
  paint: ["paint"],
  course: ["land"],
};
const VIEW_ONLY = msg("This link lets you look, not draw. Ask for an edit link to change the terrain.");
const LOCKED = msg("This stroke is locked. Unlock it to change it.");
const OFF_LAND = msg("Begin the line on the land.");

export class PointerActions {
  readonly #c: PressContext;
  #toldViewOnly = false;

  constructor(context: PressContext) {
    this.#c = context;
  }

  /** The main pointer went down at a device pixel. */
  begin(e: PointerEvent, x: number, y: number): Activity {
    const { tool, placing, strokes, handleSet, hitTest } = this.#c;
    const erases = e.button === ERASER && tool.value === "paint";
    if (e.button === 1 || (e.button === 2 && e.shiftKey) || (e.button === 0 && this.#c.spaceHeld()))
      return this.#navigate("pan", x, y);
    if (e.button !== 0 && !erases) return this.#navigate(this.#turning(), x, y);
    if (placing.value !== null) return this.#startPlacing(e, x, y);
    if (this.#c.ruler.kind.value !== null) return this.#measure(e, x, y);
    if (tool.value === "select") return this.#select(e, x, y);
    if (e.pointerType === "touch" && !this.#c.fingerDraws.value) return this.#press(null);
    if (!this.#c.canEdit()) {
      const notice = this.#toldViewOnly ? null : VIEW_ONLY;
      this.#toldViewOnly = true;
      return this.#press(null, notice);
    }
    const handle = hitTest.handle(handleSet.handles.value, e);
    if (handle !== null && !erases) return this.#drag(handle, x, y);
    if (!e.altKey && this.#redraw(e)) return { kind: "redraw" };
    const opposite = tool.value === "paint" && (erases || e.altKey);
    const beside = BESIDE_PX * hitTest.ratio;
    if (strokes.start(tool.value, hitTest.sample(e), e.pointerType === "pen", opposite, beside))
      return { kind: "draw" };
    return { kind: "refused", notice: OFF_LAND };
  }

  /** The pointer has left the place (x, y) where it went down: a press becomes a drag of the stroke or of the view. */
  moved(activity: Activity, x: number, y: number): Activity {
    if (activity.kind === "refused") this.#c.onMessage(activity.notice);
    if (activity.kind === "measure") this.#c.ruler.begin(activity.from);
    if (activity.kind !== "press") return activity;
    const { picked, navigate, notice } = activity;
    if (notice !== null) this.#c.onMessage(notice);
    if (picked !== null && picked.stroke.id === this.#c.selection.value) {
      if (picked.stroke.locked) this.#c.onMessage(LOCKED);
      else if (this.#c.canEdit()) return this.#drag({ kind: "move", position: picked.point }, x, y);
    }
    return this.#navigate(navigate, x, y);
  }

  /** Returns what lies under the pointer of the strokes that the tool shows. */
  pick(e: PointerEvent): Picked | null {
    if (this.#c.placing.value !== null || this.#c.ruler.kind.value !== null) return null;
    return this.#c.hitTest.stroke(e, this.#c.freeze(), PICKS[this.#c.tool.value]);
  }

  /** Says whether a line begun here would redraw a part of the selected one. */
  over(e: PointerEvent): boolean {
    if (this.#c.ruler.kind.value !== null) return false;
    const { doc, selection, tool, hitTest, oversketch } = this.#c;
    const stroke = doc.doc.value?.strokes.get(selection.value ?? "");
    if (stroke === undefined || e.altKey || !redraws(tool.value, stroke)) return false;
    return oversketch.would(stroke, hitTest.sample(e), hitTest.near(e), hitTest.ratio);
  }

  /** Says whether the pen came down on the line of the selected stroke, with the tool that draws such lines. */
  #redraw(e: PointerEvent): boolean {
    const { doc, selection, tool, hitTest, oversketch } = this.#c;
    const stroke = doc.doc.value?.strokes.get(selection.value ?? "");
    if (stroke === undefined || !redraws(tool.value, stroke)) return false;
    return oversketch.start(stroke, hitTest.sample(e), hitTest.near(e), hitTest.ratio);
  }

  #navigate(mode: NavigationMode, x: number, y: number): Activity {
    this.#c.navigation.begin(mode, x, y);
    return { kind: "navigate", mode };
  }

  /** Nothing yet: a click, or with movement a drag of the picked stroke or of the view, which `notice` then explains. */
  #press(picked: Picked | null, notice: string | null = null): Activity {
    const map = this.#c.camera.state.value.mode === "map";
    return { kind: "press", picked, navigate: map ? "pan" : this.#turning(), notice };
  }

  #turning(): NavigationMode {
    return this.#c.camera.state.value.mode === "fly" ? "look" : "orbit";
  }

  #select(e: PointerEvent, x: number, y: number): Activity {
    const handle = this.#c.hitTest.handle(this.#c.handleSet.handles.value, e);
    return handle !== null ? this.#drag(handle, x, y) : this.#press(this.pick(e));
  }

  /** Something is measured: its points, then the ground. A finger that does not draw moves the view. */
  #measure(e: PointerEvent, x: number, y: number): Activity {
    const { handleSet, hitTest, navigation } = this.#c;
    const handle = hitTest.handle(handleSet.handles.value, e);
    if (handle !== null) return this.#drag(handle, x, y);
    if (e.pointerType === "touch" && !this.#c.fingerDraws.value) return this.#press(null);
    const from = navigation.hit(x, y);
    return from === null ? { kind: "refused", notice: OFF_LAND } : { kind: "measure", from };
  }

  /** A grid is being placed: its handles, then its ground, then the view. */
  #startPlacing(e: PointerEvent, x: number, y: number): Activity {
    const { handleSet, hitTest, navigation } = this.#c;
    const held = hitTest.handle(handleSet.handles.value, e) ?? handleSet.ground(navigation.hit(x, y));
    return held !== null && this.#c.canEdit() ? this.#drag(held, x, y) : this.#press(null);
  }

  #drag(handle: Pick<AnyHandle, "kind" | "position">, x: number, y: number): Activity {
    this.#c.handleSet.start(handle, x, y);
    return { kind: "drag" };
  }
}
