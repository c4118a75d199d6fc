/** What the server refuses, in the language of the page: by its code, for the server's own sentences are English. */

import { msg } from "@lit/localize";
import { language } from "../../core/language.ts";
import type { AnswerCode, CloseCode, RejectCode } from "../../generated/contract.ts";

/**
 * Codes whose English sentence stands in every language, for it carries facts that no sentence of the page has.
 * `refused` names what is wrong with a file of elevation data, or which copy of a class could not take a change, and why.
 */
type SaidByServer = "refused";

/** Codes that a page may be answered. */
type Refused = Exclude<AnswerCode | CloseCode | RejectCode, SaidByServer>;

/** A sentence for each code (SPEC U651). A function: most pages need none of them. */
const sentences = (): Readonly<Record<Refused, string>> => ({
  bad_archive: msg("This is no .esker file, or it is damaged, or a newer Esker made it."),
  bad_code: msg("This code is wrong or has ended. Ask for a new one."),
  bad_field: msg("This value does not fit this stroke."),
  bad_hello: msg("The server did not understand this page. Reload it."),
  bad_host: msg("This server does not go by the name in the address of this page."),
  bad_index: msg("This stroke is not the same here and on the server. Draw it again."),
  bad_origin: msg("This page does not come from the server that it talks to."),
  bad_protocol: msg("The server speaks another version of Esker. Reload this page."),
  bad_secret: msg("This link is not valid. Ask for a new one."),
  busy: msg("The server is still busy with this. Try again in a moment, or cancel what is under way."),
  cancelled: msg("The import was cancelled."),
  class_full: msg("This class is full. Ask your teacher for a place."),
  cut_off: msg("This did not reach the server whole. Try again."),
  deleted: msg("This terrain was deleted."),
  deleted_layer: msg("This layer was deleted. Restore it before you change it."),
  deleted_stroke: msg("This stroke was deleted. Restore it before you change it."),
  duplicate_layer: msg("This layer is there already."),
  duplicate_stroke: msg("This stroke is there already."),
  empty: msg("The file is empty."),
  error: msg("The server cannot do this."),
  frozen: msg("Your teacher has frozen your terrain: nobody draws for now."),
  group_full: msg("This group has all the people it may have. Choose another one."),
  hands_off: msg("Hands off: drawing is paused for now."),
  leaders_only: msg("Only who leads may do this."),
  locked_stroke: msg("This stroke is locked. Unlock it to change it."),
  lost: msg("The server went away meanwhile. Look whether this was done before you try again."),
  malformed: msg("The server did not understand what this page asked for. Reload it and try again."),
  moved: msg("This terrain moves to another server. Your page goes with it by itself."),
  no_class: msg("There is no such class of this terrain."),
  no_collection: msg("This collection is not on the server any more. Collect again."),
  no_copy: msg("There is no such copy in this class."),
  no_export: msg("This export is not on the server any more. Export again."),
  no_grid: msg("These elevation data are not on the server."),
  no_import: msg("There is no such import, or it ended long ago."),
  no_lesson: msg("There is no such lesson."),
  no_link: msg("There is no such link, or it was revoked."),
  no_page: msg("The page is not built on this server."),
  no_pictures: msg("This server cannot draw pictures."),
  no_seat: msg("This class is over. Ask your teacher."),
  no_template: msg("There is no such starting terrain."),
  no_terrain: msg("There is no such terrain on this server."),
  not_allowed: msg("Your link does not allow this."),
  not_asked: msg("This import asks nothing at the moment."),
  not_deleted: msg("This is not deleted: it is there."),
  not_done: msg("This is not done yet. Wait a moment."),
  not_found: msg("There is nothing here."),
  not_keeper: msg("Only the owner of the server's computer may see this. The command `esker link` prints how."),
  not_owner: msg("Only an owner of the terrain may do this."),
  out_of_domain: msg("This lies farther out, or higher, than a terrain of this size reaches."),
  own_link: msg("You cannot revoke the link that you came in by."),
  protected: msg("Your teacher protects this: it stays as it is."),
  quota: msg("There is no room for more elevation data of this terrain on the server."),
  rate_limited: msg("Too much came at once. Wait a minute."),
  removed: msg("You were sent out of this terrain. Ask whoever leads it to let you in."),
  revoked: msg("This link has been revoked. Ask for a new one."),
  room_full: msg("This terrain is full at the moment. Try again later."),
  secret_taken: msg("This did not work by chance. Reload the page and try again."),
  server_error: msg("The server had a problem."),
  server_only: msg("Only the server may do this."),
  shutting_down: msg("The server is restarting."),
  slow_client: msg("The connection was too slow to keep up."),
  starting: msg("The server is starting. Wait a moment."),
  storage: msg("The server has no room for this. Is its disk full?"),
  too_large: msg("This is too large for the server."),
  too_many_classes: msg("There are too many classes of this terrain. Delete one for good."),
  too_many_layers: msg("This terrain has as many layers as it can hold."),
  too_many_links: msg("There are too many links. Revoke some."),
  too_many_points: msg("This stroke, or this terrain, has as many points as it can hold."),
  too_many_strokes: msg("This terrain has as many strokes as it can hold."),
  unavailable: msg("The server cannot save anything at the moment. Nothing was changed; try again in a moment."),
  unknown: msg("Nobody knows whether this was done. Look before you try again."),
  unknown_layer: msg("There is no such elevation layer in this terrain."),
  unknown_stroke: msg("There is no such stroke in this terrain."),
  view_only: msg("This link lets you look, not draw. Ask for an edit link to change the terrain."),
});

/** The sentence for a person. In English it is the server's own, which knows most; so it is of codes of a newer server. */
export function refusalWords(code: string, message: string): string {
  if (language() === "en") return message;
  const known: Readonly<Record<string, string>> = sentences();
  return known[code] ?? message;
}
