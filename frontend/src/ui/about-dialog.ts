import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import { html, nothing, type TemplateResult } from "lit";
import type { Stage } from "./stage.ts";

/** What this terrain is, what draws it and what solves it. Styled by the page (`.facts`). */
export function aboutDialog(stage: Stage, open: boolean, close: () => void): TemplateResult {
  const { session, sizeM } = stage;
  const server = session.server.value;
  const facts = [
    ["Size", `${(sizeM / 1000).toFixed(sizeM < 10_000 ? 2 : 0)} km a side`],
    ["Strokes", String(session.doc.doc.value?.strokes.size ?? 0)],
    ["Operations so far", String(session.doc.doc.value?.clock ?? 0)],
    ["Finest solved level", `${stage.levels} (${64 * 2 ** stage.levels + 1} samples a side)`],
    ["Refined where one looks", stage.finest > stage.levels ? `to level ${stage.finest}` : "no"],
    ["Drawn by", stage.graphics.info.value?.description ?? "–"],
    ["Solved on", server?.device ?? "–"],
    ["Server", server ? `Esker ${server.version}` : "–"],
    ["Round trip", session.connection.rttMs.value === null ? "–" : `${Math.round(session.connection.rttMs.value)} ms`],
  ];
  return html`<wa-dialog label="About this terrain" light-dismiss ?open=${open} @wa-after-hide=${close}>
    <dl class="facts">${facts.map(([k, v]) => html`<dt>${k}</dt><dd>${v}</dd>`)}</dl>
    ${stage.graphics.reason.value ? html`<p class="quiet">${stage.graphics.reason.value}</p>` : nothing}
  </wa-dialog>`;
}
