import { msg, str } from "@lit/localize";
import { fixed, plain } from "../../core/language.ts";
import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import { html, nothing, type TemplateResult } from "lit";
import {
  bytesWords,
  type ExportedFile,
  Exporter,
  type ExportPhase,
  engineWords,
  exportWords,
  isMap,
  ofUnreal,
  sizesOf,
  waitWords,
} from "../../app/layers/exports.ts";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import { exportTransport } from "../../app/server/export-api.ts";
import type { ExportFormat } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { exportStyles } from "../styles/export.ts";
import { progressStyles } from "../styles/progress.ts";
import { shared } from "../styles/shared.ts";
import { printChoice } from "./print-choice.ts";

interface Card {
  readonly value: ExportFormat;
  readonly label: string;
  readonly suffix: string;
  readonly says: string;
}

const CARDS: readonly Card[] = [
  {
    value: "png16",
    label: msg("Heightmap"),
    suffix: ".png",
    says: msg("16 bits. Unreal, Unity, Godot, Blender, World Machine."),
  },
  {
    value: "r16",
    label: msg("Raw heightmap"),
    suffix: ".r16",
    says: msg("16 bits and a note of their range, in one zip. Unity, Unreal."),
  },
  { value: "geotiff", label: "GeoTIFF", suffix: ".tif", says: msg("Heights in metres. QGIS, ArcGIS, GDAL.") },
  { value: "glb", label: msg("Mesh"), suffix: ".glb", says: msg("Triangles with colours. Blender, Godot, three.js.") },
  {
    value: "masks",
    label: msg("Masks"),
    suffix: ".zip",
    says: msg("Snow, grass, forest, wetness and water, as pictures for splat maps."),
  },
  {
    value: "map_pdf",
    label: msg("Contour map"),
    suffix: ".pdf",
    says: msg("To scale, for printing: contours with heights, grid, legend."),
  },
  {
    value: "map_svg",
    label: msg("Contour map"),
    suffix: ".svg",
    says: msg("The same, to be drawn on in Inkscape or Illustrator."),
  },
  { value: "stl", label: msg("3D print"), suffix: ".stl", says: msg("A closed solid in millimetres, for printers.") },
  { value: "npy", label: msg("Array"), suffix: ".npy", says: msg("Heights in metres, row 0 south. NumPy.") },
];

/** Takes the terrain to other programs: kind of file, samples, detail; then progress, and the file is saved. */
export class EskExport extends SignalElement {
  static override properties = { terrain: { attribute: false }, sizeM: { attribute: false }, open: { type: Boolean } };
  static override styles = [shared, progressStyles, exportStyles];

  declare terrain: Pick<OpenTerrain, "id" | "secret" | "client" | "historyView" | "toasts">;
  declare sizeM: number;
  declare open: boolean;
  #exporter: Exporter | null = null;
  #shown: ExportPhase = "choose";

  constructor() {
    super();
    this.open = false;
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#exporter?.dispose();
  }

  protected override willUpdate(changed: Map<PropertyKey, unknown>): void {
    if (changed.has("open") && this.open) this.#made().ask();
  }

