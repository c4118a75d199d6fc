/** From a pose to the matrix that renderers read. Pure. */

import { addScaled, clamp, DEG, dot, sub } from "../math.ts";
import type { CameraState, Vec3 } from "../types.ts";
import { lowered } from "./lens.ts";

/** Vertical field of view, degrees; the map covers at its pivot what the perspective view does. */
export const FOV_DEG = 45;

/** Where the camera is. `heading` clockwise from north, `pitch` above the horizon, radians. */
export interface Pose {
  readonly mode: CameraState["mode"];
  readonly pivot: Vec3;
  readonly distanceM: number;
  readonly heading: number;
  readonly pitch: number;
  readonly fovDeg: number;
}

export interface Basis {
  readonly forward: Vec3;
  readonly right: Vec3;
  readonly up: Vec3;
}

/** Orthonormal view axes in world coordinates; `right` is always horizontal. */
export function poseBasis(pose: Pose): Basis {
  const sh = Math.sin(pose.heading);
  const ch = Math.cos(pose.heading);
  const map = pose.mode === "map";
  const sp = map ? -1 : Math.sin(pose.pitch);
  const cp = map ? 0 : Math.cos(pose.pitch);
  return { forward: [cp * sh, cp * ch, sp], right: [ch, -sh, 0], up: [-sh * sp, -ch * sp, cp] };
}

export function poseEye(pose: Pose): Vec3 {
  return addScaled(pose.pivot, poseBasis(pose).forward, -pose.distanceM);
}

/**
 * The smallest distance from the pivot at which all points lie inside the view, kept clear of
 * its border by `margin` (fraction of the half view), at the left and the right by `across` (negative where they may
 * lie beyond it). The direction of the pose stays.
 */
export function fitDistance(
  pose: Pose,
  points: readonly Vec3[],
  aspect: number,
  margin: number,
  from: number,
  across = margin,
): number {
  const { forward, right, up } = poseBasis(pose);
  const tan = Math.tan((pose.fovDeg * DEG) / 2);
  const [wide, high] = [tan * aspect * (1 - across), tan * (1 - margin)];
  let distanceM = from;
  for (const p of points) {
    const q = sub(p, pose.pivot);
    const spread = Math.max(Math.abs(dot(q, up)) / high, Math.abs(dot(q, right)) / wide);
    // In perspective the depth of the point counts: spread <= distance + depth offset.
    distanceM = Math.max(distanceM, pose.mode === "map" ? spread : spread - dot(q, forward));
  }
  return distanceM;
}

/** Home looks from the south-south-west, so that two sides of the block show. */
export const HOME_HEADING = 25 * DEG;
/** How far home looks down: so little that the horizon and the sky above it stand in the upper third of the picture. */
export const HOME_PITCH = -16 * DEG;
/** How high home stands over the land: an angle at its middle. */
const HOME_ELEVATION = 19 * DEG;
const HOME_MARGIN = 0.06;
/**
 * A picture twice as tall as wide adds this to home's angles: without it all of the land would be a small tile there.
 * The eye stands higher and so near that the corners at the left and the right are cut off.
 */
const TALL = { pitch: -2 * DEG, elevation: 6 * DEG, margin: -0.46 } as const;

/** How high the land lies on the whole, and what of it must be seen at its corners, metres. */
export interface Land {
  readonly groundM: number;
  readonly lowM: number;
  /** Summits, which must be seen too where something covers the picture. */
  readonly peaks?: readonly Vec3[];
}

export const FLAT: Land = { groundM: 0, lowM: 0 };

/**
 * The view of the whole terrain. The eye stands higher than its look is steep, so the pivot lies above the middle of the
 * land: that puts the land in the lower two thirds, as large as fits, under a sky; a tall picture comes nearer (`TALL`).
 * `land`: how high that is.
 */
