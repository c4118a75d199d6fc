import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { type Instruments, SINCE_BEGAN } from "../../app/view/instruments/instruments.ts";
import { SECTION_EXAGGERATIONS } from "../../app/view/instruments/profile-chart.ts";
import { profileCsv, profileSvg } from "../../app/view/instruments/profile-files.ts";
import { areaWords, heightWords, lengthWords, slopeWords, volumeWords } from "../../app/view/instruments/words.ts";
import type { AreaFigures } from "../../core/measure/area.ts";
import { isImpossible } from "../../core/measure/places.ts";
import type { Profile } from "../../core/measure/profile.ts";
import type { RulerKind } from "../../input/tools/ruler.ts";
import { icon } from "../controls/icons.ts";
import "../controls/number-field.ts";
import "../controls/segmented.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { measurePanelStyles } from "../styles/measure-panel.ts";
import { shared } from "../styles/shared.ts";
import { pointFields } from "./measure-points.ts";
import { sectionChart } from "./section-chart.ts";

const KINDS = [
  { value: "line", label: msg("Profile") },
  { value: "area", label: msg("Area") },
];
/** Half the height of the panel is the section; on small windows it is less. */
const CHART_PX = 156;
const SMALL_CHART_PX = 112;

const row = (name: string, value: string, kind = ""): TemplateResult =>
  html`<dt>${name}</dt><dd class=${kind}>${value}</dd>`;

/** What the ruler measures: the section along a line with its figures, or the figures of an area. */
export class EskMeasure extends SignalElement {
  static override properties = {
    instruments: { attribute: false },
    sizeM: { attribute: false },
    heading: { attribute: false },
    historyClock: { attribute: false },
  };
  static override styles = [shared, measurePanelStyles];

