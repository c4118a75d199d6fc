import { html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import type { ImportQuestion, ImportReport } from "../generated/contract.ts";
import { BY_HAND, isPlaceQuestion } from "./groundwork.ts";
import { icon } from "./icons.ts";
import { type ImportJob, isOver } from "./imports.ts";
import { reportFacts } from "./layers.ts";
import { PendingLaying } from "./laying.ts";
import "./placement-form.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { importCardStyles } from "./styles/import-card.ts";
import { shared } from "./styles/shared.ts";
import { bytes } from "./words.ts";

const STAGES: Readonly<Record<string, string>> = {
  upload: "Receiving",
  reading: "Reading the heights",
  mipmaps: "Making coarser levels",
  errors: "Measuring how far each patch is right",
  saving: "Saving",
};

/** What an import does at this moment, with how far it is. */
export function jobWords(job: ImportJob): string {
  const percent = `${Math.round(100 * job.share)} %`;
  switch (job.phase) {
    case "waiting":
      return "Waits for the file before it";
    case "upload":
      return `Uploading, ${percent} of ${bytes(job.bytes)}`;
    case "work":
      return `${STAGES[job.status?.stage ?? "reading"] ?? "Working"}, ${percent}`;
    case "question":
      return "Needs an answer from you";
    case "done":
      return "Part of the ground now";
    case "refused":
      return "Cannot be used";
    case "cancelled":
      return "Cancelled. Nothing was added";
    case "failed":
      return "Did not arrive";
  }
}

/** One file on its way: how far it is, what it is, what it asks. */
export class EskImportCard extends SignalElement {
  static override properties = { stage: { attribute: false }, job: { attribute: false } };
  static override styles = [shared, importCardStyles];

  declare stage: Stage;
  declare job: ImportJob;

  protected override render(): TemplateResult {
    const { job } = this;
    const { imports } = this.stage.groundwork;
    const report = job.status?.report ?? null;
    const over = isOver(job.phase);
    const tone = job.phase === "refused" || job.phase === "failed" ? "bad" : job.phase === "done" ? "ok" : "";
    return html`
      <article class=${tone} aria-label=${`File ${job.file}`}>
        <header>
          <strong title=${job.file}>${job.file}</strong>
          <button
            class="icon-btn small"
            aria-label=${over ? `Close the card of ${job.file}` : `Cancel ${job.file}`}
            title=${over ? "Close" : "Cancel"}
            @click=${() => (over ? imports.dismiss(job.key) : imports.cancel(job.key))}
          >
            ${icon("xmark")}
          </button>
        </header>
        <p class="stage" role="status">${jobWords(job)}</p>
        ${
          job.phase === "upload" || job.phase === "work"
            ? html`<progress max="1" .value=${job.share} aria-label=${jobWords(job)}></progress>`
            : nothing
        }
        ${job.problem ? html`<p class="problem">${job.problem}</p>` : nothing}
        ${job.phase === "refused" ? html`<p class="quiet">${whatToDo(report)}</p>` : nothing}
        ${report && job.phase !== "upload" ? this.#report(report) : nothing}
        ${job.phase === "question" && report ? this.#questions(report) : nothing}
      </article>
    `;
  }

  #report(report: ImportReport): TemplateResult {
    const facts = reportFacts(report);
    return html`
      ${
        facts.length > 0
          ? html`<details ?open=${this.job.phase === "question"}>
              <summary>What it is</summary>
              <dl>${facts.map(([what, how]) => html`<dt>${what}</dt><dd>${how}</dd>`)}</dl>
            </details>`
          : nothing
      }
      ${report.notes.map((note) => html`<p class="note">${icon("info")}<span>${note}</span></p>`)}
    `;
  }

  #questions(report: ImportReport): TemplateResult {
    const { groundwork, input, sizeM } = this.stage;
    const answers = groundwork.answersTo(this.job);
    const laying = input.laying.value;
    const byHand = laying instanceof PendingLaying;
    const asked = report.questions.filter((q) => !(isPlaceQuestion(q) && q.options.length <= 1));
    return html`
      <form @submit=${this.#submit}>
        ${asked.map((q) => this.#question(q, answers[q.id] ?? ""))}
        ${
          byHand
            ? html`<p class="note">
                  ${icon("info")}<span>Drag the grid and its handles on the ground. Nobody else sees it yet.</span>
                </p>
                <esk-placement-form
                  .shape=${laying}
                  .place=${laying.place.value}
                  .sizeM=${sizeM}
                  @place=${(e: CustomEvent) => laying.lay(e.detail)}
                ></esk-placement-form>`
            : nothing
        }
        <div class="row">
          <button class="btn outline" type="button" @click=${() => groundwork.imports.cancel(this.job.key)}>Cancel</button>
          <button class="btn primary" type="submit">${byHand ? "Place it here" : "Go on"}</button>
        </div>
      </form>
    `;
  }

  #submit(event: SubmitEvent): void {
    event.preventDefault();
    void this.stage.groundwork.answer(this.job);
  }

  #question(question: ImportQuestion, answer: string): TemplateResult {
    const set = (value: string): void => this.stage.groundwork.setAnswer(this.job, question.id, value);
    const name = `${this.job.key}-${question.id}`;
    if (question.options.length > 0)
      return html`<fieldset>
        <legend>${question.text}</legend>
        ${question.options.map(
          (option) => html`<label class="choice">
            <input type="radio" name=${name} .checked=${live(option === answer)} @change=${() => set(option)} />
            <span>${optionWords(option)}</span>
          </label>`,
        )}
      </fieldset>`;
    return html`<label class="typed">
      <span>${question.text}</span>
      <input
        class="field"
        autocomplete="off"
        inputmode="decimal"
        .value=${live(answer)}
        @input=${(e: Event) => set((e.target as HTMLInputElement).value.trim())}
        @keydown=${(e: Event) => e.stopPropagation()}
      />
    </label>`;
  }
}

/** An option as a person reads it. */
function optionWords(option: string): string {
  if (option === BY_HAND) return "I lay it on the terrain by hand";
  return option.length > 0 ? option[0]!.toUpperCase() + option.slice(1) : "Nothing";
}

function whatToDo(report: ImportReport | null): string {
  if (report === null || report.format === "")
    return "Elevation comes as GeoTIFF, HGT, Esri ASCII, IMG, DTED, 16-bit PNG, RAW, NPY or NPZ.";
  return "Nothing was added. Mend the file and drop it again, or drop another one.";
}

customElements.define("esk-import-card", EskImportCard);
