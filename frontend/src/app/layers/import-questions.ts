/** The questions of an import as the page understands them (`backend/esker/importing/questions.py`). Pure. */

import { msg, str } from "@lit/localize";
import type { ImportQuestion } from "../../generated/contract.ts";

/** Asked of a grid that says nothing of where it lies or how large it is. */
export const SIZE_QUESTION = "size";
/** Asked of a grid whose heights the terrain cannot hold. */
const HEIGHT_QUESTION = "height";
const PLACE_QUESTION = "place";
/** The answer that means: in the middle of the terrain, from where I move it myself. */
const MIDDLE = "middle";
/** The answer that gives the file up. */
const STOP = "stop";

/** Says whether this answer leaves it to me where the grid lies. */
export function laidByHand({ id }: ImportQuestion, answer: string): boolean {
  return id === SIZE_QUESTION || (id === PLACE_QUESTION && answer === MIDDLE);
}

/** Says whether placing a grid by hand answers a question: where it lies, how large it is, and how high. */
export function handAnswers({ id }: ImportQuestion): boolean {
  return id === SIZE_QUESTION || id === HEIGHT_QUESTION;
}

/** Returns the questions that a person is still to be asked while placing a grid by hand. */
export function leftToAsk(
  questions: readonly ImportQuestion[],
  answers: Readonly<Record<string, string>>,
): readonly ImportQuestion[] {
  return questions.filter((q) => !handAnswers(q) && !laidByHand(q, answers[q.id] ?? q.default));
}

/**
 * Says whether a coordinate system may be named. It may not where the file has one and lies elsewhere: such a file is
 * laid by hand or not at all.
 */
export function namesSystem({ id, options }: ImportQuestion): boolean {
  return id === PLACE_QUESTION && !options.includes(STOP);
}

/** Says whether a refusal names the formats that there are (`backend/esker/importing/opening.py`). */
export function listsFormats(refusal: string): boolean {
  return refusal.includes("There are: ");
}

/** Lowest and highest height from an answer such as "0..4380"; null for any other text. */
export function heightRange(answer: string | undefined): readonly [number, number] | null {
  const match = /^\s*(-?[\d.]+(?:e[+-]?\d+)?)\s*\.\.\s*(-?[\d.]+(?:e[+-]?\d+)?)\s*$/i.exec(answer ?? "");
  if (match === null) return null;
  const [low, high] = [Number(match[1]), Number(match[2])];
  return Number.isFinite(low) && Number.isFinite(high) && low <= high ? [low, high] : null;
}

/** The question above two fields: how to write both into one belongs to the command line. */
export function rangeWords(text: string): string {
  return text.replace(/\s*Write low\.\.high\.?\s*$/, "");
}

/** A picture says nothing of heights: as relief it begins with so much of its side's length. */
const RELIEF_SHARE = 0.25;

/** The range with which a picture that is laid by hand begins: low ground at zero, metres. */
export function reliefRange(sideM: number): string {
  return `0..${Number((RELIEF_SHARE * sideM).toPrecision(3))}`;
}

const WORDS: Readonly<Record<string, Readonly<Record<string, string>>>> = {
  place: {
    middle: msg("I lay it on the terrain by hand"),
    stop: msg("Do not bring it in"),
    "EPSG:4326": msg("Degrees of latitude and longitude (EPSG:4326)"),
  },
  imagery: { elevation: msg("Take it as elevation"), stop: msg("Do not bring it in") },
  nodata: { none: msg("No, they are heights") },
  unit: { feet: msg("Feet"), metres: msg("Metres") },
  rows: { "north first": msg("The northern row first"), "south first": msg("The southern row first") },
  height: { shift: msg("Yes, shift all its heights"), stop: msg("Do not bring it in") },
};

/** An option as a person reads it. */
export function optionWords(question: string, option: string): string {
  const words = WORDS[question]?.[option];
  if (words !== undefined) return words;
  if (question === "nodata") return msg(str`Yes, leave out ${option}`);
  return option.length > 0 ? option[0]!.toUpperCase() + option.slice(1) : msg("Nothing");
}
