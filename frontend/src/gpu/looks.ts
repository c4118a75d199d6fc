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
  alpine: { index: 1, exposure: 0.9, haze: 0.2, contours: 0 },
  desert: { index: 2, exposure: 1.0, haze: 0.2, contours: 0 },
  paper: { index: 3, exposure: 1.8, haze: 0.06, contours: 0.5 },
};

/** A round contour interval (1, 2 or 5 times a power of ten) that gives about `wanted` lines over the relief. */
export function contourInterval(reliefM: number, wanted = 24): number {
  const raw = Math.max(reliefM, 1e-3) / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  const mantissa = raw / power;
  return power * (mantissa <= 1 ? 1 : mantissa <= 2 ? 2 : mantissa <= 5 ? 5 : 10);
}
