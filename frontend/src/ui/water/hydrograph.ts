/** What a gauge shows: rain that falls, and the water that passes, over time. */

import { msg, str } from "@lit/localize";
import { html, svg, type TemplateResult } from "lit";
import { flowWords, hourWords } from "../../app/view/water/words.ts";
import type { Gauge, Rainfall } from "../../tiles/water/gauge.ts";

const HEADROOM = 1.12;
const TICKS = [0, 0.25, 0.5, 0.75, 1] as const;

export function hydrograph(gauge: Gauge, { hours }: Rainfall, width: number, height: number): TemplateResult {
  const [left, right, top, bottom] = [52, width - 8, 8, height - 22];
  const end = gauge.seconds.at(-1)!;
  const most = Math.max(HEADROOM * gauge.peak.flow, 1e-9);
  const x = (s: number): number => left + ((right - left) * s) / end;
  const y = (q: number): number => bottom - ((bottom - top) * q) / most;
  const points = Array.from(gauge.seconds, (s, k) => `${x(s).toFixed(1)} ${y(gauge.flow[k]!).toFixed(1)}`);
  const line = `M${points.join("L")}`;
  const says = msg(
    str`Gauge: ${flowWords(gauge.peak.flow)} at most, ${hourWords(gauge.peak.seconds)} after the rain began.`,
  );
  return html`<svg class="chart" role="img" aria-label=${says} viewBox="0 0 ${width} ${height}" height=${height}>
    <path class="rain" d="M${x(0)} ${top}H${x(Math.min(3600 * hours, end))}V${bottom}H${x(0)}Z"></path>
    ${[0, 0.5, 1].map(
      (share) => svg`<path class="grid" d="M${left} ${y(share * gauge.peak.flow)}H${right}"></path>
        <text x=${left - 6} y=${y(share * gauge.peak.flow) + 4} text-anchor="end">${flowWords(share * gauge.peak.flow, false)}</text>`,
    )}
    ${TICKS.map((share) => svg`<text x=${x(share * end)} y=${bottom + 16} text-anchor=${share === 1 ? "end" : "middle"}>${hourWords(share * end)}</text>`)}
    <path class="axis" d="M${left} ${top}V${bottom}H${right}"></path>
    <path class="wet" d="${line}L${x(end)} ${bottom}L${x(0)} ${bottom}Z"></path>
    <path class="flow" d=${line}></path>
    <circle class="dot" r="3.5" cx=${x(gauge.peak.seconds)} cy=${y(gauge.peak.flow)}></circle>
  </svg>`;
}
