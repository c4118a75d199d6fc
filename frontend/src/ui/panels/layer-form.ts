import { msg, str } from "@lit/localize";
import { css, html, nothing, type TemplateResult } from "lit";
import { layerFacts } from "../../app/layers/layers.ts";
import type { GridPlace } from "../../core/lattice.ts";
import type { Layer, LayerFields } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import "../controls/number-field.ts";
import "./placement-form.ts";
import "../controls/range-field.ts";
import type { ReadonlySignal } from "@preact/signals-core";
import type { Groundwork } from "../../app/layers/groundwork.ts";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import type { Placing } from "../../input/tools/placement.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { factsStyles } from "../styles/facts.ts";
import { shared } from "../styles/shared.ts";
import { blurOnEnter } from "./stroke-panel.ts";

/** Everything about one layer: its place, how far it is believed, where it comes from. */
export class EskLayerForm extends SignalElement {
  static override properties = {
    groundwork: { attribute: false },
    placing: { attribute: false },
    sizeM: { attribute: false },
    canEdit: { attribute: false },
    edits: { attribute: false },
    layer: { attribute: false },
  };
  static override styles = [
    shared,
    factsStyles,
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

  declare groundwork: Pick<Groundwork, "reveal" | "togglePlacing">;
  /** The grid in hand. */
  declare placing: ReadonlySignal<Placing | null>;
  declare sizeM: number;
  declare canEdit: ReadonlySignal<boolean>;
  declare edits: Pick<OpenTerrain, "newGesture" | "submit">;
  declare layer: Layer;
  #gesture: string | null = null;

  #set(fields: LayerFields, settled = true): void {
    this.#gesture ??= this.edits.newGesture();
    this.edits.submit({ type: "layer.set", layer: this.layer.id, fields }, this.#gesture);
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
    const { layer, groundwork } = this;
    const disabled = !this.canEdit.value;
    const inHand = this.placing.value?.id === layer.id;
    return html`
      <div class="row">
        <button class="btn outline" @click=${() => groundwork.reveal(layer)}>${icon("frame")} ${msg("Look at it")}</button>
        <button
          class="btn ${inHand ? "primary" : "outline"}"
          aria-pressed=${inHand}
          ?disabled=${disabled}
          @click=${() => groundwork.togglePlacing(layer)}
        >
          ${icon("select")} ${inHand ? msg("Leave it here") : msg("Move it")}
        </button>
      </div>
      ${
        inHand
          ? html`<p class="lead">${msg("Drag it, its corners, or the knobs that turn and lift it. Everybody sees it move. Enter leaves it, Esc puts it back.")}</p>
            <esk-placement-form
              .shape=${layer.facts}
              .place=${layer}
              .sizeM=${this.sizeM}
              ?disabled=${disabled}
              @place=${(e: CustomEvent<GridPlace>) => this.#place(e.detail)}
            ></esk-placement-form>`
          : nothing
      }
      <esk-number
        label=${msg("Accuracy: heights are right within")}
        unit="m"
        .value=${layer.accuracy_m}
        min="0"
        max="100000"
        digits="3"
        ?disabled=${disabled}
        @number=${(e: CustomEvent<number>) => this.#set({ accuracy_m: e.detail })}
      ></esk-number>
      <esk-range
        label=${msg("Outline")}
        unit="%"
        min="0"
        max="100"
        step="1"
        .value=${100 * layer.outline}
        ?disabled=${disabled}
        @value=${(e: CustomEvent<number>) => this.#set({ outline: share(e.detail) }, false)}
        @settle=${(e: CustomEvent<number>) => this.#set({ outline: share(e.detail) })}
      ></esk-range>
      ${this.#text(msg("Name"), "name", disabled, layer.facts.file || msg("Elevation grid"))} ${this.#text(msg("Source"), "source", disabled, msg("Who measured it, when"))}
      ${this.#text(msg("Licence"), "licence", disabled, msg("How it may be used"))}
      <details>
        <summary>${msg("What it is")}</summary>
        <dl>${layerFacts(layer).map(([what, how]) => html`<dt>${what}</dt><dd>${how}</dd>`)}</dl>
      </details>
      ${layer.author ? html`<p class="quiet">${msg(str`Brought in by ${layer.author}`)}</p>` : nothing}
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
