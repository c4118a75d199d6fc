import { msg } from "@lit/localize";
import { midSentence } from "../../core/language.ts";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import { css, html, LitElement, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import { type Section, type SectionLimits, type Side, symmetric } from "../../app/view/cross-section.ts";
import { type Preset, presetsFor, type SectionFields } from "../../app/words/presets.ts";
import type { Flank } from "../../generated/contract.ts";
import { DEFAULT_EXTENT_FRACTION, DEFAULT_SLOPE_DEG, MAX_SLOPE_DEG } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import "../controls/range-field.ts";
import "./section-editor.ts";
import "../controls/segmented.ts";
import { shared } from "../styles/shared.ts";

const SHAPES = [
  { value: "concave", label: msg("Soft foot"), title: msg("Concave: the slope eases out at its foot") },
  { value: "straight", label: msg("Straight"), title: msg("One slope from crest to foot") },
  { value: "convex", label: msg("Rounded"), title: msg("Convex: gentle at the crest, steeper below") },
];

/** The event `change` carries the new fields, and whether the gesture is over. */
export interface SectionChange {
  readonly fields: Partial<SectionFields>;
  readonly settled: boolean;
}

/** The whole cross-section: picture, presets, both flanks, plateau radius. Fires `change`. */
export class EskSectionForm extends LitElement {
  static override properties = {
    fields: { attribute: false },
    reliefM: { type: Number },
    sizeM: { type: Number },
    sense: { type: String },
    disabled: { type: Boolean },
    linked: { state: true },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 14px;
      }
      .presets {
        display: grid;
        grid-template-columns: repeat(4, 1fr);
        gap: 4px;
      }
      .presets .btn {
        min-height: 30px;
        padding: 0 2px;
        border-radius: 8px;
        background: var(--esk-hover);
        font-size: 0.75rem;
      }
      .presets .btn:hover:not(:disabled) {
        background: var(--esk-press);
      }
      .head {
        display: flex;
        align-items: center;
        justify-content: space-between;
        min-height: 28px;
      }
      .head h3 {
        font-size: 0.8125rem;
        font-weight: 620;
      }
      .side {
        display: grid;
        gap: 10px;
        padding-top: 10px;
        border-top: 1px solid var(--esk-line);
      }
      wa-switch {
        font-size: 0.8125rem;
      }
    `,
  ];

  declare fields: SectionFields;
  declare reliefM: number;
  declare sizeM: number;
  declare sense: Preset["sense"];
  declare disabled: boolean;
  declare linked: boolean | null;

  constructor() {
    super();
    this.fields = { left: null, right: null, plateau_radius_m: 0 };
    this.reliefM = 1;
    this.sizeM = 4096;
    this.sense = "up";
    this.disabled = false;
    this.linked = null;
  }

  /** Linked until the two sides differ, unless somebody said otherwise. */
  get #linked(): boolean {
    return this.linked ?? symmetric(this.fields);
  }

  get #limits(): SectionLimits {
    return { maxExtentM: this.sizeM / 2, maxPlateauM: this.sizeM / 4 };
  }

  #emit(fields: Partial<SectionFields>, settled: boolean): void {
    this.fields = { ...this.fields, ...fields };
    this.dispatchEvent(new CustomEvent<SectionChange>("change", { detail: { fields, settled } }));
  }

  #flank(side: Side, change: Partial<Flank>, settled: boolean): void {
    const flank = this.fields[side];
    if (!flank) return;
    const next = { ...flank, ...change };
    this.#emit(this.#linked ? { left: next, right: { ...next } } : { [side]: next }, settled);
  }

  #toggle(side: Side, on: boolean): void {
    const fallback: Flank = {
      slope_deg: DEFAULT_SLOPE_DEG,
      extent_m: this.sizeM * DEFAULT_EXTENT_FRACTION,
      shape: "concave",
    };
    const next = on ? (this.fields[side === "left" ? "right" : "left"] ?? fallback) : null;
    this.#emit(this.#linked ? { left: next, right: next && { ...next } } : { [side]: next }, true);
  }

  #dragged(section: Section, settled: boolean): void {
    this.#emit({ left: section.left, right: section.right, plateau_radius_m: section.plateauRadiusM }, settled);
  }

  protected override render(): TemplateResult {
    const { left, right, plateau_radius_m: plateauRadiusM } = this.fields;
    const section: Section = { left, right, plateauRadiusM, reliefM: this.reliefM };
    return html`
      <esk-section
        .section=${section}
        .limits=${this.#limits}
        .linked=${this.#linked}
        ?disabled=${this.disabled}
        @section=${(e: CustomEvent<Section>) => this.#dragged(e.detail, false)}
        @settle=${(e: CustomEvent<Section>) => this.#dragged(e.detail, true)}
      ></esk-section>
      <div class="presets" role="group" aria-label=${msg("Presets")}>
        ${presetsFor(this.sense).map(
          (p) =>
            html`<button class="btn" ?disabled=${this.disabled} @click=${() => this.#preset(p)}>${p.title}</button>`,
        )}
      </div>
      <esk-range
        label=${msg("Plateau radius")}
        unit="m"
        min="0"
        max=${this.sizeM / 8}
        step=${this.sizeM / 2048}
        .value=${plateauRadiusM}
        ?disabled=${this.disabled}
        @value=${(e: CustomEvent<number>) => this.#emit({ plateau_radius_m: e.detail }, false)}
        @settle=${(e: CustomEvent<number>) => this.#emit({ plateau_radius_m: e.detail }, true)}
      ></esk-range>
      ${this.#linked ? this.#side("left", msg("Both sides")) : [this.#side("left", msg("Left side")), this.#side("right", msg("Right side"))]}
    `;
  }

  #preset(preset: Preset): void {
    this.linked = null;
    this.#emit(preset.section(this.sizeM), true);
  }

  #side(side: Side, title: string): TemplateResult {
    const flank = this.fields[side];
    return html`
      <div class="side" role="group" aria-label=${title}>
        <div class="head">
          <h3>${title}</h3>
          ${side === "left" ? this.#linkButton() : nothing}
        </div>
        <wa-switch
          size="s"
          .checked=${live(flank !== null)}
          ?disabled=${this.disabled}
          @change=${(e: Event) => this.#toggle(side, (e.target as HTMLInputElement).checked)}
          >${msg("Flank")}<span class="visually-hidden">: ${midSentence(title)}</span></wa-switch
        >
        ${flank ? this.#flankFields(side, flank) : html`<span class="quiet">${msg("The land flows freely from the crest.")}</span>`}
      </div>
    `;
  }

  #linkButton(): TemplateResult {
    const on = this.#linked;
    const label = on ? msg("Shape each side by itself") : msg("Shape both sides alike");
    return html`<button
      class="icon-btn small"
      aria-pressed=${on}
      aria-label=${label}
      title=${label}
      ?disabled=${this.disabled}
      @click=${() => this.#link(!on)}
    >
      ${icon(on ? "link" : "unlink")}
    </button>`;
  }

  #link(on: boolean): void {
    this.linked = on;
    if (on && !symmetric(this.fields)) this.#emit({ right: this.fields.left && { ...this.fields.left } }, true);
  }

  /** Returns the words that say whose slope or extent it is. */
  #of(side: Side): string {
    return this.#linked
      ? msg("of both flanks")
      : side === "left"
        ? msg("of the left flank")
        : msg("of the right flank");
  }

  #flankFields(side: Side, flank: Flank): TemplateResult {
    return html`
      <wa-switch
        size="s"
        .checked=${live(flank.slope_deg === null)}
        ?disabled=${this.disabled}
        @change=${(e: Event) => this.#flank(side, { slope_deg: (e.target as HTMLInputElement).checked ? null : DEFAULT_SLOPE_DEG }, true)}
        >${msg("Slope finds itself")}<span class="visually-hidden"> ${this.#of(side)}</span></wa-switch
      >
      ${
        flank.slope_deg === null
          ? nothing
          : html`<esk-range
              label=${msg("Slope")}
              .of=${this.#of(side)}
              unit="°"
              min="0"
              max=${MAX_SLOPE_DEG}
              step="1"
              .value=${flank.slope_deg}
              ?disabled=${this.disabled}
              @value=${(e: CustomEvent<number>) => this.#flank(side, { slope_deg: e.detail }, false)}
              @settle=${(e: CustomEvent<number>) => this.#flank(side, { slope_deg: e.detail }, true)}
            ></esk-range>`
      }
      <esk-range
        label=${msg("Extent")}
        .of=${this.#of(side)}
        unit="m"
        log
        min=${this.sizeM / 512}
        max=${this.sizeM / 2}
        .value=${flank.extent_m}
        ?disabled=${this.disabled}
        @value=${(e: CustomEvent<number>) => this.#flank(side, { extent_m: e.detail }, false)}
        @settle=${(e: CustomEvent<number>) => this.#flank(side, { extent_m: e.detail }, true)}
      ></esk-range>
      <esk-segmented
        label=${msg("Shape of the flank")}
        .segments=${SHAPES}
        .value=${flank.shape}
        ?disabled=${this.disabled}
        @pick=${(e: CustomEvent<Flank["shape"]>) => this.#flank(side, { shape: e.detail }, true)}
      ></esk-segmented>
    `;
  }
}

customElements.define("esk-section-form", EskSectionForm);