  /** Moves the focus on when the pressed button has gone with its part of the dialog. */
  protected override updated(): void {
    const phase = this.#exporter?.phase.peek() ?? "choose";
    if (phase === this.#shown) return;
    this.#shown = phase;
    const next = {
      choose: "input:checked",
      done: ".btn.primary",
      failed: ".btn.primary",
      work: ".state",
      load: ".state",
    };
    if (this.open) this.renderRoot.querySelector<HTMLElement>(next[phase])?.focus({ preventScroll: true });
  }

  #made(): Exporter {
    const { terrain } = this;
    this.#exporter ??= new Exporter(
      exportTransport(terrain.id, () => terrain.secret, terrain.client),
      (file) => this.#keep(file),
      () => (terrain.historyView.active.peek() ? terrain.historyView.shown.peek() : null),
    );
    return this.#exporter;
  }

  #keep({ name, blob }: ExportedFile): void {
    const url = URL.createObjectURL(blob);
    Object.assign(document.createElement("a"), { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
    if (!this.open) this.terrain.toasts.show(msg(str`The export is done: ${name}.`));
  }

  protected override render(): TemplateResult {
    // The dialog is drawn when it is first wanted.
    if (!this.open && this.#exporter === null) return html``;
    const exporter = this.#made();
    const phase = exporter.phase.value;
    return html`
      <wa-dialog label=${msg("Export")} light-dismiss ?open=${this.open} @wa-after-hide=${this.#hidden}>
        ${phase === "choose" ? this.#choose(exporter) : this.#state(exporter)}
      </wa-dialog>
    `;
  }

  #choose(exporter: Exporter): TemplateResult {
    const { format, samples, detail, weights } = exporter.choice.value;
    const covers = format === "masks";
    const isHistory = this.terrain.historyView.active.value;
    return html`
      <form
        @submit=${(e: Event) => {
          e.preventDefault();
          void exporter.begin();
        }}
      >
        ${isHistory ? html`<p class="note">${msg("This exports the terrain as it was, as it is shown now.")}</p>` : nothing}
        <fieldset aria-label=${msg("Kind of file")}>
          ${CARDS.map(
            (card) => html`<label class="card">
              <input
                type="radio"
                name="format"
                value=${card.value}
                .checked=${card.value === format}
                @change=${() => exporter.choose({ format: card.value })}
              />
              <strong>${card.label}<span>${card.suffix}</span></strong>
              <small>${card.says}</small>
            </label>`,
          )}
        </fieldset>
        <label class="row">
          ${msg("Samples a side")}
          <select
            class="field"
            @change=${(e: Event) => exporter.choose({ samples: Number((e.target as HTMLSelectElement).value) })}
          >
            ${sizesOf(format).map(
              (n) => html`<option value=${n} ?selected=${n === samples}>${this.#sizeWords(n)}</option>`,
            )}
          </select>
        </label>
        ${isMap(format) || format === "stl" ? printChoice(exporter, this.sizeM) : nothing}
        ${
          covers
            ? html`<p class="note">${msg("Masks come from the detail: what the page shows on the ground.")}</p>
                <wa-switch
                  size="s"
                  ?checked=${weights}
                  @change=${(e: Event) => exporter.choose({ weights: (e.target as HTMLInputElement).checked })}
                  >${msg("They sum to one, with a mask for bare ground")}</wa-switch
                >`
            : html`<wa-switch
                size="s"
                ?checked=${detail}
                @change=${(e: Event) => exporter.choose({ detail: (e.target as HTMLInputElement).checked })}
                >${msg("With the fine detail that the page shows")}</wa-switch
              >`
        }
        <div class="end">
          <span class="quiet" role="status">${this.#costs(exporter)}</span>
          <button class="btn primary">${icon("download")} ${msg("Export")}</button>
        </div>
      </form>
    `;
  }

  #sizeWords(n: number): string {
    const spacing = this.sizeM / (n - 1);
    const every = fixed(spacing, spacing < 10 ? 2 : 1);
    return msg(str`${n} × ${n}, one every ${every} m`) + (ofUnreal(n) ? ` ${msg("(Unreal landscape)")}` : "");
  }

  #costs(exporter: Exporter): string {
    const found = exporter.estimate.value;
    if (found === null) return "";
    return msg(str`About ${bytesWords(found.bytes)}, ready in ${waitWords(found.seconds)}.`);
  }

  #state(exporter: Exporter): TemplateResult {
    const phase = exporter.phase.value;
    const status = exporter.status.value;
    if (phase === "failed")
      return html`<div class="state">
        <p class="problem" role="alert">${exporter.problem.value}</p>
        <div class="end"><div class="buttons">
          <button class="btn outline" @click=${() => exporter.again()}>${msg("Change it")}</button>
          <button class="btn primary" @click=${() => exporter.begin()}>${msg("Export again")}</button>
        </div></div>
      </div>`;
    if (phase === "done") return this.#done(exporter);
    const words = exportWords(phase, status);
    return html`<div class="state" tabindex="-1">
      <p class="says" role="status">${words}</p>
      <progress max="1" .value=${status?.share ?? 0} aria-label=${words}></progress>
      <p class="note">${msg("You can close this and go on: the file is saved when it is there. Drawing goes first.")}</p>
      <div class="end"><div class="buttons">
        <button class="btn outline" @click=${() => exporter.cancel()}>${msg("Cancel the export")}</button>
      </div></div>
    </div>`;
  }

  #done(exporter: Exporter): TemplateResult {
    const status = exporter.status.value;
    const file = exporter.file.value;
    const { format, samples } = exporter.choice.value;
    if (status === null || file === null) return html``;
    const lines =
      format === "png16" || format === "r16"
        ? engineWords(status, samples)
        : [
            msg(
              str`Heights from ${fixed(status.low_m, 2)} to ${fixed(status.high_m, 2)} m, one every ${plain(status.spacing_m)} m`,
            ),
          ];
    return html`<div class="state">
      <p class="came" role="status">${icon("check")}<span>${msg(html`Saved <strong>${file.name}</strong>, ${bytesWords(file.blob.size)}.`)}</span></p>
      <ul>
        ${lines.map((line) => html`<li>${line}</li>`)}
      </ul>
      <div class="end"><div class="buttons">
        <button class="btn outline" @click=${() => exporter.save()}>${msg("Save it again")}</button>
        <button class="btn primary" @click=${() => exporter.again()}>${msg("Export another")}</button>
      </div></div>
    </div>`;
  }

  #hidden(event: Event): void {
    if (event.target === event.currentTarget) this.dispatchEvent(new CustomEvent("close"));
  }
}

customElements.define("esk-export", EskExport);
