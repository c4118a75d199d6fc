/**
 * The language of the page, and numbers in it. The language is chosen once, before anything else of the page is loaded
 * (`app/device/language.ts`), so that words may stand in constants; a change loads the page anew.
 */

import { configureLocalization } from "@lit/localize";
import { sourceLocale, targetLocales } from "../generated/locales/codes.ts";

export type Language = typeof sourceLocale | (typeof targetLocales)[number];

const { getLocale, setLocale } = configureLocalization({
  sourceLocale,
  targetLocales,
  loadLocale: () => import("../generated/locales/de.ts"),
});

let regional: string = sourceLocale;

/** The language in which the page speaks. */
export const language = (): Language => getLocale() as Language;

/** Language and country by which numbers and days are written: "de-AT". */
export const region = (): string => regional;

/** Takes a language for the whole page. `tag`: the same with a country, where the browser names one. */
export async function speak(code: Language, tag: string = code): Promise<void> {
  await setLocale(code);
  regional = tag;
}

const formats = new Map<string, Intl.NumberFormat>();

function format(options: Intl.NumberFormatOptions): Intl.NumberFormat {
  const key = `${regional} ${JSON.stringify(options)}`;
  const known = formats.get(key) ?? new Intl.NumberFormat(regional, options);
  formats.set(key, known);
  return known;
}

const digitsOf = (digits: number): Intl.NumberFormatOptions => ({
  minimumFractionDigits: digits,
  maximumFractionDigits: digits,
});

/** A number with so many digits behind its point, and no minus before a zero: "12.40". */
export function fixed(value: number, digits = 0): string {
  return format({ ...digitsOf(digits), useGrouping: false, signDisplay: "negative" }).format(value);
}

/** A number with its own digits: "0.125". */
export function plain(value: number): string {
  return format({ maximumFractionDigits: 10, useGrouping: false }).format(value);
}

/** A number with so many digits that count: "1240", "0.0124". */
export function significant(value: number, digits: number): string {
  return plain(Number(value.toPrecision(digits)));
}

/** A large number in groups of three, as the language has them: "1,250". */
export function counted(value: number): string {
  return format({}).format(value);
}

/** A number in groups of three with a space between them, as on maps: "1 250.4". */
export function grouped(value: number, digits = 0): string {
  return format({ ...digitsOf(digits), useGrouping: true })
    .formatToParts(value)
    .map((part) => (part.type === "group" ? " " : part.value))
    .join("");
}

/** Somebody and what they did: a sentence in English, a heading and a note in languages whose verbs follow the person. */
export function whoDid(who: string, did: string): string {
  return language() === "en" ? `${who} ${did}` : `${who}: ${did}`;
}

/** A word that begins a line, as it stands within a sentence. German nouns keep their capital. */
export function midSentence(word: string): string {
  return language() === "en" ? word.toLowerCase() : word;
}
