import { css, html, LitElement, type TemplateResult } from "lit";
import { shared } from "../styles/shared.ts";

/** A labelled number with its unit. Fires `number` with a finite value within its bounds when it has been typed. */
export class EskNumber extends LitElement {
  static override properties = {
    label: { type: String },
    unit: { type: String },
    value: { type: Number },
    min: { type: Number },
    max: { type: Number },
    digits: { type: Number },
    disabled: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: block;
        min-width: 0;
      }
      label {
        display: grid;
        gap: 3px;
        font-size: 0.75rem;
        color: var(--esk-quiet);
      }
      span {
        display: flex;
        align-items: center;
        gap: 4px;
      }
      .field {
        width: 100%;
        height: 32px;
        padding: 0 8px;
        border-radius: 8px;
        font-size: 0.8125rem;
        font-variant-numeric: tabular-nums;
        appearance: textfield;
      }
      .field::-webkit-inner-spin-button {
        appearance: none;
      }
      .unit {
        flex: none;
        min-width: 12px;
      }
      @media (pointer: coarse) {
        .field {
          height: 44px;
          font-size: 1rem;
        }
      }
    `,
  ];

  declare label: string;
  declare unit: string;
  declare value: number;
  declare min: number;
  declare max: number;
  /** Digits behind the point. */
  declare digits: number;
  declare disabled: boolean;

  constructor() {
    super();
    this.label = "";
    this.unit = "";
    this.value = 0;
    this.min = Number.NEGATIVE_INFINITY;
    this.max = Number.POSITIVE_INFINITY;
    this.digits = 1;
    this.disabled = false;
  }

  #typed(event: Event): void {
    event.stopPropagation();
    const typed = (event.target as HTMLInputElement).valueAsNumber;
    if (Number.isFinite(typed)) {
      this.value = Math.min(Math.max(typed, this.min), this.max);
      this.dispatchEvent(new CustomEvent("number", { detail: this.value }));
    }
    this.requestUpdate();
  }

  #key(event: KeyboardEvent): void {
    event.stopPropagation();
    if (event.key === "Enter" || event.key === "Escape") (event.target as HTMLElement).blur();
  }

  protected override render(): TemplateResult {
    return html`<label>
      ${this.label}
      <span>
        <input
          class="field"
          type="number"
          step="any"
          inputmode="decimal"
          .value=${String(Number(this.value.toFixed(this.digits)))}
          ?disabled=${this.disabled}
          @change=${this.#typed}
          @keydown=${this.#key}
        />
        <span class="unit">${this.unit}</span>
      </span>
    </label>`;
  }
}

customElements.define("esk-number", EskNumber);
