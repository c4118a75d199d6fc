/**
 * What a view asks of the server, which knows no exaggeration: a cone in the true world that holds all that is seen, and an error bound
 * with which the ground in it is as fine as if it were seen without.
 */

import type { CameraState, Vec3 } from "../types.ts";
import { viewAxes } from "./projection.ts";

/** Widest cone that is asked for, degrees. */
const WIDEST_DEG = 150;
const LEAST_TAU_PX = 0.25;

export interface Asked {
  readonly fov_deg: number;
  readonly tau_px?: number;
}

/** `tauPx`: the bound of a view without exaggeration. */
export function askedOf(camera: CameraState, tauPx: number): Asked {
  const k = camera.exaggeration ?? 1;
  if (k === 1 || camera.orthoHeight > 0) return { fov_deg: camera.fovDeg };
  const tan = Math.tan((camera.fovDeg * Math.PI) / 360);
  const aspect = camera.width / camera.height;
  const seen = viewAxes(camera);
  const truly = viewAxes({ ...camera, exaggeration: 1 });
  let widest = tan;
  for (const x of [-1, 0, 1])
    for (const y of [-1, 0, 1]) {
      const d = seen.forward.map((f, i) => f + x * tan * aspect * seen.right[i]! + y * tan * seen.up[i]!);
      const ray: Vec3 = [d[0]!, d[1]!, d[2]! / k];
      const depth = Math.max(1e-3, dot(ray, truly.forward));
      widest = Math.max(widest, Math.abs(dot(ray, truly.up)) / depth, Math.abs(dot(ray, truly.right)) / depth / aspect);
    }
  const fov_deg = Math.min(WIDEST_DEG, (Math.atan(widest) * 360) / Math.PI);
  const shrunk = tan / Math.tan((fov_deg * Math.PI) / 360) / Math.sqrt(k);
  return { fov_deg, tau_px: Math.max(LEAST_TAU_PX, tauPx * shrunk) };
}

const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
