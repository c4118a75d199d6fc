/** From events in CSS pixels to device pixels, rays and what lies under them: the DOM's edge of the input room. */

import type { Camera } from "../core/camera/camera.ts";
import type { Ground } from "../core/types.ts";
import type { SyncDoc } from "../doc/sync.ts";
import { type Picked, type PickOrder, pickHandle, pickStroke } from "./picking.ts";
import type { Sample } from "./sketch/sketch.ts";
import type { AnyHandle } from "./tools/handleset.ts";

/** How near is a hit, in CSS pixels, by what points. */
const STROKE_PX = { fine: 12, touch: 24 } as const;
const HANDLE_PX = { fine: 14, touch: 24 } as const;

export class HitTest {
  readonly #canvas: HTMLElement;
  readonly #camera: Camera;
  readonly #doc: SyncDoc;

  constructor(canvas: HTMLElement, camera: Camera, doc: SyncDoc) {
    this.#canvas = canvas;
    this.#camera = camera;
    this.#doc = doc;
  }

  /** Device pixels per CSS pixel, from what the camera believes and the box that is on the screen. */
  get ratio(): number {
    return this.#camera.state.value.width / Math.max(1, this.#canvas.getBoundingClientRect().width);
  }

  /** Device pixels from the top left corner of the canvas. */
  pixel(e: MouseEvent): [number, number] {
    const box = this.#canvas.getBoundingClientRect();
    const { width, height } = this.#camera.state.value;
    return [
      ((e.clientX - box.left) * width) / Math.max(1, box.width),
      ((e.clientY - box.top) * height) / Math.max(1, box.height),
    ];
  }

  sample(e: PointerEvent): Sample {
    const [x, y] = this.pixel(e);
    const pressure = e.pointerType === "pen" && e.pressure > 0 ? e.pressure : 0.5;
    return { x, y, ray: this.#camera.ray(x, y), pressure };
  }

  /** Every position since the last event; browsers without coalesced events give this one. */
  samples(e: PointerEvent): Sample[] {
    const events = typeof e.getCoalescedEvents === "function" ? e.getCoalescedEvents() : [];
    return (events.length > 0 ? events : [e]).map((s) => this.sample(s));
  }

  /** Where the browser thinks the pointer will be: for ink only. */
  predicted(e: PointerEvent): Sample[] {
    return typeof e.getPredictedEvents === "function" ? e.getPredictedEvents().map((s) => this.sample(s)) : [];
  }

  /** The stroke under the pointer, of the kinds in `order`, the first kind first. */
  stroke(e: PointerEvent, ground: Ground, order: PickOrder): Picked | null {
    const doc = this.#doc.doc.value;
    if (doc === null) return null;
    const [x, y] = this.pixel(e);
    return pickStroke(doc, this.#camera, ground, x, y, STROKE_PX[reachOf(e)] * this.ratio, order);
  }

  /** How near to a line counts as on it, CSS pixels. */
  near(e: PointerEvent): number {
    return STROKE_PX[reachOf(e)];
  }

  handle(handles: readonly AnyHandle[], e: PointerEvent): AnyHandle | null {
    const [x, y] = this.pixel(e);
    return pickHandle(handles, this.#camera, x, y, HANDLE_PX[reachOf(e)] * this.ratio);
  }
}

function reachOf(e: PointerEvent): "fine" | "touch" {
  return e.pointerType === "touch" ? "touch" : "fine";
}

/**
 * Follows the pointer outside the element, and takes the focus from whatever field had it, so that its edit is
 * committed and the keys come to the terrain. (Events made by scripts have no pointer to capture.)
 */
export function takePointer(element: HTMLElement, pointerId: number): void {
  let focused: Element | null = document.activeElement;
  while (focused?.shadowRoot?.activeElement) focused = focused.shadowRoot.activeElement;
  if (focused instanceof HTMLElement && focused !== document.body && !focused.contains(element)) focused.blur();
  try {
    element.setPointerCapture(pointerId);
  } catch {
    // Without capture the gesture ends at the border of the element. Nothing else depends on the capture.
  }
}
