/** A contour map as it would be printed: brown lines, each fifth stronger and with its height. */

import { msg, str } from "@lit/localize";
import { html, svg, type TemplateResult } from "lit";
import type { ContourLine } from "../../core/contour-lines.ts";

const SIDE = 320;
const INDEX_EVERY = 5;

export function contourPicture(lines: readonly ContourLine[], sizeM: number, everyM: number): TemplateResult {
  const at = (points: Float64Array, i: number): string =>
    `${((points[2 * i]! / sizeM) * SIDE).toFixed(1)} ${(SIDE - (points[2 * i + 1]! / sizeM) * SIDE).toFixed(1)}`;
  const strong = (line: ContourLine): boolean => Math.round(line.levelM / everyM) % INDEX_EVERY === 0;
  const paths = lines.map(({ points }) =>
    Array.from({ length: points.length / 2 }, (_, i) => `${i === 0 ? "M" : "L"}${at(points, i)}`).join(""),
  );
  const named = lines.filter((line) => strong(line) && line.points.length > 40);
  return html`<svg class="contour-map" viewBox="0 0 ${SIDE} ${SIDE}" role="img" aria-label=${msg(str`The contour map, north up, lines ${everyM} metres apart`)}>
    ${lines.map((line, i) => svg`<path class=${strong(line) ? "index" : ""} d=${paths[i]!}></path>`)}
    ${named.map((line) => {
      const [x, y] = at(line.points, Math.floor(line.points.length / 4))
        .split(" ")
        .map(Number);
      return svg`<text x=${Math.min(SIDE - 14, Math.max(14, x!))} y=${Math.min(SIDE - 4, Math.max(10, y! + 3))}>${Math.round(line.levelM)}</text>`;
    })}
  </svg>`;
}
