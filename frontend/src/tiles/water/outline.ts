/** The outline of a set of samples as closed lines: each sample is a square around it, and corners are rounded. */

/** Rings of fewer corners are specks. */
const LEAST_CORNERS = 8;
/** Passes of (1 2 1) / 4. */
const SMOOTHED = 2;

/** Closed rings of xy pairs, in cells; the last point is the first again. The longest comes first. */
export function outlineOf(inside: Uint8Array, cols: number): Float64Array[] {
  const rows = inside.length / cols;
  const ends = boundary(inside, rows, cols);
  const rings: Float64Array[] = [];
  for (const start of ends.keys()) {
    const corners: number[] = [];
    let at = start;
    let came = -1;
    for (;;) {
      const next = ends.get(at);
      if (next === undefined || next.length === 0) break;
      // Where two squares touch at a corner, the line stays with its own.
      const to = next.splice(next.length > 1 ? turn(at, came, next, cols + 1) : 0, 1)[0]!;
      corners.push(at);
      came = at;
      at = to;
    }
    if (corners.length >= LEAST_CORNERS) rings.push(rounded(corners, cols + 1));
  }
  return rings.sort((a, b) => b.length - a.length);
}

/** From each corner of the lattice of squares to where the outline goes on, the inside to the left. */
function boundary(inside: Uint8Array, rows: number, cols: number): Map<number, number[]> {
  const ends = new Map<number, number[]>();
  const is = (r: number, c: number): boolean => r >= 0 && c >= 0 && r < rows && c < cols && inside[r * cols + c] === 1;
  const edge = (from: number, to: number): void => {
    const known = ends.get(from);
    if (known === undefined) ends.set(from, [to]);
    else known.push(to);
  };
  const wide = cols + 1;
  for (let r = 0; r < rows; r += 1) {
    for (let c = 0; c < cols; c += 1) {
      if (!is(r, c)) continue;
      const sw = r * wide + c;
      if (!is(r - 1, c)) edge(sw, sw + 1);
      if (!is(r, c + 1)) edge(sw + 1, sw + 1 + wide);
      if (!is(r + 1, c)) edge(sw + 1 + wide, sw + wide);
      if (!is(r, c - 1)) edge(sw + wide, sw);
    }
  }
  return ends;
}

/** The place in the list of that one of two ways on which turns left. */
function turn(at: number, came: number, next: readonly number[], wide: number): number {
  const step = (from: number, to: number): [number, number] => [
    (to % wide) - (from % wide),
    Math.floor(to / wide) - Math.floor(from / wide),
  ];
  if (came < 0) return 0;
  const [dx, dy] = step(came, at);
  return next.findIndex((to) => {
    const [ex, ey] = step(at, to);
    return dx * ey - dy * ex > 0;
  }) === 1
    ? 1
    : 0;
}

function rounded(corners: readonly number[], wide: number): Float64Array {
  let ring = Float64Array.from(corners.flatMap((corner) => [(corner % wide) - 0.5, Math.floor(corner / wide) - 0.5]));
  const n = corners.length;
  for (let pass = 0; pass < SMOOTHED; pass += 1) {
    const old = ring;
    const at = (k: number, axis: number): number => old[2 * ((k + n) % n) + axis]!;
    ring = Float64Array.from(old, (_, i) => {
      const [k, axis] = [i >> 1, i & 1];
      return (at(k - 1, axis) + 2 * at(k, axis) + at(k + 1, axis)) / 4;
    });
  }
  return Float64Array.from([...ring, ring[0]!, ring[1]!]);
}
