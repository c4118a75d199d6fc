/** A profile as files: numbers for spreadsheets, and a drawing. */

import { msg, str } from "@lit/localize";
import { fixed } from "../../../core/language.ts";
import type { Profile } from "../../../core/measure/profile.ts";
import { chartOf } from "./profile-chart.ts";
import { slopeWords } from "./words.ts";

/** Comma-separated values with a head line: metres, as many digits as tiles have. */
export function profileCsv(profile: Profile, before: ArrayLike<number> | null): string {
  const head = ["distance_m", "x_m", "y_m", "height_m", ...(before ? ["before_m"] : [])];
  const rows = Array.from(profile.distance, (d, i) =>
    [d, profile.x[i]!, profile.y[i]!, profile.height[i]!, ...(before ? [before[i]!] : [])]
      .map((v) => String(Number(v.toFixed(4)) + 0))
      .join(","),
  );
  return `${[head.join(","), ...rows].join("\r\n")}\r\n`;
}

const escaped = (text: string): string =>
  text.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]!);

/** The section as a drawing of its own, with axes, units and figures. */
export function profileSvg(
  profile: Profile,
  title: string,
  options: { readonly exaggeration: number; readonly before: ArrayLike<number> | null },
): string {
  const [width, plot] = [960, 380];
  const chart = chartOf(profile, { width, height: plot, em: 14, ...options });
  const text = (x: number, y: number, words: string, more = ""): string =>
    `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}"${more}>${escaped(words)}</text>`;
  const lines = [
    ...chart.heights.map(
      (t) => `<path d="M${chart.left} ${t.at.toFixed(1)}H${chart.right.toFixed(1)}" stroke="#d9dde0"/>`,
    ),
    `<path d="${chart.area}" fill="#e9dccb"/>`,
    chart.before &&
      `<path d="${chart.before}" fill="none" stroke="#7b858e" stroke-width="1.5" stroke-dasharray="5 4"/>`,
    `<path d="${chart.line}" fill="none" stroke="#8a5a2b" stroke-width="2.2" stroke-linejoin="round"/>`,
    `<path d="M${chart.left} ${chart.top}V${chart.bottom}H${chart.right.toFixed(1)}" fill="none" stroke="#22303b"/>`,
    ...chart.heights.map((t) => text(chart.left - 7, t.at + 4, t.text, ' text-anchor="end"')),
    ...chart.distances.map((t) => text(t.at, chart.bottom + 18, t.text, ' text-anchor="middle"')),
    text(chart.right, chart.bottom + 34, msg(str`distance, ${chart.distanceUnit}`), ' text-anchor="end"'),
    text(chart.left - 40, chart.top - 4, msg("height, m")),
  ];
  const facts = msg(
    str`${fixed(profile.lengthM / 1000, 2)} km, ${fixed(profile.min.m, 1)} to ${fixed(profile.max.m, 1)} m, up ${fixed(profile.gainM, 1)} m, down ${fixed(profile.lossM, 1)} m, steepest ${slopeWords(profile.steepest.m)}, heights × ${fixed(chart.exaggeration, 1)}`,
  );
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${plot + 70}" viewBox="0 -44 ${width} ${plot + 70}" font-family="Helvetica, Arial, sans-serif" font-size="13" fill="#22303b">
<title>${escaped(title)}</title>
<rect x="0" y="-44" width="${width}" height="${plot + 70}" fill="#fff"/>
${text(24, -20, title, ' font-size="19" font-weight="bold"')}
${lines.filter(Boolean).join("\n")}
${text(24, plot + 12, facts, ' fill="#5a6672"')}
</svg>
`;
}
