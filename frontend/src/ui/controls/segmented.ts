import { css, html, LitElement, type TemplateResult } from "lit";
import { shared } from "../styles/shared.ts";
import { icon } from "./icons.ts";

export interface Segment {
  readonly value: string;
  readonly label: string;
  readonly icon?: string;
  /** Shown as a tooltip, for example with the key. */
  readonly title?: string;
}

/** A row of mutually exclusive choices: a radio group with arrow keys. Fires `pick` with the value. */
export class EskSegmented extends LitElement {
  static override properties = {
    label: { type: String },
    value: { type: String },
    segments: { attribute: false },
    compact: { type: Boolean },
    disabled: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: block;
      }
      div {
        display: flex;
        flex-wrap: var(--segments-wrap, nowrap);
        gap: var(--segment-gap, 2px);
        padding: 2px;
        border-radius: 10px;
        background: var(--esk-hover);
      }
      button {
        appearance: none;
        flex: 1 1 var(--segment-basis, 0%);
        display: inline-flex;
        align-items: center;
        justify-content: center;
        gap: 6px;
        min-height: 30px;
        padding: 0 var(--segment-pad, 7px);
        border: 0;
        border-radius: 8px;
        background: transparent;
        color: var(--esk-quiet);
        font: 500 var(--segment-size, 0.8125rem) / 1 var(--wa-font-family-body);
        white-space: nowrap;
        cursor: pointer;
      }
      button:hover:not(:disabled) {
        color: var(--esk-text);
      }
      button[aria-checked="true"] {
        background: var(--esk-chosen);
        color: var(--esk-text);
        box-shadow: 0 1px 2px rgb(0 0 0 / 16%);
      }
      @media (max-width: 460px) {
        :host([compact]) button {
          padding: 0 7px;
        }
      }
      @media (pointer: coarse) {
        button {
          min-width: 40px;
          min-height: 40px;
        }
      }
      button:disabled {
        cursor: default;
        opacity: 0.5;
      }
    `,
  ];

  declare label: string;
  declare value: string;
  declare segments: readonly Segment[];
  /** Icons only, where a segment has one. */
  declare compact: boolean;
  declare disabled: boolean;

  constructor() {
    super();
    this.label = "";
    this.value = "";
    this.segments = [];
    this.compact = false;
    this.disabled = false;
  }

  #pick(value: string): void {
    if (value !== this.value) this.dispatchEvent(new CustomEvent("pick", { detail: value }));
  }

  #key(event: KeyboardEvent): void {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const at = this.segments.findIndex((s) => s.value === this.value);
    const next = this.segments[(at + step + this.segments.length) % this.segments.length];
    if (!next) return;
    this.#pick(next.value);
    void this.updateComplete.then(() => this.renderRoot.querySelector<HTMLElement>('[aria-checked="true"]')?.focus());
  }

  protected override render(): TemplateResult {
    const none = !this.segments.some((s) => s.value === this.value);
    return html`
      <div role="radiogroup" aria-label=${this.label} @keydown=${this.#key}>
        ${this.segments.map(
          (s, i) => html`
            <button
              role="radio"
              aria-checked=${s.value === this.value}
              aria-label=${s.label}
              title=${s.title ?? (this.compact ? s.label : "")}
              tabindex=${s.value === this.value || (none && i === 0) ? 0 : -1}
              ?disabled=${this.disabled}
              @click=${() => this.#pick(s.value)}
            >
              ${s.icon ? icon(s.icon) : null} ${this.compact && s.icon ? null : s.label}
            </button>
          `,
        )}
      </div>
    `;
  }
}

customElements.define("esk-segmented", EskSegmented);
