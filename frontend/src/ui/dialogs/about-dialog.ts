import { msg, str } from "@lit/localize";
import { fixed } from "../../core/language.ts";
import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import { html, nothing, type TemplateResult } from "lit";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import type { Graphics } from "../../app/view/graphics.ts";

/** The facts that the dialog shows. */
export interface AboutTerrain {
  readonly sizeM: number;
  /** Finest level that is solved everywhere. */
  readonly levels: number;
  /** Finest level to which tiles are refined where somebody looks. */
  readonly finest: number;
  readonly graphics: Pick<Graphics, "info" | "reason">;
  readonly session: Pick<OpenTerrain, "server" | "doc" | "connection">;
}

/** Facts about this terrain, what draws it and what solves it. Styled by the page (`.facts`). */
export function aboutDialog(about: AboutTerrain, open: boolean, close: () => void): TemplateResult {
  const { session, sizeM, levels, finest, graphics } = about;
  const server = session.server.value;
  const facts = [
    [msg("Size"), msg(str`${fixed(sizeM / 1000, sizeM < 10_000 ? 2 : 0)} km a side`)],
    [msg("Strokes"), String(session.doc.doc.value?.strokes.size ?? 0)],
    [msg("Operations so far"), String(session.doc.doc.value?.clock ?? 0)],
    [msg("Finest solved level"), msg(str`${levels} (${64 * 2 ** levels + 1} samples a side)`)],
    [msg("Refined where one looks"), finest > levels ? msg(str`to level ${finest}`) : "no"],
    [msg("Drawn by"), graphics.info.value?.description ?? "–"],
    [msg("Solved on"), server?.device ?? "–"],
    [msg("Server"), server ? server.version.replace(/^esker/, "Esker") : "–"],
    [
      msg("Round trip"),
      session.connection.rttMs.value === null ? "–" : `${Math.round(session.connection.rttMs.value)} ms`,
    ],
  ];
  return html`<wa-dialog label=${msg("About this terrain")} light-dismiss ?open=${open} @wa-after-hide=${close}>
    <dl class="facts">${facts.map(([k, v]) => html`<dt>${k}</dt><dd>${v}</dd>`)}</dl>
    ${graphics.reason.value ? html`<p class="quiet">${graphics.reason.value}</p>` : nothing}
  </wa-dialog>`;
}
