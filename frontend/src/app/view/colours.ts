/** Stroke and member colours as renderers take them: sRGB components in 0..1. */

import type { Rgba } from "../../core/types.ts";
import type { Course, Paint, StrokeKind } from "../../generated/contract.ts";
import { SUBSTANCES } from "../words/paints.ts";

/** Paper 0, figure 6: mountains and crevices in blue, plateaus in red. */
const MOUNTAIN: Rgba = [0.16, 0.42, 0.86, 1];
const CREVICE: Rgba = [0.05, 0.52, 0.72, 1];
const PLATEAU: Rgba = [0.83, 0.23, 0.2, 1];

/** The colour of a line of paint: that of its channel, darker where it takes away. */
export function paintColour({ channel, value }: Paint): Rgba {
  const [r, g, b] = hexColour(SUBSTANCES[channel].colour);
  const k = value < 0 ? 0.45 : 1;
  return [r * k, g * k, b * k, 1];
}

const COURSES: Readonly<Record<Course["use"], Rgba>> = {
  river: [0.12, 0.55, 0.86, 1],
  road: [0.55, 0.45, 0.34, 1],
  ridge: MOUNTAIN,
};

/** The colour of a finished stroke by what it makes of the land. */
export function strokeColour(kind: StrokeKind, sinks: boolean, use?: Course["use"]): Rgba {
  if (use !== undefined) return COURSES[use];
  if (kind === "level") return PLATEAU;
  return sinks ? CREVICE : MOUNTAIN;
}

/** Parses `#rrggbb`; anything else is a middle grey. */
export function hexColour(hex: string): Rgba {
  const match = /^#([0-9a-f]{2})([0-9a-f]{2})([0-9a-f]{2})$/i.exec(hex);
  if (!match) return [0.5, 0.5, 0.5, 1];
  const part = (i: number): number => Number.parseInt(match[i] ?? "80", 16) / 255;
  return [part(1), part(2), part(3), 1];
}

/** A colour moved toward white by `share` 0..1. */
export function lighten(colour: Rgba, share: number): Rgba {
  const mix = (c: number): number => c + (1 - c) * share;
  return [mix(colour[0]), mix(colour[1]), mix(colour[2]), colour[3]];
}

export function withAlpha(colour: Rgba, alpha: number): Rgba {
  return [colour[0], colour[1], colour[2], alpha];
}

/** White or black, whichever reads better: at least 4.58 : 1 on every colour (WCAG 2.2 relative luminance). */
export function inkOn(hex: string): "#ffffff" | "#000000" {
  const linear = (c: number): number => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  const [r, g, b] = hexColour(hex);
  const luminance = 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  // (L + 0.05) / 0.05 is compared with 1.05 / (L + 0.05).
  return luminance + 0.05 > Math.sqrt(0.05 * 1.05) ? "#000000" : "#ffffff";
}
