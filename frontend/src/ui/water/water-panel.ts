import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import { areaWords, heightWords, lengthWords, slopeWords, volumeWords } from "../../app/view/instruments/words.ts";
import { seaSpan, seaStart } from "../../app/view/sea.ts";
import type { WaterTool, WaterView } from "../../app/view/water/water-tool.ts";
import { endWords, floodWords, flowWords, hourWords } from "../../app/view/water/words.ts";
import { fixed, plain } from "../../core/language.ts";
import type { Doc } from "../../doc/document.ts";
import type { TileStore } from "../../tiles/store.ts";
import { icon } from "../controls/icons.ts";
import "../controls/number-field.ts";
import "../controls/range-field.ts";
import "../controls/segmented.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { sectionChart } from "../measuring/section-chart.ts";
import { measurePanelStyles } from "../styles/measure-panel.ts";
import { shared } from "../styles/shared.ts";
import { hydrograph } from "./hydrograph.ts";
import { waterStyles } from "./water-styles.ts";

const VIEWS: readonly { readonly value: WaterView; readonly label: string; readonly title: string }[] = [
  { value: "drop", label: msg("Drop"), title: msg("Where a drop of rain runs to, and all ground that drains there") },
  { value: "rain", label: msg("Rain"), title: msg("Rain over all of it, or under a cloud") },
  { value: "flood", label: msg("Flood"), title: msg("How high a lake stands after so much water") },
  { value: "sea", label: msg("Sea"), title: msg("What the sea covers") },
];
const WAYS = [
  { value: "rain", label: msg("By rain") },
  { value: "volume", label: msg("By volume") },
];
const WHERE = [
  { value: "all", label: msg("Everywhere") },
  { value: "here", label: msg("Under a cloud") },
];
const CHART_PX = 150;
const SMALL_CHART_PX = 108;
const GAUGE_PX = 112;

const row = (name: string, value: string): TemplateResult => html`<dt>${name}</dt><dd>${value}</dd>`;

/** Running water, looked at: a drop's way and its watershed, rain, floods, the sea. */
export class EskWater extends SignalElement {
  static override properties = {
    water: { attribute: false },
    doc: { attribute: false },
    canEdit: { attribute: false },
    tiles: { attribute: false },
    edits: { attribute: false },
    sizeM: { attribute: false },
  };
  static override styles = [shared, measurePanelStyles, waterStyles];

  declare water: WaterTool;
  declare doc: ReadonlySignal<Doc | null>;
  declare canEdit: ReadonlySignal<boolean>;
  /** The coarsest tile says how high a sea can stand. */
  declare tiles: Pick<TileStore, "tile">;
  declare edits: Pick<OpenTerrain, "newGesture" | "setTerrain">;
  declare sizeM: number;
  #width = 520;
  #observer: ResizeObserver | null = null;
  #gesture: string | null = null;

