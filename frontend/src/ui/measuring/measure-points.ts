/** The points of what is measured as numbers: for keyboards, and for places that one knows. */

import { msg, str } from "@lit/localize";
import { html, nothing, type TemplateResult } from "lit";
import type { Ruler } from "../../input/tools/ruler.ts";
import { icon } from "../controls/icons.ts";

export function pointFields(ruler: Ruler, sizeM: number): TemplateResult | typeof nothing {
  const points = ruler.points.value;
  if (points.length === 0) return nothing;
  const field = (index: number, axis: 0 | 1): TemplateResult => html`<esk-number
    label=${msg(str`${axis === 0 ? msg("East") : msg("North")} of point ${index + 1}`)}
    unit="m"
    .min=${0}
    .max=${sizeM}
    .digits=${1}
    .value=${points[index]![axis]}
    @number=${(e: CustomEvent<number>) => {
      const [x, y] = points[index]!;
      ruler.put(index, axis === 0 ? [e.detail, y] : [x, e.detail]);
    }}
  ></esk-number>`;
  return html`<details>
    <summary>${msg("Points as numbers")}</summary>
    <div class="points">
      ${points.map(
        (_, i) => html`<span>${i + 1}</span>${field(i, 0)}${field(i, 1)}
          <button class="icon-btn small" aria-label=${msg(str`Remove point ${i + 1}`)} @click=${() => ruler.remove(i)}>${icon("xmark")}</button>`,
      )}
    </div>
  </details>`;
}
