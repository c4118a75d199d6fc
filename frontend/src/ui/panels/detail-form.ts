import { msg } from "@lit/localize";
import { css, html, LitElement, type TemplateResult } from "lit";
import type { Stroke } from "../../generated/contract.ts";
import "../controls/range-field.ts";
import { shared } from "../styles/shared.ts";

export type DetailFields = Pick<Stroke, "amplitude_m" | "roughness">;

/** The event `change` carries the new fields, and whether the gesture is over. */
export interface DetailChange {
  readonly fields: Partial<DetailFields>;
  readonly settled: boolean;
}

/** How rough the ground near a stroke is: noise amplitude and roughness. Fires `change`. */
export class EskDetailForm extends LitElement {
  static override properties = {
    fields: { attribute: false },
    sizeM: { type: Number },
    disabled: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 10px;
        padding-top: 10px;
        border-top: 1px solid var(--esk-line);
      }
      h3 {
        font-size: 0.8125rem;
        font-weight: 620;
      }
      p {
        color: var(--esk-quiet);
        font-size: 0.8125rem;
      }
    `,
  ];

  declare fields: DetailFields;
  declare sizeM: number;
  declare disabled: boolean;

  constructor() {
    super();
    this.fields = { amplitude_m: 0, roughness: 0.5 };
    this.sizeM = 4096;
    this.disabled = false;
  }

  #emit(fields: Partial<DetailFields>, settled: boolean): void {
    this.fields = { ...this.fields, ...fields };
    this.dispatchEvent(new CustomEvent<DetailChange>("change", { detail: { fields, settled } }));
  }

  protected override render(): TemplateResult {
    const { amplitude_m: amplitude, roughness } = this.fields;
    const share = (percent: number): number => Math.min(1, Math.max(0, percent / 100));
    return html`
      <h3>${msg("Detail")}</h3>
      <p>${msg("How broken the ground is around this stroke.")}</p>
      <esk-range
        label=${msg("Amplitude")}
        unit="m"
        min="0"
        max=${this.sizeM / 64}
        step=${this.sizeM / 8192}
        .value=${amplitude}
        ?disabled=${this.disabled}
        @value=${(e: CustomEvent<number>) => this.#emit({ amplitude_m: e.detail }, false)}
        @settle=${(e: CustomEvent<number>) => this.#emit({ amplitude_m: e.detail }, true)}
      ></esk-range>
      <esk-range
        label=${msg("Roughness")}
        unit="%"
        min="0"
        max="100"
        step="1"
        .value=${100 * roughness}
        ?disabled=${this.disabled}
        @value=${(e: CustomEvent<number>) => this.#emit({ roughness: share(e.detail) }, false)}
        @settle=${(e: CustomEvent<number>) => this.#emit({ roughness: share(e.detail) }, true)}
      ></esk-range>
    `;
  }
}

customElements.define("esk-detail-form", EskDetailForm);
