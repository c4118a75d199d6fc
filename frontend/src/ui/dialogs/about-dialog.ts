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
    ["Size", `${(sizeM / 1000).toFixed(sizeM < 10_000 ? 2 : 0)} km a side`],
    ["Strokes", String(session.doc.doc.value?.strokes.size ?? 0)],
    ["Operations so far", String(session.doc.doc.value?.clock ?? 0)],
    ["Finest solved level", `${levels} (${64 * 2 ** levels + 1} samples a side)`],
    ["Refined where one looks", finest > levels ? `to level ${finest}` : "no"],
    ["Drawn by", graphics.info.value?.description ?? "–"],
    ["Solved on", server?.device ?? "–"],
    ["Server", server ? server.version.replace(/^esker/, "Esker") : "–"],
    ["Round trip", session.connection.rttMs.value === null ? "–" : `${Math.round(session.connection.rttMs.value)} ms`],
  ];
  return html`<wa-dialog label="About this terrain" light-dismiss ?open=${open} @wa-after-hide=${close}>
    <dl class="facts">${facts.map(([k, v]) => html`<dt>${k}</dt><dd>${v}</dd>`)}</dl>
    ${graphics.reason.value ? html`<p class="quiet">${graphics.reason.value}</p>` : nothing}
  </wa-dialog>`;
}
