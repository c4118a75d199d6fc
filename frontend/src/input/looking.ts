/** The hands of a page where one only looks: pointers, fingers, the wheel and keys move one camera, on whichever picture they are. */

import type { Camera } from "../core/camera/camera.ts";
import type { Ground } from "../core/types.ts";
import { takePointer } from "./hittest.ts";
import { combination, meantForCanvas } from "./keys/keyboard.ts";
import { type Finger, Navigation } from "./tools/navigation.ts";

/** A place of the page where the camera's picture is, and the ground that it shows. */
export interface LookedAt {
  readonly element: HTMLElement;
  readonly ground: () => Ground;
}

/** An arrow key moves the view by this share of the picture's height. */
const ARROW_SHARE = 0.06;

export class Looking {
  readonly #camera: Camera;
  readonly #navigation: Navigation;
  readonly #abort = new AbortController();
  readonly #fingers = new Map<number, Finger>();
  /** The picture on which the gesture began: what it points at lies on that one's ground. */
  #on: LookedAt;
  #dragging: number | null = null;

  constructor(camera: Camera, pictures: readonly LookedAt[]) {
    this.#camera = camera;
    this.#on = pictures[0]!;
    this.#navigation = new Navigation(camera, () => this.#on.ground());
    for (const picture of pictures) this.#listen(picture);
    window.addEventListener("keydown", (e) => this.#key(e), { signal: this.#abort.signal });
  }

  dispose(): void {
    this.#abort.abort();
    this.#navigation.dispose();
  }

  #listen(picture: LookedAt): void {
    const { element } = picture;
    const { signal } = this.#abort;
    element.style.touchAction = "none";
    element.addEventListener("pointerdown", (e) => this.#down(picture, e), { signal });
    element.addEventListener("pointermove", (e) => this.#move(e), { signal });
    for (const end of ["pointerup", "pointercancel"] as const)
      element.addEventListener(end, (e) => this.#up(e), { signal });
    element.addEventListener("contextmenu", (e) => e.preventDefault(), { signal });
    element.addEventListener("dblclick", (e) => this.#navigation.flyTo(...this.#pixel(picture, e)), { signal });
    const wheel = (e: WheelEvent): void => {
      e.preventDefault();
      if (this.#dragging === null && this.#fingers.size === 0) this.#on = picture;
      this.#navigation.wheel(e.deltaY, e.deltaMode, e.ctrlKey, ...this.#pixel(picture, e));
    };
    element.addEventListener("wheel", wheel, { signal, passive: false });
  }

  /** Device pixels from the corner of a picture. */
  #pixel({ element }: LookedAt, e: MouseEvent): [number, number] {
    const box = element.getBoundingClientRect();
    const { width, height } = this.#camera.state.peek();
    return [
      ((e.clientX - box.left) * width) / Math.max(1, box.width),
      ((e.clientY - box.top) * height) / Math.max(1, box.height),
    ];
  }

  #down(picture: LookedAt, e: PointerEvent): void {
    if (this.#dragging === null && this.#fingers.size === 0) this.#on = picture;
    const [x, y] = this.#pixel(this.#on, e);
    takePointer(picture.element, e.pointerId);
    if (e.pointerType === "touch") {
      this.#fingers.set(e.pointerId, { id: e.pointerId, x, y });
      const [a, b] = [...this.#fingers.values()];
      if (a !== undefined && b !== undefined) {
        this.#dragging = null;
        if (this.#fingers.size === 2) this.#navigation.beginPinch(a, b);
        return;
      }
    }
    if (this.#dragging !== null) return;
    this.#dragging = e.pointerId;
    const pans = this.#camera.state.peek().mode === "map" || e.button === 1 || e.shiftKey;
    this.#navigation.begin(pans ? "pan" : "orbit", x, y);
  }

  #move(e: PointerEvent): void {
    const [x, y] = this.#pixel(this.#on, e);
    const finger = this.#fingers.get(e.pointerId);
    if (finger !== undefined) Object.assign(finger, { x, y });
    if (this.#navigation.mode === "pinch") {
      const [a, b] = [...this.#fingers.values()];
      if (finger !== undefined && a !== undefined && b !== undefined) this.#navigation.pinch(a, b);
    } else if (e.pointerId === this.#dragging) this.#navigation.drag(x, y);
  }

  #up(e: PointerEvent): void {
    this.#fingers.delete(e.pointerId);
    if (this.#navigation.mode === "pinch") this.#navigation.endPinch();
    if (e.pointerId !== this.#dragging) return;
    this.#dragging = null;
    this.#navigation.end();
  }

  #key(e: KeyboardEvent): void {
    if (!meantForCanvas(e)) return;
    const run = this.#keys[combination(e)];
    if (run === undefined) return;
    e.preventDefault();
    run();
  }

  readonly #arrow = (right: number, away: number): void => {
    const step = ARROW_SHARE * this.#camera.state.peek().height;
    this.#camera.pan(-right * step, away * step, this.#on.ground());
  };

  /** The keys of the terrain's page, as far as they move the view. */
  readonly #keys: Readonly<Record<string, () => void>> = {
    ArrowLeft: () => this.#arrow(-1, 0),
    ArrowRight: () => this.#arrow(1, 0),
    ArrowUp: () => this.#arrow(0, 1),
    ArrowDown: () => this.#arrow(0, -1),
    "+": () => this.#camera.zoom(1.25, undefined, true),
    "=": () => this.#camera.zoom(1.25, undefined, true),
    "-": () => this.#camera.zoom(0.8, undefined, true),
    ",": () => this.#camera.twist(-15),
    ".": () => this.#camera.twist(15),
    "'": () => this.#camera.north(),
    Home: () => this.#camera.home(),
  };
}