  override connectedCallback(): void {
    super.connectedCallback();
    this.#observer = new ResizeObserver(() => {
      const width = this.renderRoot.querySelector(".plot")?.clientWidth ?? 0;
      if (width > 0 && width !== this.#width) {
        this.#width = width;
        this.requestUpdate();
      }
    });
    this.#observer.observe(this);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#observer?.disconnect();
  }

  protected override render(): TemplateResult | typeof nothing {
    if (!this.water.isOpen.value) return nothing;
    const view = this.water.view.value;
    const body = { drop: this.#drop, rain: this.#rain, flood: this.#flood, sea: this.#sea }[view];
    return html`<header>
        <esk-segmented
          compact
          label=${msg("What water does")}
          .segments=${VIEWS}
          .value=${view}
          @pick=${(e: CustomEvent<WaterView>) => {
            this.water.view.value = e.detail;
          }}
        ></esk-segmented>
        <span class="space"></span>
        <button class="icon-btn small" aria-label=${msg("Take the place back")} title=${msg("Take the place back (Backspace)")} ?disabled=${this.water.ruler.points.value.length === 0} @click=${() => this.water.ruler.clear()}>${icon("undo")}</button>
        <button class="icon-btn small" aria-label=${msg("Put the water away")} title=${msg("Put the water away (Esc)")} @click=${() => this.water.ruler.close()}>${icon("xmark")}</button>
      </header>
      ${body.call(this)}`;
  }

  /** What to do while there is no place, or nothing was found yet. */
  #ask(words: string): TemplateResult | null {
    const { found, ruler } = this.water;
    if (found.value === null)
      return html`<div class="body plain"><p class="empty" role="status">${msg("Looking where water runs…")}</p></div>`;
    if (ruler.points.value.length > 0) return null;
    return html`<div class="body plain"><p class="empty">${msg(str`${words} Enter shows a pen for the arrow keys.`)}</p></div>`;
  }

  #drop(): TemplateResult {
    const { way, shed, profile } = this.water;
    const ask = this.#ask(msg("Click on the land, or drag over it: a drop falls there, and runs."));
    const [path, found, area] = [way.value, profile.value, shed.value];
    if (ask !== null || path === null || area === null) return ask ?? html``;
    const small = window.innerHeight < 620 || window.innerWidth < 721;
    return html`<div class="body">
      <div class="plot">
        ${
          found === null
            ? html`<p class="empty">${msg("The drop leaves the land right here.")}</p>`
            : sectionChart(this.water, found, this.#width, small ? SMALL_CHART_PX : CHART_PX)
        }
      </div>
      <dl aria-label=${msg("Where the drop runs")}>
        ${found === null ? nothing : html`${row(msg("Way"), lengthWords(found.lengthM))} ${row(msg("Falls by"), heightWords(found.height[0]! - found.height.at(-1)!))} ${row(msg("Mean slope"), slopeWords(Math.abs(found.overall)))}`}
        ${row(msg("Runs"), endWords(path))} ${row(msg("Watershed"), areaWords(area.areaM2))} ${this.#peak()}
      </dl>
    </div>`;
  }

  #rain(): TemplateResult {
    const { shower, ruler, found } = this.water;
    if (found.value === null) return this.#ask("")!;
    const here = ruler.points.value.length > 0;
    return html`<div class="body pair">
      <div class="controls">
        <esk-segmented
          compact
          label=${msg("Where rain falls")}
          .segments=${WHERE}
          .value=${shower.everywhere.value ? "all" : "here"}
          @pick=${(e: CustomEvent<string>) => {
            shower.everywhere.value = e.detail === "all";
          }}
        ></esk-segmented>
        ${
          shower.everywhere.value
            ? nothing
            : html`<esk-range
                label=${msg("Radius of the cloud")}
                of=${msg("of the rain")}
                unit="m"
                min=${this.sizeM / 128}
                max=${this.sizeM / 2}
                step=${this.sizeM / 512}
                .value=${shower.radiusM.value}
                @value=${(e: CustomEvent<number>) => {
                  shower.radiusM.value = e.detail;
                }}
                @settle=${(e: CustomEvent<number>) => {
                  shower.radiusM.value = e.detail;
                }}
              ></esk-range>`
        }
        <p class="empty">${
          here
            ? msg("The gauge stands at your place; click elsewhere to move it, and the cloud.")
            : msg(
                "Drops run down, gather in rivers and rest in lakes. Click on the land to set a gauge, or to move the cloud.",
              )
        }</p>
      </div>
      ${here ? this.#gauge() : html`<div class="plot">${this.#rainfall()}</div>`}
    </div>`;
  }

  #rainfall(): TemplateResult {
    const { rainfall } = this.water;
    const set = (fields: Partial<typeof rainfall.value>): void => {
      rainfall.value = { ...rainfall.value, ...fields };
    };
    return html`<div class="row">
      <esk-number label=${msg("Rain")} unit="mm/h" .min=${0.1} .max=${500} .digits=${1} .value=${rainfall.value.mmPerHour} @number=${(e: CustomEvent<number>) => set({ mmPerHour: e.detail })}></esk-number>
      <esk-number label=${msg("for")} unit="h" .min=${0.1} .max=${240} .digits=${1} .value=${rainfall.value.hours} @number=${(e: CustomEvent<number>) => set({ hours: e.detail })}></esk-number>
    </div>`;
  }

  /** The gauge in one line; the rain tells more. */
  #peak(): TemplateResult | typeof nothing {
    const gauge = this.water.gauge.value;
    if (gauge === null) return nothing;
    const { mmPerHour, hours } = this.water.rainfall.value;
    return row(msg(str`After ${plain(hours)} h of ${plain(mmPerHour)} mm/h`), flowWords(gauge.peak.flow));
  }

  /** The gauge at the place, with the rain that it is asked about. */
  #gauge(): TemplateResult | typeof nothing {
    const gauge = this.water.gauge.value;
    if (gauge === null) return nothing;
    return html`<div class="gauge plot">
      <h4>${msg(str`Gauge: ${flowWords(gauge.peak.flow)} at most, ${hourWords(gauge.peak.seconds)} after rain begins; ${flowWords(gauge.endless)} if it does not end`)}</h4>
      ${hydrograph(gauge, this.water.rainfall.value, this.#width, GAUGE_PX)} ${this.#rainfall()}
    </div>`;
  }

  #flood(): TemplateResult {
    const { amount, flood } = this.water;
    const ask = this.#ask(msg("Click into a hollow or on the slope above it: water is poured out there."));
    const found = flood.value;
    const controls = html`<div class="controls">
      <esk-segmented
        compact
        label=${msg("How much water")}
        .segments=${WAYS}
        .value=${amount.value.by}
        @pick=${(e: CustomEvent<"rain" | "volume">) => {
          amount.value = { ...amount.value, by: e.detail };
        }}
      ></esk-segmented>
      ${amount.value.by === "rain" ? this.#millimetres() : this.#cubicMetres()}
    </div>`;
    if (ask !== null || found === null) return html`<div class="body pair">${controls}${ask ?? nothing}</div>`;
    const [lake] = found.lakes;
    return html`<div class="body pair">
      ${controls}
      <div>
        <p role="status">${floodWords(found)}</p>
        <dl aria-label=${msg("Figures of the flood")}>
          ${row(msg("Poured out"), volumeWords(found.pouredM3))} ${row(msg("Watershed"), areaWords(found.shedM2))}
          ${
            lake === undefined
              ? nothing
              : html`${row(msg("Level"), heightWords(lake.levelM))} ${row(msg("Depth"), lengthWords(lake.depthM))}
                ${row(msg("Volume"), volumeWords(lake.volumeM3))} ${row(msg("Area"), areaWords(lake.areaM2))}`
          }
          ${found.lakes.length > 1 ? row(msg("Lakes"), String(found.lakes.length)) : nothing}
          ${row(msg("Runs off"), volumeWords(found.runsOffM3))}
        </dl>
      </div>
    </div>`;
  }

  #millimetres(): TemplateResult {
    const { amount } = this.water;
    const set = (e: CustomEvent<number>): void => {
      amount.value = { ...amount.value, mm: e.detail };
    };
    return html`<esk-range
      label=${msg("Rain on the watershed")}
      of=${msg("on the watershed")}
      unit="mm"
      min="1"
      max="2000"
      step="1"
      log
      .value=${amount.value.mm}
      @value=${set}
      @settle=${set}
    ></esk-range>`;
  }

  #cubicMetres(): TemplateResult {
    const { amount } = this.water;
    const set = (e: CustomEvent<number>): void => {
      amount.value = { ...amount.value, m3: 1e6 * e.detail };
    };
    const most = Math.max(1, this.sizeM ** 3 / 1e9);
    return html`<esk-range
      label=${msg("Water")}
      of=${msg("poured out")}
      unit="Mm³"
      min=${most / 1e5}
      max=${most}
      step=${most / 1e5}
      log
      .value=${Math.min(most, amount.value.m3 / 1e6)}
      @value=${set}
      @settle=${set}
    ></esk-range>`;
  }

  #sea(): TemplateResult {
    const level = this.doc.value?.settings.sea_level_m ?? null;
    const heights = this.tiles.tile(0, 0, 0)?.heights ?? new Float32Array(1);
    const [lowest, highest] = seaSpan(heights, this.sizeM);
    const disabled = !this.canEdit.value;
    const sea = this.water.sea.value;
    return html`<div class="body pair">
      <div class="controls">
        <label class="switch">
          <input
            type="checkbox"
            .checked=${level !== null}
            ?disabled=${disabled}
            @change=${(e: Event) => this.#set((e.target as HTMLInputElement).checked ? seaStart(heights, this.sizeM) : null)}
          />
          ${msg("Sea")}
        </label>
        ${
          level === null
            ? nothing
            : html`<esk-range
                label=${msg("Level of the sea")}
                of=${msg("of the sea")}
                unit="m"
                min=${lowest}
                max=${highest}
                step=${this.sizeM / 4096}
                .value=${level}
                ?disabled=${disabled}
                @value=${(e: CustomEvent<number>) => this.#set(e.detail, false)}
                @settle=${(e: CustomEvent<number>) => this.#set(e.detail)}
              ></esk-range>`
        }
        ${disabled ? html`<p class="empty">${msg("The level is a setting of the terrain: an edit link changes it.")}</p>` : nothing}
      </div>
      <div role="status">
        ${
          sea === null
            ? html`<p class="empty">${msg("There is no sea. Everybody here sees it come.")}</p>`
            : html`<div class="large">${areaWords(sea.areaM2)}</div><p class="empty">${msg(str`${fixed(100 * sea.share, 1)} % of the land lies under the sea.`)}</p>`
        }
      </div>
    </div>`;
  }

  #set(sea_level_m: number | null, settled = true): void {
    this.#gesture ??= this.edits.newGesture();
    this.edits.setTerrain({ sea_level_m }, this.#gesture);
    if (settled) this.#gesture = null;
  }
}

customElements.define("esk-water", EskWater);
