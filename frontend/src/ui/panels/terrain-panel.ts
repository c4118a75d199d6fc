import { msg } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import { html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import type { Border, Look, Rule, TerrainFields, TerrainSettings } from "../../generated/contract.ts";
import {
  DEFAULT_LAKES_FRACTION,
  DEFAULT_REACH_FRACTION,
  DEFAULT_RIVERS,
  MAX_DETAIL,
  MAX_EROSION,
  MAX_EROSION_SCALE,
  MAX_RIVERS,
  MAX_WETNESS,
  MIN_EROSION_SCALE,
  MIN_WETNESS,
} from "../../generated/contract.ts";
import "../controls/range-field.ts";
import "../controls/segmented.ts";
import type { ReadonlySignal } from "@preact/signals-core";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import { seaSpan, seaStart } from "../../app/view/sea.ts";
import type { Doc } from "../../doc/document.ts";
import type { TileStore } from "../../tiles/store.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { panelStyles } from "../styles/panel.ts";
import { shared } from "../styles/shared.ts";
import "../controls/sun-pad.ts";
import { type SunPosition, sunWords } from "../../app/view/sun.ts";

/** The heights before the first tile. */
const NO_HEIGHTS = new Float32Array(0);

const LOOKS = [
  { value: "natural", label: msg("Natural") },
  { value: "alpine", label: msg("Alpine") },
  { value: "desert", label: msg("Desert") },
  { value: "paper", label: msg("Paper") },
];

const BORDERS = [
  { value: "free", label: msg("Free"), title: msg("The land runs on past the border") },
  { value: "pinned", label: msg("Pinned"), title: msg("The border stays at the base height") },
];

const BORDER_WORDS: Readonly<Record<Border, string>> = {
  free: msg("The ground may rise and fall at the border of the terrain."),
  pinned: msg("The ground at the border of the terrain stays at height zero."),
};

const RULES = [
  {
    value: "landscape",
    label: msg("Landscape"),
    title: msg("Crags and meadows that know slope and height, down to a centimetre"),
  },
  { value: "smooth", label: msg("Smooth"), title: msg("Soft ground without noise") },
  { value: "plain", label: msg("Plain"), title: msg("The strokes' own ground, nothing added") },
];

const RULE_WORDS: Readonly<Record<Rule, string>> = {
  landscape: msg("Rough on steep faces, calm in valleys, on down to a centimetre."),
  smooth: msg("No noise; ground between the solved samples is a soft curve."),
  plain: msg("What the strokes make, and nothing else."),
};

/** Returns in words how a strength of the detail looks. */
export function detailWords(detail: number): string {
  if (detail === 0) return msg("None: only strokes with an amplitude of their own are broken.");
  if (detail < 0.7) return msg("Gentle: old, worn hills.");
  if (detail <= 1.4) return msg("Natural.");
  if (detail <= 2.5) return msg("Rugged: broken rock, steep gullies.");
  return msg("Wild: the ground bristles.");
}

/** What a strength of the erosion looks like. */
export function erosionWords(erosion: number): string {
  if (erosion === 0) return msg("None: flanks are as smooth as they are drawn, but for what is painted.");
  if (erosion < 0.6) return msg("Young: shallow rills on steep flanks.");
  if (erosion <= 1.3) return msg("Natural: gullies that branch and join.");
  return msg("Old: deep gullies between sharp ridges.");
}

/** What a hold of the crests does. */
export function holdWords(hold: number): string {
  if (hold >= 0.95) return msg("Drawn crests keep their height.");
  if (hold > 0.3) return msg("Drawn crests are notched a little.");
  return msg("Gullies cut through drawn crests: wilder, and less exact.");
}

const hundredth = (v: number): number => Math.round(v) / 100;
const tenth = (v: number): number => Math.round(10 * v) / 10;

/** Settings of the whole terrain: look, detail, sun, sea and lakes, and how far strokes reach. */
export class EskTerrainPanel extends SignalElement {
  static override properties = {
    doc: { attribute: false },
    canEdit: { attribute: false },
    tiles: { attribute: false },
    edits: { attribute: false },
  };
  static override styles = [shared, panelStyles];

  declare doc: ReadonlySignal<Doc | null>;
  declare canEdit: ReadonlySignal<boolean>;
  /** The coarsest tile says how high a sea can stand. */
  declare tiles: Pick<TileStore, "tile">;
  declare edits: Pick<OpenTerrain, "newGesture" | "setTerrain">;
  #gesture: string | null = null;
  /** Where the sea stood that was turned off here. */
  #seaM: number | null = null;

  #set(fields: TerrainFields, settled = true): void {
    this.#gesture ??= this.edits.newGesture();
    this.edits.setTerrain(fields, this.#gesture);
    if (settled) this.#gesture = null;
  }

  protected override render(): TemplateResult | typeof nothing {
    const settings = this.doc.value?.settings;
    if (!settings) return nothing;
    const disabled = !this.canEdit.value;
    return html`
      <div class="group">
        <h3>${msg("Look")}</h3>
        <esk-segmented
          label=${msg("Look")}
          .segments=${LOOKS}
          .value=${settings.look}
          ?disabled=${disabled}
          @pick=${(e: CustomEvent<Look>) => this.#set({ look: e.detail })}
        ></esk-segmented>
      </div>
      ${this.#detail(settings, disabled)} ${this.#erosion(settings, disabled)} ${this.#sun(settings, disabled)} ${this.#sea(settings, disabled)} ${this.#lakes(settings, disabled)} ${this.#rivers(settings, disabled)} ${this.#reach(settings, disabled)}
      <div class="group">
        <h3>${msg("Border")}</h3>
        <esk-segmented
          label=${msg("Border")}
          .segments=${BORDERS}
          .value=${settings.border}
          ?disabled=${disabled}
          @pick=${(e: CustomEvent<Border>) => this.#set({ border: e.detail })}
        ></esk-segmented>
        <p class="lead">${BORDER_WORDS[settings.border]}</p>
      </div>
    `;
  }

  #detail({ rule, detail }: TerrainSettings, disabled: boolean): TemplateResult {
    return html`
      <div class="group">
        <h3>${msg("Detail")}</h3>
        <esk-segmented
          label=${msg("Rule of the detail")}
          .segments=${RULES}
          .value=${rule}
          ?disabled=${disabled}
          @pick=${(e: CustomEvent<Rule>) => this.#set({ rule: e.detail })}
        ></esk-segmented>
        <p class="lead">${RULE_WORDS[rule]}</p>
        ${
          rule === "landscape"
            ? html`<esk-range
                  label=${msg("Strength")}
                  of=${msg("of the detail")}
                  unit="×"
                  min="0"
                  max=${MAX_DETAIL}
                  step="0.1"
                  .value=${detail}
                  ?disabled=${disabled}
                  @value=${(e: CustomEvent<number>) => this.#set({ detail: tenth(e.detail) }, false)}
                  @settle=${(e: CustomEvent<number>) => this.#set({ detail: tenth(e.detail) })}
                ></esk-range>
                <p class="lead">${detailWords(detail)}</p>`
            : nothing
        }
      </div>
    `;
  }

  #erosion(settings: TerrainSettings, disabled: boolean): TemplateResult | typeof nothing {
    const { rule, erosion, erosion_scale: scale, hold } = settings;
    if (rule !== "landscape") return nothing;
    return html`
      <div class="group">
        <h3>${msg("Erosion")}</h3>
        <esk-range
          label=${msg("Strength")}
          of=${msg("of the erosion")}
          unit="×"
          min="0"
          max=${MAX_EROSION}
          step="0.1"
          .value=${erosion}
          ?disabled=${disabled}
          @value=${(e: CustomEvent<number>) => this.#set({ erosion: tenth(e.detail) }, false)}
          @settle=${(e: CustomEvent<number>) => this.#set({ erosion: tenth(e.detail) })}
        ></esk-range>
        <p class="lead">${erosionWords(erosion)}</p>
        <esk-range
          label=${msg("Size")}
          of=${msg("of the gullies")}
          unit=${msg("cells")}
          min=${MIN_EROSION_SCALE}
          max=${MAX_EROSION_SCALE}
          step="1"
          .value=${scale}
          ?disabled=${disabled}
          @value=${(e: CustomEvent<number>) => this.#set({ erosion_scale: tenth(e.detail) }, false)}
          @settle=${(e: CustomEvent<number>) => this.#set({ erosion_scale: tenth(e.detail) })}
        ></esk-range>
        <esk-range
          label=${msg("Hold")}
          of=${msg("of the crests")}
          unit="%"
          min="0"
          max="100"
          step="5"
          .value=${Math.round(100 * hold)}
          ?disabled=${disabled}
          @value=${(e: CustomEvent<number>) => this.#set({ hold: hundredth(e.detail) }, false)}
          @settle=${(e: CustomEvent<number>) => this.#set({ hold: hundredth(e.detail) })}
        ></esk-range>
        <p class="lead">${holdWords(hold)}</p>
      </div>
    `;
  }

  #sun(settings: TerrainSettings, disabled: boolean): TemplateResult {
    const { sun_azimuth_deg: azimuth, sun_elevation_deg: elevation } = settings;
    const move = (e: CustomEvent<SunPosition>, settled: boolean): void =>
      this.#set({ sun_azimuth_deg: e.detail.azimuthDeg, sun_elevation_deg: e.detail.elevationDeg }, settled);
    return html`
      <div class="group">
        <h3>${msg("Sun")}</h3>
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
    const heights = this.tiles.tile(0, 0, 0)?.heights ?? NO_HEIGHTS;
    const [lowest, highest] = seaSpan(heights, settings.size_m);
    const turn = (on: boolean): void => {
      if (!on) this.#seaM = level;
      this.#set({ sea_level_m: on ? (this.#seaM ?? seaStart(heights, settings.size_m)) : null });
    };
    return html`
      <div class="group">
        <wa-switch
          size="s"
          .checked=${live(level !== null)}
          ?disabled=${disabled}
          @change=${(e: Event) => turn((e.target as HTMLInputElement).checked)}
          >${msg("Sea")}</wa-switch
        >
        ${
          level === null
            ? nothing
            : html`<esk-range
                label=${msg("Sea level")}
                unit="m"
                min=${lowest}
                max=${highest}
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

  #lakes({ lakes_m: least, size_m: size }: TerrainSettings, disabled: boolean): TemplateResult {
    const standard = size * DEFAULT_LAKES_FRACTION;
    return html`
      <div class="group">
        <wa-switch
          size="s"
          .checked=${live(least !== null)}
          ?disabled=${disabled}
          @change=${(e: Event) => this.#set({ lakes_m: (e.target as HTMLInputElement).checked ? standard : null })}
          >${msg("Lakes")}</wa-switch
        >
        ${
          least === null
            ? html`<p class="lead">${msg("Basins stay dry.")}</p>`
            : html`<esk-range
                  label=${msg("From a depth of")}
                  of=${msg("for lakes")}
                  unit="m"
                  log
                  min=${standard / 8}
                  max=${standard * 32}
                  .value=${least}
                  ?disabled=${disabled}
                  @value=${(e: CustomEvent<number>) => this.#set({ lakes_m: e.detail }, false)}
                  @settle=${(e: CustomEvent<number>) => this.#set({ lakes_m: e.detail })}
                ></esk-range>
                <p class="lead">${msg("Basins fill to their brim. Draw a dam across a valley, or a crater.")}</p>`
        }
      </div>
    `;
  }

  #rivers({ rivers, wetness }: TerrainSettings, disabled: boolean): TemplateResult {
    return html`
      <div class="group">
        <wa-switch
          size="s"
          .checked=${live(rivers > 0)}
          ?disabled=${disabled}
          @change=${(e: Event) => this.#set({ rivers: (e.target as HTMLInputElement).checked ? DEFAULT_RIVERS : 0 })}
          >${msg("Rivers")}</wa-switch
        >
        ${
          rivers === 0
            ? html`<p class="lead">${msg("Water stands, and does not run.")}</p>`
            : html`<esk-range
                  label=${msg("How many")}
                  of=${msg("of the rivers")}
                  log
                  min=${MAX_RIVERS / 32}
                  max=${MAX_RIVERS}
                  .value=${rivers}
                  ?disabled=${disabled}
                  @value=${(e: CustomEvent<number>) => this.#set({ rivers: e.detail }, false)}
                  @settle=${(e: CustomEvent<number>) => this.#set({ rivers: e.detail })}
                ></esk-range>
                <esk-range
                  label=${msg("Wetness")}
                  of=${msg("of the rivers")}
                  log
                  min=${MIN_WETNESS}
                  max=${MAX_WETNESS}
                  .value=${wetness}
                  ?disabled=${disabled}
                  @value=${(e: CustomEvent<number>) => this.#set({ wetness: e.detail }, false)}
                  @settle=${(e: CustomEvent<number>) => this.#set({ wetness: e.detail })}
                ></esk-range>
                <p class="lead">${msg("Water runs down from where enough of it has gathered, through lakes, to the sea or the border.")}</p>`
        }
      </div>
    `;
  }

  #reach(settings: TerrainSettings, disabled: boolean): TemplateResult {
    const { reach_m: reach, size_m: size } = settings;
    return html`
      <div class="group">
        <h3>${msg("Reach")}</h3>
        <wa-switch
          size="s"
          .checked=${live(reach === null)}
          ?disabled=${disabled}
          @change=${(e: Event) =>
            this.#set({ reach_m: (e.target as HTMLInputElement).checked ? null : size * DEFAULT_REACH_FRACTION })}
          >${msg("Unlimited")}<span class="visually-hidden"> ${msg("reach")}</span></wa-switch
        >
        ${
          reach === null
            ? html`<p class="lead">${msg("Every stroke moves the whole terrain, as on a rubber sheet.")}</p>`
            : html`<esk-range
                label=${msg("Distance")}
                of=${msg("that strokes reach")}
                unit="m"
                log
                min=${size / 256}
                max=${size}
                .value=${reach}
                ?disabled=${disabled}
                @value=${(e: CustomEvent<number>) => this.#set({ reach_m: e.detail }, false)}
                @settle=${(e: CustomEvent<number>) => this.#set({ reach_m: e.detail })}
              ></esk-range>
              <p class="lead">${msg("Beyond its flanks a stroke moves the ground about this far.")}</p>`
        }
      </div>
    `;
  }
}

customElements.define("esk-terrain-panel", EskTerrainPanel);
