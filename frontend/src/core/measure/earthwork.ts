/**
 * What a road, a river's bed or a ridge takes from the ground and adds to it, by cross-sections: at each the ground as it was is
 * taken to run straight from the foot of one bank to the foot of the other, as surveyors do where it is gone.
 */

/** Cubic metres. */
export interface Earthwork {
  readonly cutM3: number;
  readonly fillM3: number;
}

/** Cross-sections of a line at most, and places across one. */
const MOST_SECTIONS = 400;
const ACROSS = 24;

/**
 * Cut and fill along a line (xyz triples). `reachM`: from its middle to the foot of a bank; `stepM`: sections lie so far
 * apart at most where the line is short enough for that.
 */
export function earthwork(
  line: ArrayLike<number>,
  reachM: number,
  stepM: number,
  heightAt: (x: number, y: number) => number,
): Earthwork {
  const length = lengthOf(line);
  const step = Math.max(stepM, length / MOST_SECTIONS);
  let [cutM3, fillM3] = [0, 0];
  if (!(reachM > 0) || !(length > 0)) return { cutM3, fillM3 };
  for (let i = 3; i < line.length; i += 3) {
    const [ax, ay, bx, by] = [line[i - 3]!, line[i - 2]!, line[i]!, line[i + 1]!];
    const leg = Math.hypot(bx - ax, by - ay);
    if (leg === 0) continue;
    const [dx, dy] = [(bx - ax) / leg, (by - ay) / leg];
    const parts = Math.max(1, Math.ceil(leg / step));
    for (let k = 0; k < parts; k += 1) {
      // A section in the middle of each part stands for it.
      const s = ((k + 0.5) / parts) * leg;
      const { cut, fill } = section(ax + s * dx, ay + s * dy, -dy * reachM, dx * reachM, heightAt);
      cutM3 += (cut * reachM * leg) / parts;
      fillM3 += (fill * reachM * leg) / parts;
    }
  }
  return { cutM3, fillM3 };
}

/** Mean cut and fill of one section, times two: it is two reaches wide. */
function section(
  x: number,
  y: number,
  nx: number,
  ny: number,
  heightAt: (x: number, y: number) => number,
): { readonly cut: number; readonly fill: number } {
  const [left, right] = [heightAt(x + nx, y + ny), heightAt(x - nx, y - ny)];
  let [cut, fill] = [0, 0];
  for (let k = 0; k < ACROSS; k += 1) {
    const t = (2 * (k + 0.5)) / ACROSS - 1;
    const was = right + ((left - right) * (t + 1)) / 2;
    const gone = was - heightAt(x + t * nx, y + t * ny);
    if (gone > 0) cut += gone;
    else fill -= gone;
  }
  return { cut: (2 * cut) / ACROSS, fill: (2 * fill) / ACROSS };
}

function lengthOf(line: ArrayLike<number>): number {
  let sum = 0;
  for (let i = 3; i < line.length; i += 3) sum += Math.hypot(line[i]! - line[i - 3]!, line[i + 1]! - line[i - 2]!);
  return sum;
}
