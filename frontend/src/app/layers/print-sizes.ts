/** Scales of maps and models, as the server will make them (backend/esker/exporting/printing/layout.py). */

import { msg, str } from "@lit/localize";
import { counted } from "../../core/language.ts";

/** The room that a map has on paper, millimetres: its shorter side counts, as terrains are square. */
const FREE_MM = { a4: 170, a3: 257 } as const;
/** Scales are one of these times a power of ten. */
const ROUND = [1, 1.25, 1.5, 2, 2.5, 3, 4, 5, 7.5] as const;
const OFFERED = 7;

/** Denominators at which a terrain of `sizeM` metres fits the paper, the largest picture first. */
export function scalesFor(sizeM: number, paper: keyof typeof FREE_MM): readonly number[] {
  const least = (1000 * sizeM) / FREE_MM[paper];
  const out: number[] = [];
  for (let power = 10 ** Math.floor(Math.log10(least)); out.length < OFFERED; power *= 10)
    for (const k of ROUND)
      if (k * power >= least * (1 - 1e-12) && out.length < OFFERED) out.push(Math.round(k * power * 1e6) / 1e6);
  return out.filter((n) => Number.isInteger(n));
}

/** The scale of a solid, in words. */
export function solidWords(widthMm: number, sizeM: number): string {
  const scale = (1000 * sizeM) / widthMm;
  const rounded = Number(scale.toPrecision(3));
  return msg(str`That is a scale of about 1 : ${counted(rounded)}. The file is in millimetres, watertight, with z up.`);
}