  declare instruments: Instruments;
  declare sizeM: number;
  /** The name of the terrain, for files. */
  declare heading: ReadonlySignal<string>;
  /** The clock of the history that is shown; null: now. */
  declare historyClock: ReadonlySignal<number | null>;
  #width = 640;
  #observer: ResizeObserver | null = null;

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
    const { ruler } = this.instruments;
    const kind = ruler.kind.value;
    if (kind === null || kind === "water") return nothing;
    return html`${this.#head(kind)} ${kind === "line" ? this.#line() : this.#area()}`;
  }

  #head(kind: RulerKind): TemplateResult {
    const { ruler } = this.instruments;
    const none = ruler.points.value.length === 0;
    const profile = this.instruments.profile.value;
    const files = profile !== null && !isImpossible(profile);
    return html`<header>
      <esk-segmented
        compact
        label=${msg("What is measured")}
        .segments=${KINDS}
        .value=${kind}
        @pick=${(e: CustomEvent<RulerKind>) => ruler.open(e.detail)}
      ></esk-segmented>
      <span class="space"></span>
      ${files ? this.#files(profile) : nothing}
      <button class="icon-btn small" aria-label=${msg("Take the last point back")} title=${msg("Take the last point back (Backspace)")} ?disabled=${none} @click=${() => ruler.removeLast()}>
        ${icon("undo")}
      </button>
      <button class="icon-btn small" aria-label=${msg("Begin anew")} title=${msg("Begin anew")} ?disabled=${none} @click=${() => ruler.clear()}>${icon("trash")}</button>
      <button class="icon-btn small" aria-label=${msg("Stop measuring")} title=${msg("Stop measuring (Esc)")} @click=${() => ruler.close()}>${icon("xmark")}</button>
    </header>`;
  }

  #files(profile: Profile): TemplateResult {
    const { instruments } = this;
    const before = instruments.beforeHeights.value;
    const title = msg(str`${this.heading.value || msg("Terrain")}, profile`);
    const exaggeration = instruments.exaggeration.value;
    return html`<button class="btn quiet" @click=${() => this.#save("csv", "text/csv", profileCsv(profile, before))}>${icon("download")} CSV</button>
      <button class="btn quiet" @click=${() => this.#save("svg", "image/svg+xml", profileSvg(profile, title, { exaggeration, before }))}>${icon("download")} SVG</button>`;
  }

  #save(suffix: string, type: string, text: string): void {
    const url = URL.createObjectURL(new Blob([text], { type }));
    Object.assign(document.createElement("a"), { href: url, download: `profile.${suffix}` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  }

  #line(): TemplateResult {
    const { instruments } = this;
    const found = instruments.profile.value;
    const points = instruments.ruler.points.value;
    if (points.length === 0)
      return html`<div class="body plain"><p class="empty">${msg("Draw a line over the land, or click its points one by one. Enter shows a pen for the arrow keys.")}</p></div>`;
    if (found === null || isImpossible(found))
      return html`<div class="body plain"><p class="problem" role="status">${found?.problem}</p>${this.#points()}</div>`;
    const height = window.innerHeight < 620 || window.innerWidth < 721 ? SMALL_CHART_PX : CHART_PX;
    return html`<div class="body">
      <div class="plot">${sectionChart(instruments, found, this.#width, height)}</div>
      <dl aria-label=${msg("Figures of the profile")}>
        ${row(msg("Length"), lengthWords(found.lengthM))} ${row(msg("Along the ground"), lengthWords(found.surfaceM))}
        ${row(msg("Lowest"), heightWords(found.min.m))} ${row(msg("Highest"), heightWords(found.max.m))}
        ${row(msg("Climb"), heightWords(found.gainM))} ${row(msg("Descent"), heightWords(found.lossM))}
        ${row(msg("Steepest"), slopeWords(Math.abs(found.steepest.m)))} ${row(msg("End to end"), slopeWords(found.overall))}
      </dl>
      <div class="foot">
        <label>
          ${msg("Heights")}
          <select class="field" aria-label=${msg("Vertical exaggeration of the section")} @change=${this.#exaggerate}>
            ${SECTION_EXAGGERATIONS.map(
              (k) =>
                html`<option value=${k} ?selected=${k === instruments.exaggeration.value}>${k === 0 ? msg("fill") : `× ${k}`}</option>`,
            )}
          </select>
        </label>
        ${this.#compared()}
      </div>
      ${this.#points()}
    </div>`;
  }

  #exaggerate = (e: Event): void => {
    this.instruments.exaggeration.value = Number((e.target as HTMLSelectElement).value);
  };

  #area(): TemplateResult {
    const { instruments } = this;
    const found = instruments.area.value;
    if (instruments.ruler.points.value.length === 0)
      return html`<div class="body plain"><p class="empty">${msg("Draw an outline on the land, or click its corners one by one. Enter shows a pen for the arrow keys.")}</p></div>`;
    if (found === null || isImpossible(found))
      return html`<div class="body plain"><p class="problem" role="status">${found?.problem}</p>${this.#points()}</div>`;
    return html`<div class="body plain">
      <dl class="wide" aria-label=${msg("Figures of the area")}>${this.#areaRows(found)}</dl>
      <div class="foot">
        <esk-number
          label=${msg("Level for volumes")}
          unit="m"
          .min=${-100_000}
          .max=${100_000}
          .digits=${1}
          .value=${instruments.levelM.value}
          @number=${(e: CustomEvent<number>) => {
            instruments.levelM.value = e.detail;
          }}
        ></esk-number>
        ${this.#compared()}
      </div>
      ${this.#points()}
    </div>`;
  }

  #areaRows(found: AreaFigures): TemplateResult {
    const level = heightWords(this.instruments.levelM.value);
    return html`${row(msg("Area"), areaWords(found.areaM2))} ${row(msg("Along the ground"), areaWords(found.surfaceM2))}
      ${row(msg("Around"), lengthWords(found.perimeterM))} ${row(msg("Mean slope"), slopeWords(found.meanSlope))}
      ${row(msg("Lowest"), heightWords(found.minM))} ${row(msg("Highest"), heightWords(found.maxM))}
      ${row(msg("Mean height"), heightWords(found.meanM))} ${row(msg("Cells summed"), lengthWords(found.cellM))}
      ${row(msg(str`Ground above ${level}`), volumeWords(found.aboveM3))} ${row(msg(str`Room below ${level}`), volumeWords(found.belowM3))}
      ${
        found.risenM3 === null
          ? nothing
          : html`${row(msg("Heaped up"), volumeWords(found.risenM3), "rise")} ${row(msg("Dug out"), volumeWords(found.sunkenM3 ?? 0), "rise")}`
      }`;
  }

  /** With which moment the ground is compared, and a way to take the one that is shown. */
  #compared(): TemplateResult {
    const { instruments } = this;
    const clock = this.historyClock.value;
    const words = clock === null ? msg("since you pressed Compare") : msg(str`since step ${clock} of the history`);
    return html`<button class="btn outline" title=${msg("Keeps the ground that is shown, to see what changes from it")} @click=${() => instruments.keep(words)}>
        ${clock === null ? msg("Compare from now on") : msg("Compare with this moment")}
      </button>
      <span class="small-text">${msg(str`Change: ${instruments.before.value?.words ?? SINCE_BEGAN}. Ground without its fine detail.`)}</span>`;
  }

  #points(): TemplateResult | typeof nothing {
    return pointFields(this.instruments.ruler, this.sizeM);
  }
}

customElements.define("esk-measure", EskMeasure);
