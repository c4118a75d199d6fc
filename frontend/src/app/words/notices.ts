/** What conductors are told of what they asked for, in the language of the page: by its code, for the server's own sentences are English. */

import { msg, str } from "@lit/localize";
import { language } from "../../core/language.ts";
import { MAX_GROUPED, MAX_GROUPS, type Notice, type NoticeCode } from "../../generated/contract.ts";

/** A sentence for each code (SPEC L165). `who`: the people of whom it tells. */
const sentences = (who: string): Readonly<Record<NoticeCode, string>> => ({
  not_leading: msg("Only whoever leads the lesson may do this."),
  owners_only: msg("Only an owner of the terrain may say who else leads."),
  not_owners: msg("An owner of the terrain cannot be sent out. Their link can be revoked."),
  not_leaders: msg("Only an owner may send out somebody who leads too."),
  not_yourself: msg("You cannot send yourself out."),
  nobody: msg("Nobody like that is here, or was here a while ago."),
  unsaved: msg("The server could not save this (is its disk full?). It holds until the server stops."),
  undo_busy: msg("What somebody did is being taken back already. Try again in a moment."),
  unreadable: msg("The history could not be read, so nothing was taken back."),
  too_many_groups: msg(str`A lesson has at most ${MAX_GROUPS} groups. Forget one first.`),
  too_many_grouped: msg(str`The groups of a lesson hold at most ${MAX_GROUPED} people. Take somebody out first.`),
  taken_back: msg(str`Everything that ${who} did was taken back.`),
  taken_back_but: msg(str`Everything that ${who} did was taken back. What others have changed since was kept.`),
  nothing_stands: msg(str`Nothing that ${who} did still stands.`),
  nothing_taken_back: msg("What others have changed since was kept. Nothing was taken back."),
  refused: msg(str`Not everything that ${who} did could be taken back.`),
});

/** The sentence for a person. In English it is the server's own; so it is of codes of a newer server. */
export function noticeWords({ code, names, text }: Notice): string {
  if (language() === "en") return text;
  const who = names.length === 0 ? msg("they") : new Intl.ListFormat(language()).format(names);
  const known: Readonly<Record<string, string>> = sentences(who);
  return known[code] ?? text;
}
