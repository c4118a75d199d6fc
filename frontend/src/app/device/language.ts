/** The page speaks the browser's language until somebody chooses one; the device remembers the choice. */

import { type Language, speak } from "../../core/language.ts";
import { deviceStore, type Store } from "./storage.ts";

const KEY = "esker.language";

/** Languages that there are, each by its own name. */
export const LANGUAGES: readonly { readonly code: Language; readonly name: string }[] = [
  { code: "en", name: "English" },
  { code: "de", name: "Deutsch" },
];

const known = (code: string | null): Language | null => LANGUAGES.find((l) => l.code === code)?.code ?? null;
const codeOf = (tag: string): string => tag.toLowerCase().split("-")[0]!;

/**
 * The language for a person whose browser prefers `tags`, most wanted first, and who may have chosen one; with the country that
 * the browser names for it, so that numbers and days are written as there.
 */
export function fitting(tags: readonly string[], chosen: string | null): { code: Language; tag: string } {
  const code = known(chosen) ?? tags.map((tag) => known(codeOf(tag))).find((found) => found !== null) ?? "en";
  return { code, tag: tags.find((tag) => codeOf(tag) === code && isTag(tag)) ?? code };
}

function isTag(tag: string): boolean {
  try {
    return Intl.getCanonicalLocales(tag).length === 1;
  } catch {
    return false;
  }
}

function chosenLanguage(store: Store): string | null {
  try {
    return store.getItem(KEY);
  } catch {
    return null;
  }
}

/** Takes the language before anything else of the page is loaded. Without its catalogue the page speaks English. */
export async function startLanguage(): Promise<void> {
  const { code, tag } = fitting(navigator.languages, chosenLanguage(deviceStore()));
  try {
    await speak(code, tag);
    document.documentElement.lang = code;
  } catch {
    // The catalogue did not arrive: the words of the source are English.
  }
}

/** Remembers a language and loads the page anew in it: words stand in constants too. */
export function chooseLanguage(code: Language): void {
  try {
    deviceStore().setItem(KEY, code);
  } catch {
    // A full store loses a convenience only.
  }
  window.location.reload();
}
