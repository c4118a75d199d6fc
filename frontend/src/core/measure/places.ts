/** Lines and outlines on the map: their length, their area, whether they cross themselves. Metres. */

export type Place = readonly [number, number];

/** Why something cannot be measured, as a sentence. */
export interface Impossible {
  readonly problem: string;
}

export const isImpossible = (found: object): found is Impossible => "problem" in found;

/** The length of a line on the map. */
export function lengthM(points: readonly Place[]): number {
  let sum = 0;
  for (let i = 1; i < points.length; i++)
    sum += Math.hypot(points[i]![0] - points[i - 1]![0], points[i]![1] - points[i - 1]![1]);
  return sum;
}

/** The area of an outline that does not cross itself, by the trapezoid rule (Gauss). The last point joins the first. */
export function areaM2(ring: readonly Place[]): number {
  const [x0, y0] = ring[0] ?? [0, 0];
  let twice = 0;
  for (let i = 1; i + 1 < ring.length; i++) {
    const [ax, ay] = ring[i]!;
    const [bx, by] = ring[i + 1]!;
    twice += (ax - x0) * (by - y0) - (bx - x0) * (ay - y0);
  }
  return Math.abs(twice) / 2;
}

/** Whether two sides of an outline that are not neighbours touch. */
export function crossesItself(ring: readonly Place[]): boolean {
  const n = ring.length;
  for (let i = 0; i < n; i++)
    for (let j = i + 1; j < n; j++) {
      const neighbours = j === i + 1 || (i === 0 && j === n - 1);
      if (!neighbours && touch(ring[i]!, ring[(i + 1) % n]!, ring[j]!, ring[(j + 1) % n]!)) return true;
    }
  return false;
}

function touch(a: Place, b: Place, c: Place, d: Place): boolean {
  const side = (p: Place, q: Place, r: Place): number =>
    Math.sign((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]));
  const within = (p: Place, q: Place, r: Place): boolean =>
    Math.min(p[0], q[0]) <= r[0] &&
    r[0] <= Math.max(p[0], q[0]) &&
    Math.min(p[1], q[1]) <= r[1] &&
    r[1] <= Math.max(p[1], q[1]);
  const [c1, d1, a2, b2] = [side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)];
  if (c1 !== d1 && a2 !== b2) return true;
  return (
    (c1 === 0 && within(a, b, c)) ||
    (d1 === 0 && within(a, b, d)) ||
    (a2 === 0 && within(c, d, a)) ||
    (b2 === 0 && within(c, d, b))
  );
}

/**
 * A line with fewer points (Douglas and Peucker 1973): none of those that are left out lies farther than `toleranceM` from it;
 * the tolerance grows until at most `most` are left.
 */
export function simplified(line: readonly Place[], toleranceM: number, most: number): Place[] {
  for (let tolerance = Math.max(toleranceM, 1e-9); ; tolerance *= 1.5) {
    const kept = reduced(line, tolerance);
    if (kept.length <= most) return kept;
  }
}

function reduced(line: readonly Place[], toleranceM: number): Place[] {
  if (line.length < 3) return [...line];
  const [first, last] = [line[0]!, line.at(-1)!];
  let [farthest, at] = [0, 0];
  for (let i = 1; i + 1 < line.length; i++) {
    const away = distanceTo(line[i]!, first, last);
    if (away > farthest) [farthest, at] = [away, i];
  }
  if (farthest <= toleranceM) return [first, last];
  return [...reduced(line.slice(0, at + 1), toleranceM).slice(0, -1), ...reduced(line.slice(at), toleranceM)];
}

function distanceTo(p: Place, a: Place, b: Place): number {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const square = dx * dx + dy * dy;
  const t = square > 0 ? Math.min(1, Math.max(0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square)) : 0;
  return Math.hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
}
