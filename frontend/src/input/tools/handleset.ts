/** Whatever can be taken hold of: the handles of the selected stroke, or of the grid that is being placed. */

import { computed, type ReadonlySignal, type Signal } from "@preact/signals-core";
import type { Ground } from "../../core/types.ts";
import type { Stroke } from "../../generated/contract.ts";
import type { ToolId } from "../keys/action.ts";
import { GridTool } from "./gridtool.ts";
import { type HandleKind, type HandleVisual, handlesOf } from "./handles.ts";
import { HandleTool, type HandleToolOptions } from "./handletool.ts";
import { type GridHandle, type GridHandleKind, gridAt, gridHandles, type Placing } from "./placement.ts";
import type { Ruler, RulerHandle } from "./ruler.ts";

export type AnyHandle = HandleVisual | GridHandle | RulerHandle;
type Held = Pick<AnyHandle, "kind" | "position">;

export interface HandleSetOptions extends HandleToolOptions {
  readonly ruler: Ruler;
  readonly ground: () => Ground;
  readonly canEdit: () => boolean;
  readonly tool: Signal<ToolId>;
  readonly selection: Signal<string | null>;
  readonly placing: Signal<Placing | null>;
}

const isGrid = (kind: AnyHandle["kind"]): kind is GridHandleKind => kind.startsWith("grid-");

export class HandleSet {
  readonly handles: ReadonlySignal<readonly AnyHandle[]>;
  readonly #o: HandleSetOptions;
  readonly #strokes: HandleTool;
  readonly #grids: GridTool;

  constructor(options: HandleSetOptions) {
    this.#o = options;
    this.#strokes = new HandleTool(options);
    this.#grids = new GridTool({ ...options, sizeM: options.ground().sizeM });
    this.handles = computed(() => this.#visible());
  }

  /** The grid that has the pointer to itself while it is laid. */
  get placing(): Placing | null {
    return this.#o.placing.value;
  }

  hover(kind: AnyHandle["kind"] | null): void {
    if (kind === "ruler") return;
    this.#grids.hover(kind !== null && isGrid(kind) ? kind : null);
    this.#strokes.hover(kind !== null && !isGrid(kind) ? (kind as HandleKind) : null);
  }

  /** Takes a handle at a device pixel. */
  start(held: Held, x: number, y: number): void {
    const { kind, position } = held;
    if (kind === "ruler") this.#o.ruler.take({ position });
    else if (isGrid(kind)) this.#grids.start(this.placing!, { kind, position }, x, y);
    else this.#strokes.start(this.#stroke()!, { kind: kind as HandleKind, position }, x, y);
  }

  /** Returns the hold on the grid's own ground, where a ray meets it: that moves the grid. Null beside the grid. */
  ground(hit: readonly [number, number, number] | null): Held | null {
    return this.placing !== null && hit !== null && gridAt(this.placing, hit)
      ? { kind: "grid-move", position: hit }
      : null;
  }

  move(x: number, y: number, regular: boolean): void {
    if (this.#measures) {
      this.#o.ruler.move(this.#o.ground().raycast(this.#o.camera.ray(x, y)));
      return;
    }
    this.#grids.move(x, y, regular);
    this.#strokes.move(x, y, regular);
  }

  finish(): void {
    if (this.#measures) this.#o.ruler.finish(0);
    this.#grids.finish();
    this.#strokes.finish();
  }

  cancel(): void {
    if (this.#measures) this.#o.ruler.cancel();
    else if (this.#grids.dragging) this.#grids.cancel();
    else this.#strokes.cancel();
  }

  get #measures(): boolean {
    return this.#o.ruler.kind.peek() !== null && this.#o.placing.peek() === null;
  }

  #stroke(): Stroke | null {
    return this.#o.doc.doc.value?.strokes.get(this.#o.selection.value ?? "") ?? null;
  }

  #visible(): readonly AnyHandle[] {
    // One may measure with a link that only looks.
    if (this.#o.ruler.kind.value !== null && this.placing === null) return this.#o.ruler.handles(this.#o.ground());
    if (!this.#o.canEdit()) return [];
    const placing = this.placing;
    const map = this.#o.camera.state.value.mode === "map";
    if (placing !== null) return gridHandles(placing, this.#o.ground(), this.#grids.active.value, map);
    const stroke = this.#stroke();
    const tool = this.#o.tool.value;
    const inHand = tool === "select" || (tool === "paint" && stroke?.kind === "paint");
    return stroke === null || stroke.locked || !inHand
      ? []
      : handlesOf(stroke, this.#o.ground(), this.#strokes.active.value);
  }
}
