/** The section along a line, with axes; a pointer on it marks the place on the ground. */

import { msg, str } from "@lit/localize";
import { html, nothing, svg, type TemplateResult } from "lit";
import type { Instruments } from "../../app/view/instruments/instruments.ts";
import { type Chart, chartOf } from "../../app/view/instruments/profile-chart.ts";
import { heightWords, lengthWords } from "../../app/view/instruments/words.ts";
import { fixed } from "../../core/language.ts";
import { type Profile, profileAt } from "../../core/measure/profile.ts";

const rootPx = (): number => Number.parseFloat(getComputedStyle(document.documentElement).fontSize) || 16;

export function sectionChart(
  instruments: Pick<Instruments, "beforeHeights" | "exaggeration" | "marker"> &
    Partial<Pick<Instruments, "askedHeights">>,
  profile: Profile,
  width: number,
  height: number,
): TemplateResult {
  const em = 0.6875 * rootPx();
  const before = instruments.beforeHeights.value;
  const asked = instruments.askedHeights?.value ?? null;
  const exaggeration = instruments.exaggeration.value;
  const chart = chartOf(profile, { width, height, em, exaggeration, before: asked === null ? before : null, asked });
  const move = (e: PointerEvent): void => {
    const box = (e.currentTarget as Element).getBoundingClientRect();
    instruments.marker.value = chart.distanceAt(((e.clientX - box.left) * width) / Math.max(1, box.width));
  };
  const leave = (): void => {
    instruments.marker.value = null;
  };
  const says = msg(
    str`Section of ${lengthWords(profile.lengthM)} from ${heightWords(profile.height[0]!)} to ${heightWords(profile.height.at(-1)!)}, lowest ${heightWords(profile.min.m)}, highest ${heightWords(profile.max.m)}.`,
  );
  return html`<svg
    class="chart"
    role="img"
    aria-label=${says}
    viewBox="0 0 ${width} ${height}"
    height=${height}
    @pointermove=${move}
    @pointerdown=${move}
    @pointerleave=${leave}
  >
    ${axes(chart, em)}
    <path class="ground" d=${chart.area}></path>
    ${asked ? svg`<path class="high" d=${chart.tooHigh}></path><path class="low" d=${chart.tooLow}></path><path class="asked" d=${chart.asked}></path>` : nothing}
    ${chart.before ? svg`<path class="before" d=${chart.before}></path>` : nothing}
    <path class="crest" d=${chart.line}></path>
    ${chart.corners.slice(1, -1).map((x) => svg`<path class="corner" d="M${x} ${chart.top}V${chart.bottom}"></path>`)}
    ${marker(chart, profile, instruments.marker.value)}
  </svg>`;
}

function axes(chart: Chart, em: number): unknown {
  const { left, right, top, bottom } = chart;
  return svg`
    ${chart.heights.map((t) => svg`<path class="grid" d="M${left} ${t.at}H${right}"></path><text x=${left - 6} y=${t.at + 0.35 * em} text-anchor="end">${t.text}</text>`)}
    ${chart.distances.map((t) => svg`<path class="axis" d="M${t.at} ${bottom}v4"></path><text x=${t.at} y=${bottom + 1.35 * em} text-anchor="middle">${t.text}</text>`)}
    <path class="axis" d="M${left} ${top}V${bottom}H${right}"></path>
    <text x=${right} y=${bottom + 2.45 * em} text-anchor="end">${msg(str`distance, ${chart.distanceUnit}`)}</text>
    <text x=${left} y=${bottom + 2.45 * em}>${msg(str`height in m, drawn × ${fixed(chart.exaggeration, 1)}`)}</text>`;
}

function marker(chart: Chart, profile: Profile, at: number | null): unknown {
  if (at === null) return nothing;
  const spot = profileAt(profile, at);
  const [x, y] = [chart.xOf(at), chart.yOf(spot.m)];
  const right = x < (chart.left + chart.right) / 2;
  return svg`<path class="mark" d="M${x} ${chart.top}V${chart.bottom}"></path><circle class="dot" r="4" cx=${x} cy=${y}></circle>
    <text class="here" x=${x + (right ? 8 : -8)} y=${chart.top + 10} text-anchor=${right ? "start" : "end"}>${lengthWords(at)}, ${heightWords(spot.m)}</text>`;
}
