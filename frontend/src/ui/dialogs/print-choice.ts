/** What only things for the hand have a choice of: paper, scale and contours of a map; size, base and heights of a solid. */

import { msg, str } from "@lit/localize";
import { html, type TemplateResult } from "lit";
import { type Exporter, isMap } from "../../app/layers/exports.ts";
import { scalesFor, solidWords } from "../../app/layers/print-sizes.ts";
import { contourSteps } from "../../app/view/instruments/contour-steps.ts";
import { counted } from "../../core/language.ts";

/** The part of the export's form for contour maps and solids. */
export function printChoice(exporter: Exporter, sizeM: number): TemplateResult {
  return isMap(exporter.choice.value.format) ? paperChoice(exporter, sizeM) : modelChoice(exporter, sizeM);
}

function paperChoice(exporter: Exporter, sizeM: number): TemplateResult {
  const { paper } = exporter.choice.value;
  const scales = scalesFor(sizeM, paper.size);
  const choose = (fields: Partial<typeof paper>): void => exporter.choose({ paper: { ...paper, ...fields } });
  return html`<div class="pair">
    <label class="row">
      ${msg("Paper")}
      <select
        class="field"
        @change=${(e: Event) => choose({ size: (e.target as HTMLSelectElement).value as "a4" | "a3", scale: 0 })}
      >
        <option value="a4" ?selected=${paper.size === "a4"}>A4</option>
        <option value="a3" ?selected=${paper.size === "a3"}>A3</option>
      </select>
    </label>
    <label class="row">
      ${msg("Scale")}
      <select class="field" @change=${(e: Event) => choose({ scale: Number((e.target as HTMLSelectElement).value) })}>
        <option value="0" ?selected=${paper.scale === 0}>${msg(str`1 : ${counted(scales[0]!)}, the largest that fits`)}</option>
        ${scales
          .slice(1)
          .map((n) => html`<option value=${n} ?selected=${n === paper.scale}>1 : ${counted(n)}</option>`)}
      </select>
    </label>
    <label class="row">
      ${msg("Contours")}
      <select
        class="field"
        @change=${(e: Event) => choose({ interval_m: Number((e.target as HTMLSelectElement).value) })}
      >
        ${contourSteps().map(
          ({ value, label }) => html`<option value=${value} ?selected=${value === paper.interval_m}>${label}</option>`,
        )}
      </select>
    </label>
  </div>`;
}

function modelChoice(exporter: Exporter, sizeM: number): TemplateResult {
  const { model } = exporter.choice.value;
  const field = (label: string, name: keyof typeof model, low: number, high: number, step: number): TemplateResult =>
    html`<label class="row">
      ${label}
      <input
        class="field"
        type="number"
        required
        min=${low}
        max=${high}
        step=${step}
        .value=${String(model[name])}
        @change=${(e: Event) => {
          const input = e.target as HTMLInputElement;
          if (input.reportValidity()) exporter.choose({ model: { ...model, [name]: input.valueAsNumber } });
        }}
      />
    </label>`;
  return html`<div class="pair">
      ${field(msg("Longer side, mm"), "width_mm", 10, 2000, 1)} ${field(msg("Base under the lowest point, mm"), "base_mm", 0.2, 200, 0.1)}
      ${field(msg("Heights times"), "exaggeration", 0.1, 20, 0.1)}
    </div>
    <p class="note">${solidWords(model.width_mm, sizeM)}</p>`;
}
