import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import { html, nothing, type TemplateResult } from "lit";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import { ApiError } from "../../app/server/api.ts";
import { untilDay } from "../../app/server/deletion.ts";

/** The terrain that the question before a deletion names, and the function that deletes it. */
type Deletable = Pick<OpenTerrain, "doc" | "members" | "deletion" | "toasts">;

/** Asks an owner before the terrain is deleted for everybody. `remove` deletes it. */
export function deleteDialog(session: Deletable, open: boolean, close: () => void): TemplateResult {
  const title = session.doc.doc.value?.settings.title || msg("Untitled terrain");
  const others = session.members.value.length - 1;
  const remove = async (event: Event): Promise<void> => {
    const button = event.currentTarget as HTMLButtonElement;
    button.disabled = true;
    try {
      await session.deletion.delete();
    } catch (error) {
      session.toasts.show(error instanceof ApiError ? error.message : msg("Deleting failed. Try again."), "warn");
    } finally {
      button.disabled = false;
      close();
    }
  };
  const here =
    others > 0
      ? ` ${others === 1 ? msg("One other person is in it now.") : msg(str`${others} others are in it now.`)}`
      : "";
  return html`<wa-dialog label=${msg(str`Delete “${title}”?`)} light-dismiss ?open=${open} @wa-after-hide=${close}>
    <p>${msg(str`It closes for everybody, and no link opens it any more.${here}`)}</p>
    <p>${msg("For seven days you can bring it back with this link. After that it is gone, with its history.")}</p>
    <button slot="footer" class="btn outline" autofocus @click=${close}>${msg("Keep it")}</button>
    <button slot="footer" class="btn danger" @click=${remove}>${msg("Delete this terrain")}</button>
  </wa-dialog>`;
}

/** For owners of a deleted terrain: brings it back, and opens it. */
export function bringBack(session: Pick<OpenTerrain, "deletion" | "toasts">): TemplateResult | typeof nothing {
  const deleted = session.deletion.deleted.value;
  if (!deleted?.restorable) return nothing;
  const back = async (event: Event): Promise<void> => {
    const button = event.currentTarget as HTMLButtonElement;
    button.disabled = true;
    try {
      await session.deletion.bringBack();
      window.location.reload();
    } catch (error) {
      session.toasts.show(error instanceof ApiError ? error.message : msg("That failed. Try again."), "warn");
      button.disabled = false;
    }
  };
  return html`<span class="until">${msg(str`You can bring it back ${untilDay(deleted)}.`)}</span>
    <button class="btn primary" @click=${back}>${msg("Bring it back")}</button>`;
}
