/** Dragging a handle of a grid that is being placed: live, at most 30 changes a second, one gesture. */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { Camera } from "../../core/camera/camera.ts";
import { type GridPlace, rounded, samePlace } from "../../core/lattice.ts";
import { TICK_MS } from "../../generated/contract.ts";
import { GridDrag, type GridHandle, type GridHandleKind, type Placing } from "./placement.ts";

export interface GridToolOptions {
  readonly camera: Camera;
  readonly sizeM: number;
  readonly onMessage: (text: string) => void;
  /** Milliseconds. */
  readonly now: () => number;
}

interface Session {
  readonly placing: Placing;
  readonly from: GridPlace;
  readonly drag: GridDrag;
  readonly gesture: string;
  x: number;
  y: number;
  regular: boolean;
  sentAt: number;
}

export class GridTool {
  readonly #active = signal<GridHandleKind | null>(null);
  readonly #o: GridToolOptions;
  #session: Session | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #gestures = 0;

  constructor(options: GridToolOptions) {
    this.#o = options;
  }

  /** The handle that is hovered or dragged. */
  get active(): ReadonlySignal<GridHandleKind | null> {
    return this.#active;
  }

  get dragging(): boolean {
    return this.#session !== null;
  }

  hover(kind: GridHandleKind | null): void {
    if (this.#session === null) this.#active.value = kind;
  }

  /** Takes a handle at a device pixel. */
  start(placing: Placing, handle: Pick<GridHandle, "kind" | "position">, x: number, y: number): void {
    const { camera, sizeM, now } = this.#o;
    this.#gestures += 1;
    this.#session = {
      placing,
      from: placing.place.peek(),
      drag: new GridDrag({ placing, handle, camera, sizeM, x, y }),
      gesture: `place-${placing.id}-${this.#gestures}-${Math.floor(now())}`,
      x,
      y,
      regular: true,
      sentAt: -Infinity,
    };
    this.#active.value = handle.kind;
  }

  move(x: number, y: number, regular: boolean): void {
    const session = this.#session;
    if (session === null) return;
    Object.assign(session, { x, y, regular });
    if (this.#timer !== undefined) return;
    const wait = session.sentAt + TICK_MS - this.#o.now();
    if (wait <= 0) this.#moveTo(session);
    else
      this.#timer = setTimeout(() => {
        this.#timer = undefined;
        this.#moveTo(session);
      }, wait);
  }

  /** Lets go: the last place always arrives. */
  finish(): void {
    if (this.#session !== null) this.#moveTo(this.#session);
    this.#clear();
  }

  /** Lets go and puts the grid back where the drag took it up. */
  cancel(): void {
    const session = this.#session;
    this.#clear();
    if (session !== null && !samePlace(session.placing.place.peek(), session.from))
      session.placing.moveTo(session.from, session.gesture);
  }

  #moveTo(session: Session): void {
    session.sentAt = this.#o.now();
    const place = session.drag.place(session.x, session.y, session.regular);
    if (place === null) return;
    const next = rounded(place);
    if (samePlace(next, session.placing.place.peek())) return;
    const refusal = session.placing.moveTo(next, session.gesture);
    if (refusal === null) return;
    this.#o.onMessage(refusal);
    this.#clear();
  }

  #clear(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#session = null;
    this.#active.value = null;
  }
}
