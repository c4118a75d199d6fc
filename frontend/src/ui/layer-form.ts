import { css, html, nothing, type TemplateResult } from "lit";
import type { GridPlace } from "../core/lattice.ts";
import type { Layer, LayerFields } from "../generated/contract.ts";
import { icon } from "./icons.ts";
import { layerFacts } from "./layers.ts";
import "./number-field.ts";
import "./placement-form.ts";
import "./range-field.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { blurOnEnter } from "./stroke-panel.ts";
import { shared } from "./styles/shared.ts";

/** Everything about one layer: its place, how far it is believed, where it comes from. */
export class EskLayerForm extends SignalElement {
  static override properties = { stage: { attribute: false }, layer: { attribute: false } };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 12px;
        padding: 4px 2px 6px;
        font-size: 0.8125rem;
      }
      .row {
        display: flex;
        gap: 6px;
      }
      .row .btn {
        flex: 1;
        font-size: 0.8125rem;
      }
      .text {
        display: grid;
        gap: 3px;
        font-size: 0.75rem;
        color: var(--esk-quiet);
      }
      .text .field {
        height: 32px;
        font-size: 0.8125rem;
      }
      dl {
        display: grid;
        grid-template-columns: auto 1fr;
        gap: 3px 12px;
        margin: 6px 0 0;
      }
      dt {
        color: var(--esk-quiet);
      }
      dd {
        margin: 0;
        text-align: right;
        overflow-wrap: anywhere;
        font-variant-numeric: tabular-nums;
      }
      summary {
        width: max-content;
        cursor: pointer;
        color: var(--esk-quiet);
      }
      .lead {
        margin-top: -6px;
        color: var(--esk-quiet);
      }
      @media (pointer: coarse) {
        .row .btn,
        .text .field {
          height: 44px;
        }
      }
    `,
  ];

  declare stage: Stage;
  declare layer: Layer;
  #gesture: string | null = null;

  #set(fields: LayerFields, settled = true): void {
    this.#gesture ??= this.stage.session.newGesture();
    this.stage.session.submit({ type: "layer.set", layer: this.layer.id, fields }, this.#gesture);
    if (settled) this.#gesture = null;
  }

  #place({ anchor, rotation_deg, spacing_m, scale, lift_m }: GridPlace): void {
    this.#set({
      anchor: [anchor[0], anchor[1]],
      rotation_deg,
      spacing_m: [spacing_m[0], spacing_m[1]],
      scale,
      lift_m,
    });
  }

  protected override render(): TemplateResult {
    const { layer, stage } = this;
    const disabled = !stage.session.canEdit.value;
    const inHand = stage.input.laying.value?.id === layer.id;
    return html`
      <div class="row">
        <button class="btn outline" @click=${() => stage.groundwork.reveal(layer)}>${icon("frame")} Look at it</button>
        <button
          class="btn ${inHand ? "primary" : "outline"}"
          aria-pressed=${inHand}
          ?disabled=${disabled}
          @click=${() => stage.groundwork.toggleLaying(layer)}
        >
          ${icon("select")} ${inHand ? "Leave it here" : "Move it"}
        </button>
      </div>
      ${
        inHand
          ? html`<p class="lead">Drag it, its corners, or the knobs that turn and lift it. Everybody sees it move. Enter leaves it, Esc puts it back.</p>
            <esk-placement-form
              .shape=${layer.facts}
              .place=${layer}
              .sizeM=${stage.sizeM}
              ?disabled=${disabled}
              @place=${(e: CustomEvent<GridPlace>) => this.#place(e.detail)}
            ></esk-placement-form>`
          : nothing
      }
      <esk-number
        label="Accuracy: heights are right within"
        unit="m"
        .value=${layer.accuracy_m}
        min="0"
        max="100000"
        digits="3"
        ?disabled=${disabled}
        @number=${(e: CustomEvent<number>) => this.#set({ accuracy_m: e.detail })}
      ></esk-number>
      <esk-range
        label="Outline"
        unit="%"
        min="0"
        max="100"
        step="1"
        .value=${100 * layer.outline}
        ?disabled=${disabled}
        @value=${(e: CustomEvent<number>) => this.#set({ outline: share(e.detail) }, false)}
        @settle=${(e: CustomEvent<number>) => this.#set({ outline: share(e.detail) })}
      ></esk-range>
      ${this.#text("Name", "name", disabled, layer.facts.file || "Elevation grid")} ${this.#text("Source", "source", disabled, "Who measured it, when")}
      ${this.#text("Licence", "licence", disabled, "How it may be used")}
      <details>
        <summary>What it is</summary>
        <dl>${layerFacts(layer).map(([what, how]) => html`<dt>${what}</dt><dd>${how}</dd>`)}</dl>
      </details>
      ${layer.author ? html`<p class="quiet">Brought in by ${layer.author}</p>` : nothing}
    `;
  }

  #text(label: string, field: "name" | "source" | "licence", disabled: boolean, placeholder: string): TemplateResult {
    return html`<label class="text">
      ${label}
      <input
        class="field"
        maxlength=${field === "name" ? 80 : 240}
        placeholder=${placeholder}
        .value=${this.layer[field]}
        ?disabled=${disabled}
        @change=${(e: Event) => this.#set({ [field]: (e.target as HTMLInputElement).value.trim() })}
        @keydown=${blurOnEnter}
      />
    </label>`;
  }
}

const share = (percent: number): number => Math.round(Math.min(100, Math.max(0, percent))) / 100;

customElements.define("esk-layer-form", EskLayerForm);
