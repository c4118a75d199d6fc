/** The sun as a point on a dial: direction is the compass, distance from the rim is the height above the horizon. */

import { msg, str } from "@lit/localize";
import { compass } from "../words/words.ts";

export interface SunPosition {
  /** Clockwise from north, 0..360. */
  readonly azimuthDeg: number;
  /** Height of the sun above the horizon, degrees, 0..90. */
  readonly elevationDeg: number;
}

const DEG = Math.PI / 180;

/** Where the sun stands on a dial of the given radius: x right (east), y down. */
export function sunOnDial({ azimuthDeg, elevationDeg }: SunPosition, radius: number): { x: number; y: number } {
  const r = radius * (1 - elevationDeg / 90);
  return { x: r * Math.sin(azimuthDeg * DEG), y: -r * Math.cos(azimuthDeg * DEG) };
}

/** The sun for a point of the dial, in whole degrees. Outside the rim it stands on the horizon. */
export function sunAt(x: number, y: number, radius: number, before: SunPosition): SunPosition {
  const r = Math.hypot(x, y);
  const elevationDeg = Math.round(90 * (1 - Math.min(r / radius, 1)));
  if (r < 1e-9) return { azimuthDeg: before.azimuthDeg, elevationDeg: 90 };
  const azimuth = Math.round(Math.atan2(x, -y) / DEG);
  return { azimuthDeg: (azimuth + 360) % 360, elevationDeg };
}

/** The sun in words: "Low morning light from the south-east". */
export function sunWords({ azimuthDeg, elevationDeg }: SunPosition): string {
  const from = msg(str`from the ${compass(azimuthDeg)}`);
  if (elevationDeg < 4) return msg(str`On the horizon, ${from}`);
  const east = azimuthDeg > 0 && azimuthDeg < 180;
  const high = Math.round(elevationDeg);
  if (elevationDeg > 50) return msg(str`High midday light ${from}, ${high}° high`);
  if (elevationDeg < 18)
    return east
      ? msg(str`Low morning light ${from}, ${high}° high`)
      : msg(str`Low evening light ${from}, ${high}° high`);
  return east
    ? msg(str`Soft morning light ${from}, ${high}° high`)
    : msg(str`Soft evening light ${from}, ${high}° high`);
}
