/** A panel that floats on the picture must not lie on the handles of what is selected: the view makes room. */

import type { Camera } from "../core/camera.ts";
import { addScaled, cross, mix3, normalize, sub } from "../core/math.ts";
import type { Vec3 } from "../core/types.ts";

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

/** By how many CSS pixels the picture must go to the left so that no point lies under the panel at the right. */
export function roomNeeded(points: readonly Pixel[], panel: Box): number {
  const hidden = points.filter((p) => p.x > panel.left - MARGIN_PX && p.y > panel.top && p.y < panel.bottom);
  if (hidden.length === 0) return 0;
  const need = Math.max(...hidden.map((p) => p.x)) - panel.left + MARGIN_PX;
  // What is selected is not pushed out at the other side.
  return Math.max(0, Math.min(need, Math.min(...points.map((p) => p.x)) - TOOLS_PX));
}

/** Glides to the right by so many device pixels, as seen at a place; the direction of the view stays. */
export function glide(camera: Camera, px: number, at: Vec3): void {
  const { eye, target, up } = camera.state.peek();
  const right = normalize(cross(sub(target, eye), up));
  const way = px * camera.metresPerPixelAt(at);
  camera.goTo(addScaled(eye, right, way), addScaled(target, right, way), GLIDE_MS);
}

/** Makes room for handles, given where they are in the world and in the window. `ratio`: device pixels for a CSS pixel. */
export function makeRoom(
  camera: Camera,
  handles: readonly { readonly position: Vec3 }[],
  toWindow: (p: Vec3) => Pixel & { readonly visible: boolean },
  panel: Box,
  ratio: number,
): void {
  const seen = handles.map((h) => ({ ...toWindow(h.position), position: h.position })).filter((p) => p.visible);
  const need = roomNeeded(seen, panel);
  if (need < 1 || camera.moving) return;
  const middle = seen.reduce((m, p, i) => mix3(m, p.position, 1 / (i + 1)), seen[0]!.position);
  glide(camera, need * ratio, middle);
}
