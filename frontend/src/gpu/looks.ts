/** Figures of each look that are not materials: exposure, haze, contours. */

import type { Look } from "../generated/contract.ts";

export interface LookFigures {
  /** Index in view.wgsl. */
  readonly index: number;
  readonly exposure: number;
  /** Optical depth of the haze across the domain near the ground. */
  readonly haze: number;
  /** Strength of contour lines without the overlay. */
  readonly contours: number;
}

export const LOOKS: Readonly<Record<Look, LookFigures>> = {
  natural: { index: 0, exposure: 1.3, haze: 0.2, contours: 0 },
  alpine: { index: 1, exposure: 0.82, haze: 0.2, contours: 0 },
  desert: { index: 2, exposure: 1.0, haze: 0.2, contours: 0 },
  paper: { index: 3, exposure: 1.45, haze: 0.05, contours: 0.6 },
};

/**
 * How far an eye opens as the sun sinks, 1 at 24 degrees. Light falls by a factor of thirty from there to half a degree; the
 * eye makes up for most of it, so that twilight stays darker than morning but can be seen.
 */
export function adaptation(sunElevationDeg: number): number {
  const s = Math.sin((Math.max(sunElevationDeg, 0) * Math.PI) / 180);
  return ((s + 0.354) / (s + 0.004) / 1.85) ** 0.7;
}

/** A round contour interval (1, 2 or 5 times a power of ten) that gives about `wanted` lines over the relief. */
export function contourInterval(reliefM: number, wanted = 24): number {
  const raw = Math.max(reliefM, 1e-3) / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  const mantissa = raw / power;
  return power * (mantissa <= 1 ? 1 : mantissa <= 2 ? 2 : mantissa <= 5 ? 5 : 10);
}
