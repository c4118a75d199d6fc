/** Numbers of running water with their units. */

import { msg, str } from "@lit/localize";
import { fixed } from "../../../core/language.ts";
import { areaWords, heightWords, lengthWords, volumeWords } from "../instruments/words.ts";
import type { Flood, Way } from "./findings.ts";

/** A flow: "0.42 m³/s", "12 m³/s". */
export function flowWords(m3PerS: number, unit = true): string {
  const digits = m3PerS >= 100 ? 0 : m3PerS >= 10 ? 1 : m3PerS >= 1 ? 2 : 3;
  return `${m3PerS === 0 ? "0" : fixed(m3PerS, digits)}${unit ? " m³/s" : ""}`;
}

/** A time since the rain began. */
export function hourWords(seconds: number): string {
  if (seconds === 0) return "0 h";
  return seconds < 5400 ? msg(str`${Math.round(seconds / 60)} min`) : `${fixed(seconds / 3600, 1)} h`;
}

export function endWords({ ends, lakes }: Way): string {
  const end = ends === "sea" ? msg("into the sea") : msg("over the border");
  if (lakes === 0) return end;
  return lakes === 1 ? msg(str`through a lake ${end}`) : msg(str`through ${lakes} lakes ${end}`);
}

/** What a flood does, in one sentence. */
export function floodWords({ lakes, runsOffM3, pouredM3 }: Flood): string {
  const [lake] = lakes;
  if (lake === undefined) return msg("Water runs off from here: no hollow holds it.");
  const stands = msg(
    str`The lake stands at ${heightWords(lake.levelM)}, ${lengthWords(lake.depthM)} deep, on ${areaWords(lake.areaM2)}.`,
  );
  if (runsOffM3 <= 1e-9 * pouredM3) return stands;
  return msg(str`${stands} It runs over: ${volumeWords(runsOffM3)} run off.`);
}
