import { msg } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, type TemplateResult } from "lit";
import type { ViewChoices } from "../../app/device/view-choices.ts";
import type { RendererInfo } from "../../app/view/graphics.ts";
import { contourSteps } from "../../app/view/instruments/contour-steps.ts";
import { MOST_EXAGGERATION } from "../../core/camera/lens.ts";
import { icon } from "../controls/icons.ts";
import { languageChoice } from "../controls/language-choice.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** How this device shows terrains: heights, contours, large letters. A button, and a card over it. */
export class EskViewOptions extends SignalElement {
  static override properties = {
    choices: { attribute: false },
    renderer: { attribute: false },
    open: { type: Boolean, state: true },
  };
  static override styles = [
    shared,
    css`
      :host {
        position: relative;
        display: block;
      }
      .card {
        position: absolute;
        right: 0;
        bottom: calc(100% + 12px);
        z-index: 3;
        display: grid;
        gap: 14px;
        width: min(264px, calc(100vw - 24px));
        padding: 14px 16px 16px;
        font-size: 0.8125rem;
      }
      label {
        display: grid;
        gap: 5px;
      }
      label span {
        display: flex;
        justify-content: space-between;
        font-weight: 550;
      }
      output {
        color: var(--esk-quiet);
        font-weight: 450;
        font-variant-numeric: tabular-nums;
      }
      input[type="range"] {
        width: 100%;
        margin: 0;
        accent-color: var(--esk-accent);
      }
      .field {
        height: 34px;
        padding: 0 8px;
        border-radius: 8px;
      }
      fieldset {
        display: grid;
        gap: 8px;
        margin: 0;
        padding: 0;
        border: 0;
      }
      legend {
        padding: 0 0 6px;
        font-weight: 550;
      }
      small {
        color: var(--esk-quiet);
      }
      @media (pointer: coarse) {
        .field,
        input[type="range"] {
          height: 44px;
        }
      }
    `,
  ];

  declare choices: ViewChoices;
  declare renderer: ReadonlySignal<RendererInfo | null>;
  declare open: boolean;
  readonly #away = (e: Event): void => {
    if (this.open && !e.composedPath().includes(this)) this.open = false;
  };

  constructor() {
    super();
    this.open = false;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    window.addEventListener("pointerdown", this.#away, true);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    window.removeEventListener("pointerdown", this.#away, true);
  }

  #key(e: KeyboardEvent): void {
    if (e.key !== "Escape") return;
    e.stopPropagation();
    this.open = false;
    this.renderRoot.querySelector<HTMLElement>("button")?.focus();
  }

  protected override render(): TemplateResult {
    const { exaggeration, contourM, projector, materials, shade, instances, quietLines } = this.choices.choices.value;
    const surface = materials !== null || !shade || instances !== null || !quietLines;
    const changed = exaggeration !== 1 || contourM !== 0 || projector || surface;
    return html`<button
        class="icon-btn small"
        aria-label=${msg("View on this device")}
        title=${msg("View on this device: heights, contours, ground, lines, projector")}
        aria-expanded=${this.open}
        aria-pressed=${changed}
        @click=${() => {
          this.open = !this.open;
        }}
      >
        ${icon("eye")}
      </button>
      ${this.open ? this.#card() : null}`;
  }

  #switch(label: string, on: boolean, choose: (on: boolean) => void): TemplateResult {
    return html`<wa-switch size="s" ?checked=${on} @change=${(e: Event) => choose((e.target as HTMLInputElement).checked)}
      >${label}</wa-switch
    >`;
  }

  /** What of the ground is drawn. What nobody chose is on where the adapter draws it easily. */
  #ground(): TemplateResult {
    const { choices } = this;
    const { materials, shade, instances } = choices.choices.value;
    const able = this.renderer.value?.software !== true;
    return html`<fieldset>
      <legend>${msg("Ground")}</legend>
      ${this.#switch(msg("Stones and blades close by"), materials ?? able, (on) => choices.choose({ materials: on }))}
      ${this.#switch(msg("Shade in hollows and joints"), shade, (on) => choices.choose({ shade: on }))}
      ${this.#switch(msg("Trees, rocks and tufts"), instances ?? able, (on) => choices.choose({ instances: on }))}
      ${able ? null : html`<small>${msg("This device draws without a graphics card: what costs much is off.")}</small>`}
    </fieldset>`;
  }

  #card(): TemplateResult {
    const { choices } = this;
    const { exaggeration, contourM, projector, quietLines } = choices.choices.value;
    return html`<div class="card panel" role="dialog" aria-label=${msg("View on this device")} @keydown=${this.#key}>
      <label>
        <span>${msg("Heights drawn")} <output>× ${exaggeration}</output></span>
        <input
          type="range"
          min="1"
          max=${MOST_EXAGGERATION}
          step="0.5"
          .value=${String(exaggeration)}
          @input=${(e: Event) => choices.choose({ exaggeration: (e.target as HTMLInputElement).valueAsNumber })}
        />
      </label>
      <label>
        <span>${msg("Contours")}</span>
        <select class="field" @change=${(e: Event) => choices.choose({ contourM: Number((e.target as HTMLSelectElement).value) })}>
          ${contourSteps().map((s) => html`<option value=${s.value} ?selected=${s.value === contourM}>${s.label}</option>`)}
        </select>
      </label>
      ${this.renderer.value?.kind === "map" ? null : this.#ground()}
      ${this.#switch(msg("Quiet lines: faint until you draw or point"), quietLines, (on) => choices.choose({ quietLines: on }))}
      <wa-switch size="s" ?checked=${projector} @change=${(e: Event) => choices.choose({ projector: (e.target as HTMLInputElement).checked })}
        >${msg("For a projector: large letters, thick lines")}</wa-switch
      >
      <label>
        <span>${msg("Language")}</span>
        ${languageChoice()}
      </label>
      <small>${msg("For this device only: others see the land as they choose.")}</small>
    </div>`;
  }
}

customElements.define("esk-view-options", EskViewOptions);
