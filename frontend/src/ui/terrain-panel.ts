import "@awesome.me/webawesome/dist/components/switch/switch.js";
import { html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import type { Border, Look, TerrainFields, TerrainSettings } from "../generated/contract.ts";
import { DEFAULT_REACH_FRACTION } from "../generated/contract.ts";
import "./range-field.ts";
import "./segmented.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { panelStyles } from "./styles/panel.ts";
import { shared } from "./styles/shared.ts";
import "./sun-pad.ts";
import { type SunPosition, sunWords } from "./sun.ts";

const LOOKS = [
  { value: "natural", label: "Natural" },
  { value: "alpine", label: "Alpine" },
  { value: "desert", label: "Desert" },
  { value: "paper", label: "Paper" },
];

const BORDERS = [
  { value: "free", label: "Free", title: "The land runs on past the border" },
  { value: "pinned", label: "Pinned", title: "The border stays at the base height" },
];

const BORDER_WORDS: Readonly<Record<Border, string>> = {
  free: "The ground may rise and fall at the border of the terrain.",
  pinned: "The ground at the border of the terrain stays at height zero.",
};

/** Settings of the whole terrain: look, sun, sea, and how far strokes reach. */
export class EskTerrainPanel extends SignalElement {
  static override properties = { stage: { attribute: false } };
  static override styles = [shared, panelStyles];

  declare stage: Stage;
  #gesture: string | null = null;

  #set(fields: TerrainFields, settled = true): void {
    this.#gesture ??= this.stage.session.newGesture();
    this.stage.session.setTerrain(fields, this.#gesture);
    if (settled) this.#gesture = null;
  }

  protected override render(): TemplateResult | typeof nothing {
    const settings = this.stage.session.doc.doc.value?.settings;
    if (!settings) return nothing;
    const disabled = !this.stage.session.canEdit.value;
    return html`
      <div class="group">
        <h3>Look</h3>
        <esk-segmented
          label="Look"
          .segments=${LOOKS}
          .value=${settings.look}
          ?disabled=${disabled}
          @pick=${(e: CustomEvent<Look>) => this.#set({ look: e.detail })}
        ></esk-segmented>
      </div>
      ${this.#sun(settings, disabled)} ${this.#sea(settings, disabled)} ${this.#reach(settings, disabled)}
      <div class="group">
        <h3>Border</h3>
        <esk-segmented
          label="Border"
          .segments=${BORDERS}
          .value=${settings.border}
          ?disabled=${disabled}
          @pick=${(e: CustomEvent<Border>) => this.#set({ border: e.detail })}
        ></esk-segmented>
        <p class="lead">${BORDER_WORDS[settings.border]}</p>
      </div>
    `;
  }

  #sun(settings: TerrainSettings, disabled: boolean): TemplateResult {
    const { sun_azimuth_deg: azimuth, sun_elevation_deg: elevation } = settings;
    const move = (e: CustomEvent<SunPosition>, settled: boolean): void =>
      this.#set({ sun_azimuth_deg: e.detail.azimuthDeg, sun_elevation_deg: e.detail.elevationDeg }, settled);
    return html`
      <div class="group">
        <h3>Sun</h3>
        <esk-sun-pad
          .azimuthDeg=${azimuth}
          .elevationDeg=${elevation}
          ?disabled=${disabled}
          @sun=${(e: CustomEvent<SunPosition>) => move(e, false)}
          @settle=${(e: CustomEvent<SunPosition>) => move(e, true)}
        ></esk-sun-pad>
        <p class="lead">${sunWords({ azimuthDeg: azimuth, elevationDeg: elevation })}</p>
      </div>
    `;
  }

  #sea(settings: TerrainSettings, disabled: boolean): TemplateResult {
    const level = settings.sea_level_m;
    const span = settings.size_m / 8;
    return html`
      <div class="group">
        <wa-switch
          size="s"
          .checked=${live(level !== null)}
          ?disabled=${disabled}
          @change=${(e: Event) => this.#set({ sea_level_m: (e.target as HTMLInputElement).checked ? 0 : null })}
          >Sea</wa-switch
        >
        ${
          level === null
            ? nothing
            : html`<esk-range
                label="Sea level"
                unit="m"
                min=${-span}
                max=${span}
                step=${settings.size_m / 4096}
                .value=${level}
                ?disabled=${disabled}
                @value=${(e: CustomEvent<number>) => this.#set({ sea_level_m: e.detail }, false)}
                @settle=${(e: CustomEvent<number>) => this.#set({ sea_level_m: e.detail })}
              ></esk-range>`
        }
      </div>
    `;
  }

  #reach(settings: TerrainSettings, disabled: boolean): TemplateResult {
    const { reach_m: reach, size_m: size } = settings;
    return html`
      <div class="group">
        <h3>Reach</h3>
        <wa-switch
          size="s"
          .checked=${live(reach === null)}
          ?disabled=${disabled}
          @change=${(e: Event) =>
            this.#set({ reach_m: (e.target as HTMLInputElement).checked ? null : size * DEFAULT_REACH_FRACTION })}
          >Unlimited</wa-switch
        >
        ${
          reach === null
            ? html`<p class="lead">Every stroke moves the whole terrain, as on a rubber sheet.</p>`
            : html`<esk-range
                label="Distance"
                unit="m"
                log
                min=${size / 256}
                max=${size}
                .value=${reach}
                ?disabled=${disabled}
                @value=${(e: CustomEvent<number>) => this.#set({ reach_m: e.detail }, false)}
                @settle=${(e: CustomEvent<number>) => this.#set({ reach_m: e.detail })}
              ></esk-range>
              <p class="lead">Beyond its flanks a stroke moves the ground about this far.</p>`
        }
      </div>
    `;
  }
}

customElements.define("esk-terrain-panel", EskTerrainPanel);
