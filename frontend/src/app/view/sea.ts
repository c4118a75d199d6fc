/** Where a sea may stand: from the heights of the whole land on its coarsest tile. Pure. */

/** Heights of samples, metres; any order. */
type Heights = Float32Array;

/**
 * The level at which a sea comes, metres: where it is seen, and does not lie in the very plane of a plain. Real land that
 * falls to zero gets the real sea; other land is under water up to where a quarter of it lies, and a little less.
 */
export function seaStart(heights: Heights, sizeM: number): number {
  const sorted = heights.toSorted();
  const step = sizeM / 512;
  const low = sorted[0] ?? 0;
  const shore = sorted[sorted.length >> 2] ?? 0;
  if (low <= 0 && shore > step) return 0;
  const unit = sizeM / 4096;
  return unit * Math.round((shore - step) / unit);
}

/** Lowest and highest level that the slider offers, metres: an eighth of the size both ways, and all of the land. */
export function seaSpan(heights: Heights, sizeM: number): readonly [number, number] {
  const span = sizeM / 8;
  const unit = sizeM / 4096;
  const low = heights.reduce((a, h) => Math.min(a, h), -span);
  const high = heights.reduce((a, h) => Math.max(a, h), span);
  return [unit * Math.floor(low / unit), unit * Math.ceil(high / unit)];
}
