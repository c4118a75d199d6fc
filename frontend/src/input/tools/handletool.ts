/** Dragging a handle of the selected stroke: live, at most 30 ops a second, one gesture (DESIGN 12). */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { Camera } from "../../core/camera/camera.ts";
import type { Ground } from "../../core/types.ts";
import type { SyncDoc } from "../../doc/sync.ts";
import { type Stroke, TICK_MS } from "../../generated/contract.ts";
import type { Say } from "../say.ts";
import { HandleDrag } from "./handledrag.ts";
import type { HandleKind, HandleVisual } from "./handles.ts";

export interface HandleToolOptions {
  readonly camera: Camera;
  readonly doc: SyncDoc;
  readonly freeze: () => Ground;
  readonly onMessage: Say;
  /** Milliseconds. */
  readonly now: () => number;
}

interface Session {
  readonly drag: HandleDrag;
  readonly gesture: string;
  x: number;
  y: number;
  both: boolean;
  sentAt: number;
}

export class HandleTool {
  /** The handle that is hovered or dragged. */
  readonly #active = signal<HandleKind | null>(null);
  readonly #o: HandleToolOptions;
  #session: Session | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #gestures = 0;

  constructor(options: HandleToolOptions) {
    this.#o = options;
  }

  get active(): ReadonlySignal<HandleKind | null> {
    return this.#active;
  }

  /** Shows which handle the pointer would take. */
  hover(kind: HandleKind | null): void {
    if (this.#session === null) this.#active.value = kind;
  }

  /** Takes a handle at a device pixel; the ground is frozen for this drag. */
  start(stroke: Stroke, handle: Pick<HandleVisual, "kind" | "position">, x: number, y: number): void {
    const { camera, freeze, now } = this.#o;
    this.#gestures += 1;
    this.#session = {
      drag: new HandleDrag({ stroke, handle, camera, ground: freeze(), x, y }),
      gesture: `drag-${stroke.id}-${this.#gestures}-${Math.floor(now())}`,
      x,
      y,
      both: true,
      sentAt: -Infinity,
    };
    this.#active.value = handle.kind;
  }

  /** Moves the handle; `both` drags equal flanks together. */
  move(x: number, y: number, both: boolean): void {
    const session = this.#session;
    if (session === null) return;
    Object.assign(session, { x, y, both });
    if (this.#timer !== undefined) return;
    const wait = session.sentAt + TICK_MS - this.#o.now();
    if (wait <= 0) this.#submit(session);
    else
      this.#timer = setTimeout(() => {
        this.#timer = undefined;
        this.#submit(session);
      }, wait);
  }

  /** Lets go: the last place always arrives. */
  finish(): void {
    const session = this.#session;
    if (session !== null) this.#submit(session);
    this.#clear();
  }

  /** Lets go and takes back what the drag has changed. */
  cancel(): void {
    const changed = this.#session !== null && this.#session.sentAt > -Infinity;
    this.#clear();
    if (changed) this.#o.doc.undo();
  }

  #submit(session: Session): void {
    session.sentAt = this.#o.now();
    for (const op of session.drag.ops(session.x, session.y, session.both)) {
      const refusal = this.#o.doc.submit(op, session.gesture);
      if (refusal === null) continue;
      this.#o.onMessage(refusal.message, { code: refusal.code, op });
      this.#clear();
      return;
    }
  }

  #clear(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#session = null;
    this.#active.value = null;
  }
}
