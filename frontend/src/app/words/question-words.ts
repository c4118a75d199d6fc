/**
 * What an elevation file leaves open, asked in the language of the page: the server's questions are English. A question says what it is
 * by its id, its options and the figures of its sentence; where these are not those that are known here, the server's sentence stands.
 */

import { msg, str } from "@lit/localize";
import { grouped, language } from "../../core/language.ts";
import type { ImportQuestion } from "../../generated/contract.ts";

/** The sentence to show for a question. */
export function questionWords(question: ImportQuestion): string {
  if (language() === "en") return question.text;
  return asked(question) ?? question.text;
}

function asked({ id, text, options }: ImportQuestion): string | null {
  switch (id) {
    case "type":
      return msg("It has no header. Of which type are its samples?");
    case "shape":
      return msg("It has no header. How many columns and rows has it?");
    case "band":
      return msg(str`It has ${options.length} bands. Which one holds the elevation?`);
    case "rows":
      return msg("It does not say whether its first row is the northern or the southern one.");
    case "encoding":
      return msg("It has three colours. In which code do they hold heights?");
    case "unit":
      return msg("Its coordinates are in feet, and it does not say in what its heights are.");
    case "imagery":
      return msg("It has 8 bits: at most 256 steps of height, as pictures have. Take it as elevation?");
    case "size":
      return msg(
        "It does not say how large it is. How wide is it on the ground, in metres? (fit: as wide as the terrain)",
      );
    case "nodata":
      return nodata(text, options[0]);
    case "range":
      return range(text);
    case "height":
      return height(text);
    case "place":
      return place(text, options);
    default:
      return null;
  }
}

function nodata(text: string, values: string | undefined): string | null {
  const share = /\(([\d.]+)% of them\)/.exec(text)?.[1];
  if (values === undefined || share === undefined) return null;
  return msg(
    str`${values}: far apart from all other samples (${grouped(Number(share), 2)} % of them), and not declared as nodata. Leave these samples out?`,
  );
}

function range(text: string): string | null {
  const [, low, high] = /from (\S+) to (\S+) without a unit/.exec(text) ?? [];
  if (low === undefined || high === undefined) return null;
  return msg(
    str`Its samples run from ${low} to ${high} without a unit. How high is the lowest and the highest, in metres?`,
  );
}

function height(text: string): string | null {
  const found =
    /reach ([\d,]+) m from zero; a terrain ([\d,]+) m wide holds ([\d,]+) m\. (Lower|Raise) it by ([\d,]+) m\? .* at least ([\d,]+) m wide/.exec(
      text,
    );
  if (found === null) return null;
  const figure = (k: number): string => grouped(Number(found[k]!.replaceAll(",", "")));
  const [farthest, size, held, shift, least] = [1, 2, 3, 5, 6].map(figure) as [string, string, string, string, string];
  return found[4] === "Lower"
    ? msg(
        str`Its heights reach ${farthest} m from zero; a terrain ${size} m wide holds ${held} m. Lower it by ${shift} m? As it is, it needs a terrain at least ${least} m wide.`,
      )
    : msg(
        str`Its heights reach ${farthest} m from zero; a terrain ${size} m wide holds ${held} m. Raise it by ${shift} m? As it is, it needs a terrain at least ${least} m wide.`,
      );
}

function place(text: string, options: readonly string[]): string | null {
  const far = /lies ([\d,]+) km from the middle/.exec(text)?.[1];
  if (far !== undefined)
    return msg(
      str`It lies ${grouped(Number(far.replaceAll(",", "")))} km from the middle of this terrain, outside it. Lay it in the middle?`,
    );
  // Other reasons name a coordinate system and say what is wrong with it: the server knows them.
  const nameless = text.startsWith("It does not name its coordinate system.");
  if (!nameless) return null;
  return options.includes("EPSG:4326")
    ? msg(
        "It does not name its coordinate system. Its numbers look like degrees (EPSG:4326). In which system does it lie? An EPSG code, or middle: laid by hand.",
      )
    : msg(
        "It does not name its coordinate system. Lay it in the middle of the terrain, to be moved by hand (its numbers taken for metres)? Or give an EPSG code.",
      );
}
