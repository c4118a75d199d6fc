/** Numbers of running water with their units. */

import { areaWords, heightWords, lengthWords, volumeWords } from "../instruments/words.ts";
import type { Flood, Way } from "./findings.ts";

/** A flow: "0.42 m³/s", "12 m³/s". */
export function flowWords(m3PerS: number, unit = true): string {
  const digits = m3PerS >= 100 ? 0 : m3PerS >= 10 ? 1 : m3PerS >= 1 ? 2 : 3;
  return `${m3PerS === 0 ? "0" : m3PerS.toFixed(digits)}${unit ? " m³/s" : ""}`;
}

/** A time since the rain began. */
export function hourWords(seconds: number): string {
  if (seconds === 0) return "0 h";
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

export function endWords({ ends, lakes }: Way): string {
  const through = lakes === 0 ? "" : lakes === 1 ? "through a lake " : `through ${lakes} lakes `;
  return `${through}${ends === "sea" ? "into the sea" : "over the border"}`;
}

/** What a flood does, in one sentence. */
export function floodWords({ lakes, runsOffM3, pouredM3 }: Flood): string {
  const [lake] = lakes;
  if (lake === undefined) return "Water runs off from here: no hollow holds it.";
  const stands = `The lake stands at ${heightWords(lake.levelM)}, ${lengthWords(lake.depthM)} deep, on ${areaWords(lake.areaM2)}.`;
  if (runsOffM3 <= 1e-9 * pouredM3) return stands;
  return `${stands} It runs over: ${volumeWords(runsOffM3)} run off.`;
}
