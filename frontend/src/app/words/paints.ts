/** Paints in words and colours. */

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
  snow: { title: "Snow", colour: "#f2f7ff", more: "Snow lies here.", less: "Snow melts here." },
  forest: { title: "Forest", colour: "#2f8f4e", more: "Trees grow here.", less: "No trees grow here." },
  grass: { title: "Meadow", colour: "#9ccb3c", more: "Grass grows here.", less: "No grass grows here." },
  wetness: { title: "Wetness", colour: "#3aa6e0", more: "The ground is wet.", less: "The ground dries." },
  roughness: { title: "Roughness", colour: "#c9563c", more: "More small detail.", less: "Less small detail." },
  amplitude: { title: "Relief", colour: "#b98a4a", more: "Detail stands higher.", less: "Detail flattens out." },
  erosion: { title: "Gullies", colour: "#9a7b63", more: "Water cuts gullies here.", less: "No gullies here." },
};

/** Returns the effect of a paint, in a sentence. */
export function paintWords({ channel, value }: Paint): string {
  const { more, less } = SUBSTANCES[channel];
  return value < 0 ? less : more;
}

/** "Snow", "No snow": the name of a line of paint that has none of its own. */
export function paintName({ channel, value }: Paint): string {
  const { title } = SUBSTANCES[channel];
  return value < 0 ? `Less ${title.toLowerCase()}` : title;
}
