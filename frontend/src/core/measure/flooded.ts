/** How much of a ground lies under a level: exact for ground whose squares are drawn as two triangles. */

/** Square metres of the map below `levelM`. `heights`: `side` x `side` samples, row 0 south, `cellM` apart. */
export function areaBelow(heights: Float32Array, side: number, cellM: number, levelM: number): number {
  let share = 0;
  for (let r = 0; r + 1 < side; r += 1) {
    for (let i = r * side; i < r * side + side - 1; i += 1) {
      const [sw, se, nw, ne] = [heights[i]!, heights[i + 1]!, heights[i + side]!, heights[i + side + 1]!];
      share += below(sw, se, nw, levelM) + below(se, ne, nw, levelM);
    }
  }
  return 0.5 * share * cellM * cellM;
}

/** The share of a triangle, seen from above, that lies below a level. */
function below(p: number, q: number, r: number, level: number): number {
  const low = Math.min(p, q, r);
  const high = Math.max(p, q, r);
  if (level >= high) return 1;
  if (level <= low) return 0;
  const middle = p + q + r - low - high;
  if (level < middle) return (level - low) ** 2 / ((middle - low) * (high - low));
  return 1 - (high - level) ** 2 / ((high - middle) * (high - low));
}
