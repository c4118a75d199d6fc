/** Measured numbers with their units, with as many digits as help. */

import { msg, str } from "@lit/localize";
import { fixed, grouped } from "../../../core/language.ts";
import { height } from "../../words/words.ts";

const group = grouped;

/** A length: "12.4 m", "1 234 m", "12.35 km". */
export function lengthWords(m: number): string {
  if (m >= 10_000) return `${group(m / 1000, 2)} km`;
  return `${group(m, m < 100 ? 1 : 0)} m`;
}

/** An area: square metres, from a hectare on hectares, then square kilometres. */
export function areaWords(m2: number): string {
  if (m2 >= 1e6) return `${group(m2 / 1e6, m2 < 1e8 ? 2 : 0)} km²`;
  if (m2 >= 1e4) return `${group(m2 / 1e4, 2)} ha`;
  return `${group(m2, m2 < 100 ? 1 : 0)} m²`;
}

/** A volume: cubic metres, then millions of them. */
export function volumeWords(m3: number): string {
  if (m3 >= 1e9) return `${group(m3 / 1e9, 3)} km³`;
  if (m3 >= 1e6) return msg(str`${group(m3 / 1e6, 2)} million m³`);
  return `${group(m3, m3 < 100 ? 1 : 0)} m³`;
}

/** A slope, rise over run, as an angle and in per cent; up or down by its sign. */
export function slopeWords(rise: number): string {
  const degrees = (Math.atan(Math.abs(rise)) * 180) / Math.PI;
  const sign = rise < 0 && degrees >= 0.05 ? "−" : "";
  return `${sign}${fixed(degrees, 1)}° (${sign}${fixed(100 * Math.abs(rise), Math.abs(rise) < 0.1 ? 1 : 0)} %)`;
}

export const heightWords = (m: number): string => height(m).replace("-", "−");
