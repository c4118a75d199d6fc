/** Where places are in a pose's picture, and what is seen at a pixel of it. Pixels are device pixels from the top left corner. Pure. */

import { addScaled, DEG, dot, normalize, sub } from "../math.ts";
import type { Ray, Vec3 } from "../types.ts";
import { type Pose, poseBasis, poseEye } from "./state.ts";

export interface Projection {
  /** Device pixels from the top left corner. */
  readonly x: number;
  readonly y: number;
  /** Metres along the view direction; negative behind the eye. */
  readonly depth: number;
  /** In front of the eye and inside the canvas. (Nothing is said about ground in between.) */
  readonly visible: boolean;
}

/** A canvas, device pixels. */
export interface Canvas {
  readonly width: number;
  readonly height: number;
}

const tangent = (pose: Pose): number => Math.tan((pose.fovDeg * DEG) / 2);

/** Metres that one device pixel covers at the pivot. */
export function metresPerPixel(pose: Pose, { height }: Canvas): number {
  return (2 * pose.distanceM * tangent(pose)) / height;
}

/** Metres that one device pixel covers at a world point. */
export function metresPerPixelAt(pose: Pose, canvas: Canvas, p: Vec3): number {
  if (pose.mode === "map") return metresPerPixel(pose, canvas);
  const depth = Math.max(0.1, dot(sub(p, poseEye(pose)), poseBasis(pose).forward));
  return (2 * depth * tangent(pose)) / canvas.height;
}

/** The ray through a device pixel. `topM`: nothing is higher. */
export function rayThrough(pose: Pose, canvas: Canvas, xPx: number, yPx: number, topM: number): Ray {
  const { forward, right, up } = poseBasis(pose);
  const { width, height } = canvas;
  const nx = (2 * xPx) / width - 1;
  const ny = 1 - (2 * yPx) / height;
  const t = tangent(pose);
  const aspect = width / height;
  const eye = poseEye(pose);
  if (pose.mode === "map") {
    const half = pose.distanceM * t;
    const onPlane = addScaled(addScaled(eye, right, nx * half * aspect), up, ny * half);
    // Start above everything: the eye of a close map view may be lower than a summit beside it.
    return {
      origin: [onPlane[0], onPlane[1], onPlane[2] + topM],
      dir: forward,
      spread: [metresPerPixel(pose, canvas), 0],
    };
  }
  const dir = normalize(addScaled(addScaled(forward, right, nx * t * aspect), up, ny * t));
  return { origin: eye, dir, spread: [0, (2 * t) / height] };
}

/** Where a world point is on the canvas. */
export function projected(pose: Pose, { width, height }: Canvas, p: Vec3): Projection {
  const { forward, right, up } = poseBasis(pose);
  const q = sub(p, poseEye(pose));
  const depth = dot(q, forward);
  const map = pose.mode === "map";
  const half = tangent(pose) * (map ? pose.distanceM : depth);
  const nx = dot(q, right) / (half * (width / height));
  const ny = dot(q, up) / half;
  const x = ((nx + 1) / 2) * width;
  const y = ((1 - ny) / 2) * height;
  const inFront = map || depth > 0;
  return { x, y, depth, visible: inFront && Math.abs(nx) <= 1 && Math.abs(ny) <= 1 };
}
