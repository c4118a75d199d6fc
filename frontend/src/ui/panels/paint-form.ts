import { msg } from "@lit/localize";
import { css, html, LitElement, type TemplateResult } from "lit";
import { paintWords, SUBSTANCES } from "../../app/words/paints.ts";
import type { Paint, PaintChannel } from "../../generated/contract.ts";
import { PAINT_CHANNELS, radiusRange } from "../../input/tools/painttool.ts";
import "../controls/range-field.ts";
import "../controls/segmented.ts";
import { shared } from "../styles/shared.ts";

/** The event `change` carries the whole paint, and whether the gesture is over. */
export interface PaintChange {
  readonly paint: Paint;
  readonly settled: boolean;
}

const WAYS = [
  { value: "add", label: msg("Add"), title: msg("More of it (Shift+U)") },
  { value: "remove", label: msg("Remove"), title: msg("Less of it (Shift+U)") },
];

/** The paint of a brush: channel, more or less of it, how strongly, how wide. Fires `change`. */
export class EskPaintForm extends LitElement {
  static override properties = {
    paint: { attribute: false },
    sizeM: { type: Number },
    disabled: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 12px;
      }
      .channels {
        display: grid;
        grid-template-columns: repeat(2, minmax(0, 1fr));
        gap: 4px;
      }
      .channel {
        display: flex;
        align-items: center;
        gap: 7px;
        min-height: 36px;
        padding: 0 8px;
        border: 1px solid var(--esk-line);
        border-radius: 8px;
        background: transparent;
        color: var(--esk-text);
        font: 500 0.8125rem/1.1 var(--wa-font-family-body);
        text-align: left;
        cursor: pointer;
      }
      .channel:hover:not(:disabled) {
        background: var(--esk-hover);
      }
      .channel[aria-checked="true"] {
        border-color: var(--esk-accent);
        box-shadow: inset 0 0 0 1px var(--esk-accent);
        background: var(--esk-chosen);
      }
      @media (pointer: coarse) {
        .channel {
          min-height: 40px;
        }
      }
      .channel:disabled {
        cursor: default;
        opacity: 0.55;
      }
      .dot {
        flex: none;
        width: 11px;
        height: 11px;
        border: 1px solid rgb(0 0 0 / 25%);
        border-radius: 50%;
      }
      p {
        color: var(--esk-quiet);
        font-size: 0.8125rem;
      }
    `,
  ];

  declare paint: Paint;
  declare sizeM: number;
  declare disabled: boolean;

  constructor() {
    super();
    this.paint = { channel: "snow", value: 0.8, radius_m: 100 };
    this.sizeM = 4096;
    this.disabled = false;
  }

  #emit(fields: Partial<Paint>, settled: boolean): void {
    this.paint = { ...this.paint, ...fields };
    this.dispatchEvent(new CustomEvent<PaintChange>("change", { detail: { paint: this.paint, settled } }));
  }

  #key(event: KeyboardEvent): void {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const at = PAINT_CHANNELS.indexOf(this.paint.channel);
    this.#emit({ channel: PAINT_CHANNELS[(at + step + PAINT_CHANNELS.length) % PAINT_CHANNELS.length]! }, true);
    void this.updateComplete.then(() => this.renderRoot.querySelector<HTMLElement>('[aria-checked="true"]')?.focus());
  }

  protected override render(): TemplateResult {
    const { value } = this.paint;
    const [least, most] = radiusRange(this.sizeM);
    const size = (e: CustomEvent<number>, settled: boolean): void => this.#emit({ radius_m: e.detail }, settled);
    return html`
      <div class="channels" role="radiogroup" aria-label=${msg("Paint")} @keydown=${this.#key}>
        ${PAINT_CHANNELS.map((channel) => this.#channel(channel))}
      </div>
      <esk-segmented
        label=${msg("Add or remove")}
        .segments=${WAYS}
        .value=${value < 0 ? "remove" : "add"}
        ?disabled=${this.disabled}
        @pick=${() => this.#emit({ value: -value }, true)}
      ></esk-segmented>
      <p>${paintWords(this.paint)}</p>
      <esk-range
        label=${msg("Strength")}
        of=${msg("of the paint")}
        unit="%"
        min="5"
        max="100"
        step="1"
        .value=${Math.round(100 * Math.abs(value))}
        ?disabled=${this.disabled}
        @value=${(e: CustomEvent<number>) => this.#strength(e.detail, false)}
        @settle=${(e: CustomEvent<number>) => this.#strength(e.detail, true)}
      ></esk-range>
      <esk-range
        label=${msg("Radius")}
        of=${msg("of the brush")}
        unit="m"
        log
        min=${least}
        max=${most}
        .value=${this.paint.radius_m}
        ?disabled=${this.disabled}
        @value=${(e: CustomEvent<number>) => size(e, false)}
        @settle=${(e: CustomEvent<number>) => size(e, true)}
      ></esk-range>
    `;
  }

  #strength(percent: number, settled: boolean): void {
    const size = Math.min(1, Math.max(0.05, percent / 100));
    this.#emit({ value: this.paint.value < 0 ? -size : size }, settled);
  }

  #channel(channel: PaintChannel): TemplateResult {
    const on = this.paint.channel === channel;
    const { title, colour } = SUBSTANCES[channel];
    return html`<button
      class="channel"
      role="radio"
      aria-checked=${on}
      tabindex=${on ? 0 : -1}
      ?disabled=${this.disabled}
      @click=${() => this.#emit({ channel }, true)}
    >
      <span class="dot" style=${`background:${colour}`}></span>${title}
    </button>`;
  }
}

customElements.define("esk-paint-form", EskPaintForm);
