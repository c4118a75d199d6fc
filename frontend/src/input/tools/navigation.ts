/** Moving the camera with pointers, wheel and keys. Knows no strokes. */

import type { Camera } from "../../core/camera/camera.ts";
import { along, rayPlane } from "../../core/geometry.ts";
import { distance, wrapAngle } from "../../core/math.ts";
import type { Ground, Vec3 } from "../../core/types.ts";

export type NavigationMode = "orbit" | "look" | "pan" | "pinch";

export interface Finger {
  readonly id: number;
  x: number;
  y: number;
}

interface Pinch {
  readonly a: Finger;
  readonly b: Finger;
  readonly anchor: Vec3 | undefined;
}

/** A wheel notch of 100 pixels magnifies by this much. */
const NOTCH = 1.22;
const LINE_PX = 33;
/** Near the horizon a pixel covers kilometres: beyond this many times the grabbed distance the ground is not held. */
const FAR = 3;

export class Navigation {
  readonly #camera: Camera;
  readonly #ground: () => Ground;
  #drag: { mode: NavigationMode; x: number; y: number; grabbed: Vec3 | null } | null = null;
  #pinch: Pinch | null = null;
  readonly #flying = new Map<string, number>();
  #frame = 0;

  constructor(camera: Camera, ground: () => Ground) {
    this.#camera = camera;
    this.#ground = ground;
  }

  get mode(): NavigationMode | null {
    return this.#pinch !== null ? "pinch" : (this.#drag?.mode ?? null);
  }

  /** Starts a drag at a device pixel: a pan holds the ground there, an orbit turns about the ground in the middle. */
  begin(mode: NavigationMode, x: number, y: number): void {
    const { width, height } = this.#camera.state.value;
    const grabbed = mode === "pan" ? this.hit(x, y) : this.hit(width / 2, height / 2);
    this.#drag = { mode, x, y, grabbed };
    if (grabbed !== null && mode !== "look") this.#camera.pivotAt(grabbed);
  }

  drag(x: number, y: number): void {
    const drag = this.#drag;
    if (drag === null) return;
    const dx = x - drag.x;
    const dy = y - drag.y;
    drag.x = x;
    drag.y = y;
    if (drag.mode === "pan") this.#hold(drag.grabbed, x, y, dx, dy);
    else if (drag.mode === "look") this.#camera.look(dx, dy);
    else this.#camera.orbit(dx, dy);
  }

  /** Brings the grabbed point under the pixel; over the horizon, or with nothing grabbed, pans by the pixels moved. */
  #hold(grabbed: Vec3 | null, x: number, y: number, dx: number, dy: number): void {
    const ray = this.#camera.ray(x, y);
    const t = grabbed === null ? null : rayPlane(ray, grabbed, [0, 0, 1]);
    const to = t === null ? null : along(ray, t);
    const { eye } = this.#camera.state.value;
    if (grabbed !== null && to !== null && distance(eye, to) < FAR * distance(eye, grabbed))
      this.#camera.translate(grabbed[0] - to[0], grabbed[1] - to[1]);
    else this.#camera.pan(dx, dy, this.#ground());
  }

  end(): void {
    this.#drag = null;
  }

  /** Two fingers: their middle pans, their distance zooms about the ground between them, their angle turns. */
  beginPinch(a: Finger, b: Finger): void {
    this.#drag = null;
    const anchor = this.hit((a.x + b.x) / 2, (a.y + b.y) / 2);
    if (anchor !== null) this.#camera.pivotAt(anchor);
    this.#pinch = { a: { ...a }, b: { ...b }, anchor: anchor ?? undefined };
  }

  pinch(a: Finger, b: Finger): void {
    const pinch = this.#pinch;
    if (pinch === null) return;
    const { a: a0, b: b0 } = pinch;
    const before = Math.max(8, Math.hypot(b0.x - a0.x, b0.y - a0.y));
    const after = Math.max(8, Math.hypot(b.x - a.x, b.y - a.y));
    const turned = Math.atan2(b.y - a.y, b.x - a.x) - Math.atan2(b0.y - a0.y, b0.x - a0.x);
    this.#camera.zoom(after / before, pinch.anchor);
    this.#camera.twist(-(wrapAngle(turned) * 180) / Math.PI);
    const [x, y] = [(a.x + b.x) / 2, (a.y + b.y) / 2];
    this.#hold(pinch.anchor ?? null, x, y, x - (a0.x + b0.x) / 2, y - (a0.y + b0.y) / 2);
    Object.assign(a0, a);
    Object.assign(b0, b);
  }

  endPinch(): void {
    this.#pinch = null;
  }

  /** Zooms toward the pixel; a notched wheel is smoothed, a trackpad is smooth already. */
  wheel(deltaY: number, deltaMode: number, pinching: boolean, x: number, y: number): void {
    const pixels = deltaY * (deltaMode === 1 ? LINE_PX : deltaMode === 2 ? 800 : 1);
    const factor = NOTCH ** ((-pixels / 100) * (pinching ? 6 : 1));
    this.#camera.zoom(Math.max(0.2, Math.min(5, factor)), this.hit(x, y) ?? undefined, Math.abs(pixels) >= 50);
  }

  /** Flies to the ground under the pixel: half the distance, same direction. */
  flyTo(x: number, y: number): void {
    const point = this.hit(x, y);
    if (point === null) return;
    const { eye, target, mode } = this.#camera.state.value;
    const half = (i: 0 | 1 | 2): number => point[i] + (eye[i] - target[i]) / 2;
    this.#camera.goTo(mode === "map" ? [point[0], point[1], half(2)] : [half(0), half(1), half(2)], point, 500);
  }

  /** Ground under a device pixel, as it is drawn now. */
  hit(x: number, y: number): Vec3 | null {
    return this.#ground().raycast(this.#camera.ray(x, y));
  }

  /** A flight key went down (speed 1, or more to sprint) or up (0); true when it is one. */
  flightKey(key: string, speed: number): boolean {
    if (!FLIGHT.has(key)) return false;
    if (speed === 0) this.#flying.delete(key);
    else this.#flying.set(key, speed);
    if (this.#flying.size > 0 && this.#frame === 0) this.#nextFrame(performance.now());
    return true;
  }

  /** Lets go of all flight keys. */
  stopFlight(): void {
    this.#flying.clear();
  }

  dispose(): void {
    this.stopFlight();
    cancelAnimationFrame(this.#frame);
  }

  #nextFrame(lastMs: number): void {
    this.#frame = requestAnimationFrame((nowMs) => {
      this.#frame = 0;
      if (this.#flying.size === 0 || this.#camera.state.value.mode !== "fly") return;
      let [forward, right, up] = [0, 0, 0];
      for (const [key, speed] of this.#flying) {
        const [f, r, u] = FLIGHT.get(key)!;
        forward += f * speed;
        right += r * speed;
        up += u * speed;
      }
      this.#camera.fly(forward, right, up, Math.max(0, Math.min(0.1, (nowMs - lastMs) / 1000)));
      this.#nextFrame(nowMs);
    });
  }
}

/** Flight keys as (forward, right, up). */
const FLIGHT: ReadonlyMap<string, readonly [number, number, number]> = new Map([
  ["w", [1, 0, 0]],
  ["s", [-1, 0, 0]],
  ["d", [0, 1, 0]],
  ["a", [0, -1, 0]],
  ["e", [0, 0, 1]],
  ["q", [0, 0, -1]],
] as const);
