/** Plane geometry of rays and polylines. Pure; float64. */

import type { Ray, Vec3 } from "./types.ts";

/** Parameter along the ray of its crossing with the plane `normal · (p - point) = 0`; null when parallel or behind. */
export function rayPlane(ray: Ray, point: Vec3, normal: Vec3): number | null {
  const facing = normal[0] * ray.dir[0] + normal[1] * ray.dir[1] + normal[2] * ray.dir[2];
  if (Math.abs(facing) < 1e-9) return null;
  const { origin } = ray;
  const t =
    (normal[0] * (point[0] - origin[0]) + normal[1] * (point[1] - origin[1]) + normal[2] * (point[2] - origin[2])) /
    facing;
  return t > 0 ? t : null;
}

export function along(ray: Ray, t: number): Vec3 {
  return [ray.origin[0] + t * ray.dir[0], ray.origin[1] + t * ray.dir[1], ray.origin[2] + t * ray.dir[2]];
}

/** Distance of (px, py) to the segment a–b, and where on it (0..1) the nearest point lies. */
export function segmentDistance(
  px: number,
  py: number,
  ax: number,
  ay: number,
  bx: number,
  by: number,
): { distance: number; t: number } {
  const dx = bx - ax;
  const dy = by - ay;
  const length2 = dx * dx + dy * dy;
  const t = length2 > 0 ? Math.max(0, Math.min(1, ((px - ax) * dx + (py - ay) * dy) / length2)) : 0;
  return { distance: Math.hypot(px - ax - t * dx, py - ay - t * dy), t };
}

/**
 * Ramer–Douglas–Peucker (Douglas & Peucker 1973): indices of the points to keep so that every point left out lies
 * within `tolerance` of the line through its kept neighbours. Points are xy pairs. Iterative: no depth limit.
 */
export function simplify(xy: ArrayLike<number>, tolerance: number): number[] {
  const n = xy.length >> 1;
  if (n <= 2) return Array.from({ length: n }, (_, i) => i);
  const keep = new Uint8Array(n);
  keep[0] = keep[n - 1] = 1;
  const stack: [number, number][] = [[0, n - 1]];
  for (let span = stack.pop(); span !== undefined; span = stack.pop()) {
    const [a, b] = span;
    let worst = tolerance;
    let at = -1;
    for (let i = a + 1; i < b; i++) {
      const far = segmentDistance(
        xy[2 * i]!,
        xy[2 * i + 1]!,
        xy[2 * a]!,
        xy[2 * a + 1]!,
        xy[2 * b]!,
        xy[2 * b + 1]!,
      ).distance;
      if (far > worst) {
        worst = far;
        at = i;
      }
    }
    if (at < 0) continue;
    keep[at] = 1;
    stack.push([a, at], [at, b]);
  }
  return Array.from({ length: n }, (_, i) => i).filter((i) => keep[i] === 1);
}

/** `simplify` with a tolerance doubled until at most `most` points are left. */
export function simplifyTo(xy: ArrayLike<number>, tolerance: number, most: number): number[] {
  let kept = simplify(xy, tolerance);
  for (let t = tolerance * 2; kept.length > most; t *= 2) kept = simplify(xy, t);
  return kept;
}

/** Length of a polyline of `stride`-tuples, measured in its first two coordinates. */
export function pathLength(points: ArrayLike<number>, stride: number): number {
  let sum = 0;
  for (let i = stride; i < points.length; i += stride)
    sum += Math.hypot(points[i]! - points[i - stride]!, points[i + 1]! - points[i + 1 - stride]!);
  return sum;
}
