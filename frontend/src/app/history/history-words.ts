/** What somebody did, in the language of the page. The server's sentence is English; in other languages facts become words here. Pure. */

import { msg, str } from "@lit/localize";
import { language, midSentence } from "../../core/language.ts";
import { TERRAIN_WORDS } from "../../doc/changes.ts";
import type { PaintChannel } from "../../generated/contract.ts";
import { SUBSTANCES } from "../words/paints.ts";
import type { HistoryEntry, HistoryFacts } from "./history.ts";

const did = (action: string, what: string): string => {
  switch (action) {
    case "draw":
      return msg(str`drew ${what}`);
    case "paint":
      return msg(str`painted ${what}`);
    case "move":
      return msg(str`moved ${what}`);
    case "reshape":
      return msg(str`reshaped ${what}`);
    case "hide":
      return msg(str`hid ${what}`);
    case "show":
      return msg(str`showed ${what}`);
    case "name":
      return msg(str`named ${what}`);
    case "lock":
      return msg(str`locked ${what}`);
    case "unlock":
      return msg(str`unlocked ${what}`);
    case "delete":
      return msg(str`deleted ${what}`);
    case "restore":
      return msg(str`brought back ${what}`);
    case "layer":
      return msg(str`added ${what}`);
    case "order":
      return msg(str`reordered ${what}`);
    default:
      return msg(str`changed ${what}`);
  }
};

/** The switch thrown the other way: an undo of it is told as what became of the thing, as the server does. */
const OPPOSITE: Readonly<Record<string, string>> = { hide: "show", show: "hide", lock: "unlock", unlock: "lock" };

const noun = (name: string): string => {
  switch (name) {
    case "river":
      return msg("River");
    case "road":
      return msg("Road");
    case "ridge":
      return msg("Ridge");
    case "plateau":
      return msg("Plateau");
    case "crevice":
      return msg("Crevice");
    case "mountain":
      return msg("Mountain");
    default:
      return msg("Stroke");
  }
};

const called = (word: string, label: string): string => (label === "" ? word : msg(str`${word} “${label}”`));

function thing(action: string, facts: HistoryFacts): string {
  const { kind, count, label, paint } = facts;
  if (action === "several") return msg("several things");
  if (action === "settings") return settings(facts.fields ?? []);
  if (count > 1) {
    if (kind === "stroke") return msg(str`${count} strokes`);
    return kind === "layer" ? msg(str`${count} layers`) : msg(str`${count} things`);
  }
  if (kind === "layer") return called(msg("Layer"), label);
  if (paint !== "" && action === "paint") return SUBSTANCES[paint as PaintChannel].title;
  if (paint !== "") return msg(str`paint (${midSentence(SUBSTANCES[paint as PaintChannel].title)})`);
  if (facts.noun === "" && action === "paint") return msg("the ground");
  return called(noun(facts.noun), label);
}

/** More settings than this are not listed. */
const MANY = 3;

function settings(fields: readonly string[]): string {
  const words = Object.entries(TERRAIN_WORDS).flatMap(([field, word]) => (fields.includes(field) ? [word] : []));
  return words.length === 0 || words.length > MANY
    ? msg("the settings")
    : new Intl.ListFormat(language(), { type: "conjunction" }).format(words);
}

/** What was done, to stand after the name of who did it. */
export function historyWords({ action, turn, text, facts }: HistoryEntry): string {
  if (language() === "en" || facts === undefined) return text;
  const what = thing(action, facts);
  const opposite = OPPOSITE[action];
  if (turn === "") return did(action, what);
  if (opposite !== undefined) return msg(str`again: ${did(turn === "undo" ? opposite : action, what)}`);
  return turn === "undo" ? msg(str`undone: ${did(action, what)}`) : msg(str`redone: ${did(action, what)}`);
}
