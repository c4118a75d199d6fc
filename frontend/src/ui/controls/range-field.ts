import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/slider/slider.js";
import type WaSlider from "@awesome.me/webawesome/dist/components/slider/slider.js";
import { css, html, LitElement, type TemplateResult } from "lit";
import { shared } from "../styles/shared.ts";

const STEPS = 400;

/** A labelled slider with a number beside it. Fires `value` while it moves and `settle` when it rests. */
export class EskRange extends LitElement {
  static override properties = {
    label: { type: String },
    of: { type: String },
    unit: { type: String },
    value: { type: Number },
    min: { type: Number },
    max: { type: Number },
    step: { type: Number },
    log: { type: Boolean },
    disabled: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: block;
        position: relative;
      }
      wa-slider {
        --track-size: 4px;
        --thumb-width: 16px;
        --thumb-height: 16px;
      }
      wa-slider::part(label) {
        font-size: 0.8125rem;
        font-weight: 500;
        margin-bottom: 2px;
        line-height: 24px;
      }
      .number {
        position: absolute;
        top: 0;
        right: 0;
        display: flex;
        align-items: center;
        gap: 3px;
        color: var(--esk-quiet);
        font-size: 0.8125rem;
      }
      input {
        width: 58px;
        height: 24px;
        padding: 0 4px;
        text-align: right;
        border: 1px solid transparent;
        border-radius: 6px;
        background: transparent;
        color: var(--esk-text);
        font: inherit;
        font-variant-numeric: tabular-nums;
        appearance: textfield;
      }
      input::-webkit-inner-spin-button {
        appearance: none;
      }
      input:hover:not(:disabled),
      input:focus {
        border-color: var(--esk-line-strong);
        background: var(--esk-field);
      }
      .unit {
        min-width: 12px;
      }
      @media (pointer: coarse) {
        wa-slider {
          --thumb-width: 24px;
          --thumb-height: 24px;
        }
        wa-slider::part(slider) {
          padding-block: 8px;
        }
        input {
          height: 32px;
        }
      }
    `,
  ];

  declare label: string;
  /**
   * The end of the name that the label leaves to the heading above it: "of the left flank". It is part of the name, not
   * shown.
   */
  declare of: string;
  declare unit: string;
  declare value: number;
  declare min: number;
  declare max: number;
  declare step: number;
  /** Spreads the values logarithmically: lengths from metres to kilometres. Needs min > 0. */
  declare log: boolean;
  declare disabled: boolean;

  constructor() {
    super();
    this.label = "";
    this.of = "";
    this.unit = "";
    this.value = 0;
    this.min = 0;
    this.max = 1;
    this.step = 1;
    this.log = false;
    this.disabled = false;
  }

  #position(): number {
    const v = Math.min(Math.max(this.value, this.min), this.max);
    return this.log ? Math.round((STEPS * Math.log(v / this.min)) / Math.log(this.max / this.min)) : v;
  }

  #valueAt(position: number): number {
    if (!this.log) return position;
    return Number((this.min * (this.max / this.min) ** (position / STEPS)).toPrecision(3));
  }

  #move(value: number, settled: boolean): void {
    this.value = Math.min(Math.max(value, this.min), this.max);
    this.dispatchEvent(new CustomEvent("value", { detail: this.value }));
    if (settled) this.dispatchEvent(new CustomEvent("settle", { detail: this.value }));
  }

  #slid(event: Event, settled: boolean): void {
    event.stopPropagation();
    const value = this.#valueAt((event.target as WaSlider).value);
    if (settled) this.dispatchEvent(new CustomEvent("settle", { detail: this.value }));
    else this.#move(value, false);
  }

  #typed(event: Event): void {
    event.stopPropagation();
    const value = (event.target as HTMLInputElement).valueAsNumber;
    if (Number.isFinite(value)) this.#move(value, true);
    this.requestUpdate();
  }

  protected override render(): TemplateResult {
    const shown = Math.abs(this.value) < 10 && this.step < 1 ? this.value.toFixed(1) : String(Math.round(this.value));
    return html`
      <wa-slider
        size="s"
        min=${this.log ? 0 : this.min}
        max=${this.log ? STEPS : this.max}
        step=${this.log ? 1 : this.step}
        .value=${this.#position()}
        .valueFormatter=${(p: number) => `${Math.round(this.#valueAt(p))} ${this.unit}`}
        ?disabled=${this.disabled}
        @input=${(e: Event) => this.#slid(e, false)}
        @change=${(e: Event) => this.#slid(e, true)}
        ><span slot="label">${this.label}${this.of ? html`<span class="visually-hidden"> ${this.of}</span>` : null}</span></wa-slider
      >
      <span class="number">
        <input
          type="number"
          aria-label=${msg(str`${this.of ? `${this.label} ${this.of}` : this.label}, in ${UNITS[this.unit] ?? this.unit}`)}
          min=${this.min}
          max=${this.max}
          step="any"
          .value=${shown}
          ?disabled=${this.disabled}
          @change=${this.#typed}
          @keydown=${(e: Event) => e.stopPropagation()}
        />
        <span class="unit" aria-hidden="true">${this.unit}</span>
      </span>
    `;
  }
}

const UNITS: Record<string, string> = { m: msg("metres"), "°": msg("degrees"), "%": msg("per cent") };

customElements.define("esk-range", EskRange);
