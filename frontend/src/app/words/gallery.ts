/** Starting terrains and lessons of the gallery, in the language of the page: the server's words for them are English. */

import { msg } from "@lit/localize";
import { language } from "../../core/language.ts";
import type { TemplateInfo } from "../../core/types.ts";

type Words = Pick<TemplateInfo, "title" | "description">;

const words = (): Readonly<Record<string, Words>> => ({
  "figure-six": {
    title: msg("Figure six"),
    description: msg("The paper's own landscape: mountains and crevices, with plateaux in the midst."),
  },
  "alpine-ridge": {
    title: msg("Alpine ridge"),
    description: msg("A divide with horns and spurs above a broad valley with its river."),
  },
  canyon: {
    title: msg("Canyon"),
    description: msg("A river between two tablelands: terraces, side canyons and buttes left standing."),
  },
  "volcanic-island": {
    title: msg("Volcanic island"),
    description: msg("A breached crater that holds a lake, ridges running to the coast, and a side cone by the bay."),
  },
  archipelago: {
    title: msg("Archipelago"),
    description: msg("An arc of drowned ridges around a lagoon, with skerries and sandbars."),
  },
  delta: { title: msg("Delta"), description: msg("A river parts on a plain and builds its arms out into the sea.") },
  badland: {
    title: msg("Badland"),
    description: msg("Clay hills cut to ribs and gullies by rain, under a tableland that still stands."),
  },
  rainier: {
    title: msg("Rainier and the Sound"),
    description: msg(
      "Real ground: Puget Sound and Mount Rainier, two surveys of their own grain and angle, blended live.",
    ),
  },
  helens: {
    title: msg("Mount St Helens"),
    description: msg(
      "A crater in three surveys: 2000 and twice in October 2004. Hide a layer and watch the new dome go.",
    ),
  },
  "reading-contours": {
    title: msg("Reading contours"),
    description: msg("From brown lines on paper to hills one can look at: build the land that a contour map shows."),
  },
  "drawing-the-profile": {
    title: msg("Drawing the profile"),
    description: msg("Coast, cliff, tableland, valley and peak: draw the section that the dashed line asks for."),
  },
  "where-does-the-rain-go": {
    title: msg("Where does the rain go?"),
    description: msg("Two valleys, one point: lead more rain through it by moving a stream."),
  },
  "dam-a-valley": {
    title: msg("Dam a valley"),
    description: msg("Find the narrow place and hold sixty million cubic metres, with as little dam as you can."),
  },
  "a-rising-sea": {
    title: msg("A rising sea"),
    description: msg("A low island, and the sea will stand seven metres higher. Keep four square kilometres dry."),
  },
  "helens-before-1980": {
    title: msg("Mount St Helens before 1980"),
    description: msg("Real ground of today. Rebuild the summit that was blown away, and see how much that was."),
  },
});

/** Title and description to show. What a server adds to the gallery has its own. */
export function galleryWords({ id, title, description }: TemplateInfo): Words {
  return (language() === "en" ? undefined : words()[id]) ?? { title, description };
}
