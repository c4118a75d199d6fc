/** A smooth line through points on the screen. Pure. */

/** Device pixels from the top left corner. */
export type Pixel = readonly [number, number];

/** Distance of neighbouring samples of the line, device pixels. */
const SAMPLE_PX = 6;

/**
 * Samples about 6 pixels apart of the centripetal Catmull–Rom curve through the points (Catmull & Rom 1974; knots by the root
 * of the chord, Yuksel et al. 2011, which neither loops nor overshoots). Points that repeat count once; two make a line.
 */
export function through(points: readonly Pixel[]): Pixel[] {
  const p = points.filter((at, i) => i === 0 || chord(points[i - 1]!, at) > 1e-6);
  const out: Pixel[] = p.slice(0, 1);
  for (let i = 0; i + 1 < p.length; i++) {
    const [b, c] = [p[i]!, p[i + 1]!];
    // The curve goes on beyond its ends as it comes: points are mirrored there.
    const a = p[i - 1] ?? mirrored(c, b);
    const d = p[i + 2] ?? mirrored(b, c);
    const parts = Math.max(1, Math.ceil(chord(b, c) / SAMPLE_PX));
    for (let k = 1; k < parts; k++) out.push(between(a, b, c, d, k / parts));
    out.push(c);
  }
  return out;
}

/** The curve between b and c at 0 < t < 1, by the pyramid of Barry and Goldman (1988). */
function between(a: Pixel, b: Pixel, c: Pixel, d: Pixel, t: number): Pixel {
  const t1 = Math.sqrt(chord(a, b));
  const t2 = t1 + Math.sqrt(chord(b, c));
  const t3 = t2 + Math.sqrt(chord(c, d));
  const u = t1 + t * (t2 - t1);
  const ab = mix(a, b, u / t1);
  const bc = mix(b, c, t);
  const cd = mix(c, d, (u - t2) / (t3 - t2));
  return mix(mix(ab, bc, u / t2), mix(bc, cd, (u - t1) / (t3 - t1)), t);
}

function mix(a: Pixel, b: Pixel, t: number): Pixel {
  return [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
}

function mirrored(p: Pixel, about: Pixel): Pixel {
  return [2 * about[0] - p[0], 2 * about[1] - p[1]];
}

function chord(a: Pixel, b: Pixel): number {
  return Math.hypot(b[0] - a[0], b[1] - a[1]);
}
