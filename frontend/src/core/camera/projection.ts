/**
 * The projection seen from the eye's own place. A matrix for world coordinates in float32 loses centimetres on a terrain of
 * tens of kilometres, and near the ground a centimetre is many pixels; what is subtracted first loses nothing.
 */

import type { CameraState, Vec3 } from "../types.ts";

export interface Axes {
  readonly forward: Vec3;
  readonly right: Vec3;
  readonly up: Vec3;
}

/** Orthonormal axes of a view, in the world as it is seen. */
export function viewAxes({
  eye,
  target,
  up,
  exaggeration = 1,
}: Pick<CameraState, "eye" | "target" | "up" | "exaggeration">): Axes {
  const forward = unit([target[0] - eye[0], target[1] - eye[1], exaggeration * (target[2] - eye[2])]);
  const right = unit(cross(forward, up));
  return { forward, right, up: cross(right, forward) };
}

/**
 * Column-major matrix from `world - eye` to clip space (z from 0 at the near plane to w at the far one), float64. The same
 * as `viewProj` but for where its origin is.
 */
export function eyeProjection(camera: CameraState): Float64Array {
  const { forward, right, up } = viewAxes(camera);
  const { near, far, orthoHeight, exaggeration = 1 } = camera;
  const aspect = camera.width / camera.height;
  const depth = far / (far - near);
  const rows: readonly (readonly [Vec3, number, number])[] =
    orthoHeight > 0
      ? [
          [right, 2 / (orthoHeight * aspect), 0],
          [up, 2 / orthoHeight, 0],
          [forward, 1 / (far - near), -near / (far - near)],
          [forward, 0, 1],
        ]
      : [
          [right, 1 / (Math.tan((camera.fovDeg * Math.PI) / 360) * aspect), 0],
          [up, 1 / Math.tan((camera.fovDeg * Math.PI) / 360), 0],
          [forward, depth, -depth * near],
          [forward, 1, 0],
        ];
  const m = new Float64Array(16);
  rows.forEach(([axis, scale, constant], r) => {
    for (let c = 0; c < 3; c += 1) m[4 * c + r] = scale * axis[c]! * (c === 2 ? exaggeration : 1);
    m[12 + r] = constant;
  });
  return m;
}

/**
 * Returns that matrix with depth from w at the near plane to 0 at the far one: float depth keeps its precision
 * everywhere.
 */
export function reversedDepth(m: Float64Array): Float64Array {
  const out = m.slice();
  for (let c = 0; c < 4; c += 1) out[4 * c + 2] = m[4 * c + 3]! - m[4 * c + 2]!;
  return out;
}

function cross(a: Vec3, b: Vec3): Vec3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(v: Vec3): Vec3 {
  const l = Math.hypot(...v) || 1;
  return [v[0] / l, v[1] / l, v[2] / l];
}
