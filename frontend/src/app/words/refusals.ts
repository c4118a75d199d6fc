/** What the server refuses, in the language of the page: by its code, for the server's own sentences are English. */

import { msg } from "@lit/localize";
import { language } from "../../core/language.ts";

/** Sentences for codes that say enough. A function: most pages need none of them. */
const sentences = (): Readonly<Record<string, string>> => ({
  bad_code: msg("This code is wrong or has ended. Ask for a new one."),
  bad_secret: msg("This link is not valid. Ask for a new one."),
  busy: msg("The server is still busy with this. Try again in a moment, or cancel what is under way."),
  cancelled: msg("The import was cancelled."),
  class_full: msg("This class is full. Ask your teacher for a place."),
  deleted_layer: msg("This layer was deleted. Restore it before you change it."),
  deleted_stroke: msg("This stroke was deleted. Restore it before you change it."),
  empty: msg("The file is empty."),
  frozen: msg("Your teacher has frozen your terrain: nobody draws for now."),
  group_full: msg("This group has all the people it may have. Choose another one."),
  hands_off: msg("Hands off: drawing is paused for now."),
  leaders_only: msg("Only who leads may do this."),
  locked_stroke: msg("This stroke is locked. Unlock it to change it."),
  moved: msg("This terrain moves to another server. Your page goes with it by itself."),
  no_class: msg("There is no such class of this terrain."),
  no_collection: msg("This collection is not on the server any more. Collect again."),
  no_copy: msg("There is no such copy in this class."),
  no_export: msg("This export is not on the server any more. Export again."),
  no_grid: msg("These elevation data are not on the server."),
  no_import: msg("There is no such import, or it ended long ago."),
  no_lesson: msg("There is no such lesson."),
  no_link: msg("There is no such link, or it was revoked."),
  no_pictures: msg("This server cannot draw pictures."),
  no_seat: msg("This class is over. Ask your teacher."),
  no_template: msg("There is no such starting terrain."),
  no_terrain: msg("There is no such terrain on this server."),
  not_allowed: msg("Your link does not allow this."),
  not_asked: msg("This import asks nothing at the moment."),
  not_done: msg("This is not done yet. Wait a moment."),
  not_found: msg("There is nothing here."),
  not_owner: msg("Only an owner of the terrain may do this."),
  own_link: msg("You cannot revoke the link that you came in by."),
  protected: msg("Your teacher protects this: it stays as it is."),
  quota: msg("There is no room for more elevation data of this terrain on the server."),
  rate_limited: msg("Too much came at once. Wait a minute."),
  removed: msg("You were sent out of this terrain. Ask whoever leads it to let you in."),
  revoked: msg("This link has been revoked. Ask for a new one."),
  room_full: msg("This terrain is full at the moment. Try again later."),
  server_error: msg("The server had a problem."),
  shutting_down: msg("The server is restarting."),
  storage: msg("The server has no room for this. Is its disk full?"),
  too_large: msg("This is too large for the server."),
  too_many_links: msg("There are too many links. Revoke some."),
  view_only: msg("This link lets you look, not draw. Ask for an edit link to change the terrain."),
});

/** The sentence for a person. In English it is the server's own, which knows most; so it is where the page has none. */
export function refusalWords(code: string, message: string): string {
  return language() === "en" ? message : (sentences()[code] ?? message);
}
