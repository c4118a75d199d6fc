/** Ridge lines drawn from a seed: the landing picture, and the stand-in where a terrain has no preview image. */

/** Mulberry32: 32-bit state, uniform in [0, 1). */
export function mulberry32(seed: number): () => number {
  let a = seed >>> 0;
  return () => {
    a = (a + 0x6d2b79f5) | 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** A 32-bit FNV-1a hash of a name, to seed its picture. */
export function seedOf(name: string): number {
  let hash = 0x811c9dc5;
  for (let i = 0; i < name.length; i++) hash = Math.imul(hash ^ name.charCodeAt(i), 0x01000193);
  return hash >>> 0;
}

/**
 * A ridge by midpoint displacement: 2^steps + 1 heights in about [-1, 1], fixed by the seed.
 * `roughness` 0..1 is the share of amplitude that each halving keeps.
 */
export function ridge(seed: number, steps: number, roughness: number): Float64Array {
  const random = mulberry32(seed);
  const n = 2 ** steps;
  const heights = new Float64Array(n + 1);
  heights[0] = random() - 0.5;
  heights[n] = random() - 0.5;
  let amplitude = 1;
  for (let step = n; step > 1; step /= 2) {
    for (let i = step / 2; i < n; i += step) {
      const mean = (heights[i - step / 2]! + heights[i + step / 2]!) / 2;
      heights[i] = mean + (random() * 2 - 1) * amplitude;
    }
    amplitude *= roughness;
  }
  const peak = heights.reduce((m, h) => Math.max(m, Math.abs(h)), 1e-9);
  return heights.map((h) => h / peak);
}

/** The ridge as an SVG path across `width`, filled down to `height`; `base` and `relief` in the same units. */
export function ridgePath(heights: Float64Array, width: number, height: number, base: number, relief: number): string {
  const last = heights.length - 1;
  const points: string[] = [];
  heights.forEach((h, i) => {
    points.push(`${((i / last) * width).toFixed(1)} ${(base - h * relief).toFixed(1)}`);
  });
  return `M0 ${height} L${points.join(" L")} L${width} ${height} Z`;
}

/** Hues that pass from far haze to near ground. */
export interface Layer {
  readonly path: string;
  /** 0 farthest .. 1 nearest. */
  readonly depth: number;
}

/** Layered ridges for a picture of the given size, far to near; `top` is where the farthest stands, 0 top .. 1 bottom. */
export function ridgeLayers(seed: number, count: number, width: number, height: number, top = 0.48): Layer[] {
  return Array.from({ length: count }, (_, i) => {
    const depth = count === 1 ? 1 : i / (count - 1);
    const heights = ridge(seed + 7919 * i, 7, 0.5 + 0.06 * (1 - depth));
    const base = height * (top + (0.9 - top) * depth);
    return { depth, path: ridgePath(heights, width, height, base, height * (0.41 - 0.43 * top) * (1 - 0.45 * depth)) };
  });
}

/** Peaks of the line that is drawn on the landing picture: [centre, height, width], in units of the picture. */
const PEAKS: readonly (readonly [number, number, number])[] = [
  [1010, 105, 62],
  [1130, 205, 66],
  [1335, 318, 92],
  [1470, 96, 60],
];

/** Height of the drawn line above its base at `x`. */
export function penHeight(x: number): number {
  return PEAKS.reduce((sum, [centre, height, width]) => sum + height * Math.exp(-(((x - centre) / width) ** 2)), 0);
}

export interface PenRidge {
  /** The ground that has risen. */
  readonly land: string;
  /** The line that it rose to. */
  readonly line: string;
  readonly start: readonly [number, number];
  readonly end: readonly [number, number];
}

/** A ridge that follows the drawn line between x0 and x1, and runs on as low hills outside. */
export function penRidge(seed: number, width: number, height: number, base: number, x0: number, x1: number): PenRidge {
  const steps = 8;
  const noise = ridge(seed, steps, 0.56);
  const n = 2 ** steps;
  const y = (x: number): number => base - penHeight(x);
  const land = Array.from(noise, (wobble, i) => {
    const x = (i / n) * width;
    const drawn = x > x0 && x < x1;
    const own = drawn ? Math.abs(wobble) * 9 : wobble * 22 * Math.min(1, Math.abs(x - (x < x0 ? x0 : x1)) / 160);
    return `${x.toFixed(1)} ${(y(x) + own).toFixed(1)}`;
  });
  const line = Array.from({ length: 97 }, (_, i) => {
    const x = x0 + ((x1 - x0) * i) / 96;
    return `${x.toFixed(1)} ${y(x).toFixed(1)}`;
  });
  return {
    land: `M0 ${height} L${land.join(" L")} L${width} ${height} Z`,
    line: `M${line.join(" L")}`,
    start: [x0, y(x0)],
    end: [x1, y(x1)],
  };
}
