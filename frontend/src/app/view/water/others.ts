/** The places from which other people follow water: their presence says so by the name of the tool. */

import type { Place } from "../../../core/measure/places.ts";
import type { Rgba } from "../../../core/types.ts";
import { hexColour } from "../colours.ts";
import type { People } from "../scene.ts";

/** The name of the tool in presence messages. */
export const WATER = "water";
/** More ways than these are not shown. */
const MOST_SHOWN = 8;

export interface OtherDrop {
  readonly place: Place;
  readonly colour: Rgba;
}

export function otherDrops({ members, presences, me }: People): readonly OtherDrop[] {
  return members
    .flatMap(({ client, colour }) => {
      const presence = client === me ? undefined : presences.get(client);
      if (presence?.tool !== WATER || !presence.cursor) return [];
      const [x, y] = presence.cursor;
      return [{ place: [x, y] as const, colour: hexColour(colour) }];
    })
    .slice(0, MOST_SHOWN);
}
