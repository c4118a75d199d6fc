/** The view of the whole terrain in the part of the picture that nothing covers. Pure. */

import { addScaled, clamp, DEG, dot, mix, sub } from "../math.ts";
import type { Vec3 } from "../types.ts";
import { raised } from "./lens.ts";
import { FLAT, FOV_DEG, fitDistance, HOME_HEADING, HOME_PITCH, type Land, type Pose, poseBasis } from "./state.ts";
import type { Canvas } from "./view.ts";

/** How much of a picture's edges is covered, in its pixels. */
export interface Insets {
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

/** Share of the free part that stays empty at each of its edges. */
const MARGIN = 0.02;
/** Share of the free part that stays empty at each of its edges around what is looked at. */
const ROOM = 0.1;
/** The free part has at least this share of the picture along a side, whatever covers it. */
const LEAST = 0.2;
/** Free parts of this proportion and wider are seen as ever; of the second and narrower from higher up, less across. */
const WIDE = 1.25;
const TALL = 0.62;
const TALL_PITCH = -34 * DEG;
const TALL_HEADING = 14 * DEG;
/** Share of the room above and below the land that is below it: next to none under a sky, half where there is none. */
const BELOW_WIDE = 0.03;
const BELOW_TALL = 0.5;

/** Edges of the free part: -1 and 1 are those of the picture, y upward. */
interface Free {
  readonly x0: number;
  readonly y0: number;
  readonly x1: number;
  readonly y1: number;
}

function freeOf({ left, top, right, bottom }: Insets, width: number, height: number): Free {
  const [x0, x1] = shrunk(left / width, 1 - right / width);
  const [y0, y1] = shrunk(bottom / height, 1 - top / height);
  return { x0: 2 * x0 - 1, x1: 2 * x1 - 1, y0: 2 * y0 - 1, y1: 2 * y1 - 1 };
}

function shrunk(from: number, to: number): [number, number] {
  const middle = clamp((from + to) / 2, LEAST / 2, 1 - LEAST / 2);
  const half = Math.max(LEAST, to - from) * (0.5 - MARGIN);
  return [middle - half, middle + half];
}

/** Home: the whole land as large as fits in the free part of a picture of `width` by `height` pixels. */
export function homeIn(
  mode: Pose["mode"],
  sizeM: number,
  width: number,
  height: number,
  insets: Insets,
  { groundM, lowM, peaks = [] }: Land = FLAT,
): Pose {
  const free = freeOf(insets, width, height);
  const aspect = width / height;
  const middle: Vec3 = [sizeM / 2, sizeM / 2, groundM];
  if (mode === "map") return mapIn(free, aspect, [0, 0, groundM], [sizeM, sizeM, groundM]);
  const tall = clamp((WIDE - ((free.x1 - free.x0) * aspect) / (free.y1 - free.y0)) / (WIDE - TALL), 0, 1);
  const heading = mix(HOME_HEADING, TALL_HEADING, tall);
  const pitch = mix(HOME_PITCH, TALL_PITCH, tall);
  const pose: Pose = { mode, pivot: middle, distanceM: 1, heading, pitch, fovDeg: FOV_DEG };
  const corners = [0, sizeM].flatMap((x) =>
    [0, sizeM].flatMap((y): Vec3[] => [
      [x, y, groundM],
      [x, y, lowM],
    ]),
  );
  const eye = eyeFor(pose, [...corners, ...peaks], free, aspect, mix(BELOW_WIDE, BELOW_TALL, tall));
  const { forward } = poseBasis(pose);
  const distanceM = dot(sub(middle, eye), forward);
  return { ...pose, distanceM, pivot: addScaled(eye, forward, distanceM) };
}

/** The nearest view along `pose` in which all points lie in the free part, with room around them. A map keeps to the north. */
export function frameIn(pose: Pose, points: readonly Vec3[], width: number, height: number, insets: Insets): Pose {
  const free = within(freeOf(insets, width, height), ROOM);
  const aspect = width / height;
  const of = (k: 0 | 1 | 2): number[] => points.map((p) => p[k]);
  const low: Vec3 = [Math.min(...of(0)), Math.min(...of(1)), Math.min(...of(2))];
  const high: Vec3 = [Math.max(...of(0)), Math.max(...of(1)), Math.max(...of(2))];
  if (pose.mode === "map") return { ...mapIn(free, aspect, low, high), heading: pose.heading, pitch: pose.pitch };
  const eye = eyeFor(pose, points, free, aspect, 0.5);
  const { forward } = poseBasis(pose);
  const middle: Vec3 = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
  const distanceM = dot(sub(middle, eye), forward);
  return { ...pose, distanceM, pivot: addScaled(eye, forward, distanceM) };
}

/** The view in which all points lie beside what covers the picture, or with room around them where nobody has said what does. */
export function framed(from: Pose, points: readonly Vec3[], canvas: Canvas, insets: Insets | null): Pose {
  const of = (k: 0 | 1 | 2): number => {
    const values = points.map((p) => p[k]);
    return (Math.min(...values) + Math.max(...values)) / 2;
  };
  const pitch = from.mode === "map" ? from.pitch : clamp(from.pitch, -75 * DEG, -15 * DEG);
  const pose: Pose = { ...from, pivot: [of(0), of(1), of(2)], pitch };
  const { width, height } = canvas;
  return insets === null
    ? { ...pose, distanceM: fitDistance(pose, points, width / height, 0.2, 0) }
    : frameIn(pose, points, width, height, insets);
}

/** How the land lies as it is seen. */
export function raisedLand(land: Land, k: number): Land {
  if (k === 1) return land;
  const peaks = land.peaks?.map((p) => raised(p, k));
  return { groundM: k * land.groundM, lowM: k * land.lowM, ...(peaks ? { peaks } : {}) };
}

function within({ x0, x1, y0, y1 }: Free, room: number): Free {
  const [dx, dy] = [room * (x1 - x0), room * (y1 - y0)];
  return { x0: x0 + dx, x1: x1 - dx, y0: y0 + dy, y1: y1 - dy };
}

/**
 * The nearest eye from which all points lie in the free part: each of its four edges is a plane through the eye, and the point
 * that is outermost to that side decides. `below`: share of the room above and below that is left below.
 */
function eyeFor(pose: Pose, points: readonly Vec3[], free: Free, aspect: number, below: number): Vec3 {
  const { forward, right, up } = poseBasis(pose);
  const tan = Math.tan((pose.fovDeg * DEG) / 2);
  const [x0, x1] = [free.x0 * tan * aspect, free.x1 * tan * aspect];
  const [y0, y1] = [free.y0 * tan, free.y1 * tan];
  const least = (of: (p: Vec3) => number): number => Math.min(...points.map(of));
  const left = least((p) => dot(p, right) - x0 * dot(p, forward));
  const rightmost = least((p) => x1 * dot(p, forward) - dot(p, right));
  const bottom = least((p) => dot(p, up) - y0 * dot(p, forward));
  const top = least((p) => y1 * dot(p, forward) - dot(p, up));
  const along = Math.min((left + rightmost) / (x1 - x0), (bottom + top) / (y1 - y0));
  const across = (x1 * along - rightmost + left + x0 * along) / 2;
  const rise = mix(bottom + y0 * along, y1 * along - top, below);
  return [0, 1, 2].map((k) => along * forward[k]! + across * right[k]! + rise * up[k]!) as unknown as Vec3;
}

function mapIn({ x0, x1, y0, y1 }: Free, aspect: number, low: Vec3, high: Vec3): Pose {
  const half = Math.max((high[0] - low[0]) / ((x1 - x0) * aspect), (high[1] - low[1]) / (y1 - y0));
  const [x, y, z] = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
  const pivot: Vec3 = [x - ((x0 + x1) / 2) * half * aspect, y - ((y0 + y1) / 2) * half, z];
  const distanceM = half / Math.tan((FOV_DEG * DEG) / 2);
  return { mode: "map", pivot, distanceM, heading: 0, pitch: -90 * DEG, fovDeg: FOV_DEG };
}
