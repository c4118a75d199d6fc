/** A panel that floats on the picture must not lie on the handles of what is selected: the view makes room. */

import type { Camera } from "../../core/camera/camera.ts";
import { addScaled, cross, distance, mix3, normalize, sub } from "../../core/math.ts";
import type { Vec3 } from "../../core/types.ts";

/** CSS pixels of the window. */
export interface Box {
  readonly left: number;
  readonly top: number;
  readonly bottom: number;
}

export interface Pixel {
  readonly x: number;
  readonly y: number;
}

/** Handles keep this far from a panel, and from the tools at the left. */
const MARGIN_PX = 28;
const TOOLS_PX = 84;
const GLIDE_MS = 260;
/** Views that differ by less than this share of their distance are the same. */
const NEAR = 1e-3;

/**
 * Returns by how many CSS pixels the picture must go to the left so that no point lies under the panel at the right.
 */
export function roomNeeded(points: readonly Pixel[], panel: Box): number {
  const hidden = points.filter((p) => p.x > panel.left - MARGIN_PX && p.y > panel.top && p.y < panel.bottom);
  if (hidden.length === 0) return 0;
  const need = Math.max(...hidden.map((p) => p.x)) - panel.left + MARGIN_PX;
  // The selected stroke is not pushed out at the other side.
  return Math.max(0, Math.min(need, Math.min(...points.map((p) => p.x)) - TOOLS_PX));
}

/** A view: where the eye is and what it looks at. */
interface View {
  readonly eye: Vec3;
  readonly target: Vec3;
}

/** Glides to the right by so many device pixels, as seen at a place; the direction of the view stays. Where it goes. */
export function glide(camera: Camera, px: number, at: Vec3): View {
  const { eye, target, up } = camera.state.peek();
  const right = normalize(cross(sub(target, eye), up));
  const way = px * camera.metresPerPixelAt(at);
  const to: View = { eye: addScaled(eye, right, way), target: addScaled(target, right, way) };
  camera.goTo(to.eye, to.target, GLIDE_MS);
  return to;
}

/** Makes room for the handles of a selection, and gives it back when the selection goes, unless the view was moved since. */
export class Room {
  readonly #camera: Camera;
  #before: View | null = null;
  #after: View | null = null;

  constructor(camera: Camera) {
    this.#camera = camera;
  }

  /**
   * Glides until no handle lies under the panel, given where handles are in the world and in the window. `ratio`: device
   * pixels for a CSS pixel.
   */
  make(
    handles: readonly { readonly position: Vec3 }[],
    toWindow: (p: Vec3) => Pixel & { readonly visible: boolean },
    panel: Box,
    ratio: number,
  ): void {
    const seen = handles.map((h) => ({ ...toWindow(h.position), position: h.position })).filter((p) => p.visible);
    const need = roomNeeded(seen, panel);
    if (need < 1 || this.#camera.moving) return;
    const middle = seen.reduce((m, p, i) => mix3(m, p.position, 1 / (i + 1)), seen[0]!.position);
    // A second selection shifts the view further: what is given back is all of it.
    if (!this.#isThere()) this.#before = this.#view();
    this.#after = glide(this.#camera, need * ratio, middle);
  }

  /** Glides back to where the view was before room was made. */
  giveBack(): void {
    const before = this.#before;
    if (before !== null && this.#isThere()) this.#camera.goTo(before.eye, before.target, GLIDE_MS);
    this.#before = this.#after = null;
  }

  #view(): View {
    const { eye, target } = this.#camera.state.peek();
    return { eye, target };
  }

  /** Says whether the view is the one that this class chose, or on its way there: nobody has moved it since. */
  #isThere(): boolean {
    const after = this.#after;
    if (after === null) return false;
    const { eye, target } = this.#camera.destination();
    return distance(eye, after.eye) + distance(target, after.target) < NEAR * distance(eye, target);
  }
}
