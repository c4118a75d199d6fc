/** Paints in words and colours. */

import { msg, str } from "@lit/localize";
import { midSentence } from "../../core/language.ts";
import type { Paint, PaintChannel } from "../../generated/contract.ts";

export interface Substance {
  readonly title: string;
  /** Colour of swatches, lines and the ring of the brush, `#rrggbb`. */
  readonly colour: string;
  /** Words for painting more of the channel, and for painting less. */
  readonly more: string;
  readonly less: string;
}

export const SUBSTANCES: Readonly<Record<PaintChannel, Substance>> = {
  snow: { title: msg("Snow"), colour: "#f2f7ff", more: msg("Snow lies here."), less: msg("Snow melts here.") },
  forest: { title: msg("Forest"), colour: "#2f8f4e", more: msg("Trees grow here."), less: msg("No trees grow here.") },
  grass: { title: msg("Meadow"), colour: "#9ccb3c", more: msg("Grass grows here."), less: msg("No grass grows here.") },
  wetness: {
    title: msg("Wetness"),
    colour: "#3aa6e0",
    more: msg("The ground is wet."),
    less: msg("The ground dries."),
  },
  roughness: {
    title: msg("Roughness"),
    colour: "#c9563c",
    more: msg("More small detail."),
    less: msg("Less small detail."),
  },
  amplitude: {
    title: msg("Relief"),
    colour: "#b98a4a",
    more: msg("Detail stands higher."),
    less: msg("Detail flattens out."),
  },
  erosion: {
    title: msg("Gullies"),
    colour: "#9a7b63",
    more: msg("Water cuts gullies here."),
    less: msg("No gullies here."),
  },
};

/** Returns the effect of a paint, in a sentence. */
export function paintWords({ channel, value }: Paint): string {
  const { more, less } = SUBSTANCES[channel];
  return value < 0 ? less : more;
}

/** "Snow", "No snow": the name of a line of paint that has none of its own. */
export function paintName({ channel, value }: Paint): string {
  const { title } = SUBSTANCES[channel];
  return value < 0 ? msg(str`Less ${midSentence(title)}`) : title;
}