export function homePose(mode: Pose["mode"], sizeM: number, aspect: number, land: Land = FLAT): Pose {
  const { groundM, lowM } = land;
  const half = sizeM / 2;
  const tall = mode === "map" ? 0 : clamp(2 * (1 - aspect), 0, 1);
  const pitch = HOME_PITCH + tall * TALL.pitch;
  const across = HOME_MARGIN + tall * TALL.margin;
  const corners: Vec3[] = [0, sizeM].flatMap((x) =>
    [0, sizeM].flatMap((y): Vec3[] => [
      [x, y, groundM],
      [x, y, lowM],
    ]),
  );
  const fitted = (pose: Pose): Pose => ({
    ...pose,
    distanceM: fitDistance(pose, corners, aspect, HOME_MARGIN, half, across),
  });
  const base = { mode, pivot: [half, half, groundM] as Vec3, distanceM: 1, fovDeg: FOV_DEG };
  if (mode === "map") return fitted({ ...base, heading: 0, pitch: -90 * DEG });
  const lift = Math.cos(pitch) * Math.tan(HOME_ELEVATION + tall * TALL.elevation) + Math.sin(pitch);
  let pose = fitted({ ...base, heading: HOME_HEADING, pitch });
  // The height of the pivot follows from the distance, and that from the height: a few rounds agree to the metre.
  for (let round = 0; round < 8; round++)
    pose = fitted({ ...pose, pivot: [half, half, groundM + lift * pose.distanceM] });
  return pose;
}

/**
 * The published state of a pose.
 *
 * The near plane is as near as eyes come to the ground (camera/floor.ts), from a walk to a view from space: reversed depth
 * does not lose precision by it, and what is beside a cliff is not cut off. Matrices are built in float64 and rounded once.
 * `k`: heights of the pose are this many times the true ones, which the state has.
 */
export function cameraState(pose: Pose, width: number, height: number, sizeM: number, k = 1): CameraState {
  const basis = poseBasis(pose);
  const eye = poseEye(pose);
  const map = pose.mode === "map";
  const reach = Math.hypot(eye[0] - sizeM / 2, eye[1] - sizeM / 2, eye[2]) + 2 * sizeM;
  const near = map ? pose.distanceM - 2 * sizeM : Math.min(0.1, sizeM / 4096);
  const far = map ? pose.distanceM + 2 * sizeM : 2 * reach;
  const tan = Math.tan((pose.fovDeg * DEG) / 2);
  const orthoHeight = map ? 2 * pose.distanceM * tan : 0;
  const viewProj = map
    ? orthographic(basis, eye, orthoHeight, width / height, near, far)
    : perspective(basis, eye, tan, width / height, near, far);
  for (let row = 0; row < 4; row++) viewProj[8 + row]! *= k;
  return {
    mode: pose.mode,
    eye: lowered(eye, k),
    target: lowered(pose.pivot, k),
    up: basis.up,
    fovDeg: pose.fovDeg,
    orthoHeight,
    near,
    far,
    width,
    height,
    exaggeration: k,
    viewProj: new Float32Array(viewProj),
  };
}

/** Column-major; row r of the matrix is `rows[r]`, an affine form (x, y, z, constant). */
function fromRows(rows: readonly (readonly number[])[]): Float64Array {
  const m = new Float64Array(16);
  for (let r = 0; r < 4; r++) for (let c = 0; c < 4; c++) m[4 * c + r] = rows[r]![c]!;
  return m;
}

/** k·(axis · (p − eye)) + constant as an affine form of p. */
function form(axis: Vec3, eye: Vec3, k: number, constant: number): number[] {
  const offset = axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2];
  return [k * axis[0], k * axis[1], k * axis[2], constant - k * offset];
}

function perspective(b: Basis, eye: Vec3, tan: number, aspect: number, near: number, far: number): Float64Array {
  const depth = far / (far - near);
  return fromRows([
    form(b.right, eye, 1 / (tan * aspect), 0),
    form(b.up, eye, 1 / tan, 0),
    form(b.forward, eye, depth, -depth * near),
    form(b.forward, eye, 1, 0),
  ]);
}

function orthographic(b: Basis, eye: Vec3, tall: number, aspect: number, near: number, far: number): Float64Array {
  const depth = 1 / (far - near);
  return fromRows([
    form(b.right, eye, 2 / (tall * aspect), 0),
    form(b.up, eye, 2 / tall, 0),
    form(b.forward, eye, depth, -depth * near),
    [0, 0, 0, 1],
  ]);
}
