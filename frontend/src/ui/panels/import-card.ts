import { msg, str } from "@lit/localize";
import { html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import {
  handAnswers,
  heightRange,
  listsFormats,
  namesSystem,
  optionWords,
  rangeWords,
} from "../../app/layers/import-questions.ts";
import { type ImportJob, isOver } from "../../app/layers/imports.ts";
import { reportFacts } from "../../app/layers/layers.ts";
import { PendingPlacing } from "../../app/layers/placing.ts";
import type { ImportQuestion, ImportReport } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import "./placement-form.ts";
import type { ReadonlySignal } from "@preact/signals-core";
import type { Groundwork } from "../../app/layers/groundwork.ts";
import { questionWords } from "../../app/words/question-words.ts";
import { bytes } from "../../app/words/words.ts";
import type { Placing } from "../../input/tools/placement.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { factsStyles } from "../styles/facts.ts";
import { importCardStyles } from "../styles/import-card.ts";
import { progressStyles } from "../styles/progress.ts";
import { shared } from "../styles/shared.ts";

const STAGES: Readonly<Record<string, string>> = {
  upload: msg("Receiving"),
  reading: msg("Reading the heights"),
  mipmaps: msg("Making coarser levels"),
  errors: msg("Measuring how far each patch is right"),
  saving: msg("Saving"),
};

/** Returns the stage of an import in words, with how far it is. */
export function jobWords(job: ImportJob): string {
  const percent = `${Math.round(100 * job.share)}\u00a0%`;
  switch (job.phase) {
    case "waiting":
      return msg("Waits for the file before it");
    case "upload":
      return msg(str`Uploading, ${percent} of ${bytes(job.bytes)}`);
    case "work":
      return `${STAGES[job.status?.stage ?? "reading"] ?? msg("Working")}, ${percent}`;
    case "question":
      return msg("Needs an answer from you");
    case "done":
      return msg("Part of the ground now");
    case "refused":
      return msg("Cannot be used");
    case "cancelled":
      return msg("Cancelled. Nothing was added");
    case "failed":
      return msg("Did not arrive");
  }
}

/** One file on its way: how far its import is, what the file is, what it asks. */
export class EskImportCard extends SignalElement {
  static override properties = {
    groundwork: { attribute: false },
    placing: { attribute: false },
    sizeM: { attribute: false },
    job: { attribute: false },
  };
  static override styles = [shared, progressStyles, factsStyles, importCardStyles];

  declare groundwork: Groundwork;
  /** The grid in hand. */
  declare placing: ReadonlySignal<Placing | null>;
  declare sizeM: number;
  declare job: ImportJob;

  protected override render(): TemplateResult {
    const { job } = this;
    const { imports } = this.groundwork;
    const report = job.status?.report ?? null;
    const over = isOver(job.phase);
    const tone = job.phase === "refused" || job.phase === "failed" ? "bad" : job.phase === "done" ? "ok" : "";
    return html`
      <article class=${tone} aria-label=${msg(str`File ${job.file}`)}>
        <header>
          <strong title=${job.file}>${job.file}</strong>
          <button
            class="icon-btn small"
            aria-label=${over ? msg(str`Close the card of ${job.file}`) : msg(str`Cancel ${job.file}`)}
            title=${over ? msg("Close") : msg("Cancel")}
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
        ${job.phase === "refused" ? html`<p class="quiet">${whatToDo(job.problem)}</p>` : nothing}
        ${report && job.phase !== "upload" ? this.#report(report, job.phase === "question" && this.placing.value === null) : nothing}
        ${job.phase === "question" && report ? this.#questions(report) : nothing}
      </article>
    `;
  }

  /** Questions count as seen once a frame has shown them: a narrow screen closes the panel when a grid comes to hand. */
  protected override updated(): void {
    const { job, groundwork } = this;
    if (job.phase !== "question") return;
    requestAnimationFrame(() => {
      if (this.isConnected && this.job.key === job.key) groundwork.questionsSeen(job);
    });
  }

  #report(report: ImportReport, open: boolean): TemplateResult {
    const facts = reportFacts(report);
    return html`
      ${
        facts.length > 0
          ? html`<details ?open=${open}>
              <summary>${msg("What it is")}</summary>
              <dl>${facts.map(([what, how]) => html`<dt>${what}</dt><dd>${how}</dd>`)}</dl>
            </details>`
          : nothing
      }
      ${report.notes.map((note) => html`<p class="note">${icon("info")}<span>${note}</span></p>`)}
    `;
  }

  #questions(report: ImportReport): TemplateResult {
    const { groundwork, sizeM } = this;
    const answers = groundwork.answersTo(this.job);
    const placing = this.placing.value;
    const byHand = placing instanceof PendingPlacing;
    const asked = report.questions.filter((q) => !(byHand && handAnswers(q)));
    return html`
      <form @submit=${this.#submit}>
        ${asked.map((q) => this.#question(q, answers[q.id] ?? ""))}
        ${
          byHand
            ? html`<p class="note">
                  ${icon("info")}<span>${msg("Drag the grid and its handles on the ground. Nobody else sees it yet.")}</span>
                </p>
                <esk-placement-form
                  .shape=${placing}
                  .place=${placing.place.value}
                  .sizeM=${sizeM}
                  @place=${(e: CustomEvent) => placing.moveTo(e.detail)}
                ></esk-placement-form>`
            : nothing
        }
        <div class="row">
          <button class="btn outline" type="button" @click=${() => groundwork.imports.cancel(this.job.key)}>${msg("Cancel")}</button>
          <button class="btn primary" type="submit">${byHand ? msg("Place it here") : msg("Go on")}</button>
        </div>
      </form>
    `;
  }

  #range(text: string, [low, high]: readonly [number, number], set: (value: string) => void): TemplateResult {
    const field = (label: string, value: number, put: (v: number) => string): TemplateResult => html`<esk-number
      label=${label}
      unit="m"
      digits="2"
      .value=${value}
      @number=${(e: CustomEvent<number>) => set(put(e.detail))}
    ></esk-number>`;
    return html`<fieldset>
      <legend>${rangeWords(text)}</legend>
      <div class="two">
        ${field(msg("Lowest"), low, (v) => `${v}..${Math.max(v, high)}`)}
        ${field(msg("Highest"), high, (v) => `${Math.min(v, low)}..${v}`)}
      </div>
    </fieldset>`;
  }

  /** Systems that the question does not list. */
  #otherSystem(question: ImportQuestion, answer: string, set: (value: string) => void): TemplateResult {
    const own = question.options.includes(answer) ? "" : answer;
    return html`<label class="choice other">
      <span>${msg("Or")}</span>
      <input
        class="field"
        placeholder="EPSG:32610"
        autocomplete="off"
        spellcheck="false"
        aria-label=${msg("Another coordinate system, as an EPSG code")}
        .value=${live(own)}
        @change=${(e: Event) => set((e.target as HTMLInputElement).value.trim() || question.default)}
        @keydown=${(e: Event) => e.stopPropagation()}
      />
    </label>`;
  }

  #submit(event: SubmitEvent): void {
    event.preventDefault();
    void this.groundwork.answer(this.job);
  }

  #question(question: ImportQuestion, answer: string): TemplateResult {
    const set = (value: string): void => this.groundwork.setAnswer(this.job, question.id, value);
    const name = `${this.job.key}-${question.id}`;
    if (heightRange(answer) !== null && heightRange(question.default) !== null)
      return this.#range(questionWords(question), heightRange(answer)!, set);
    if (question.options.length > 0)
      return html`<fieldset>
        <legend>${questionWords(question)}</legend>
        ${question.options.map(
          (option) => html`<label class="choice">
            <input type="radio" name=${name} .checked=${live(option === answer)} @change=${() => set(option)} />
            <span>${optionWords(question.id, option)}</span>
          </label>`,
        )}
        ${namesSystem(question) ? this.#otherSystem(question, answer, set) : nothing}
      </fieldset>`;
    return html`<label class="typed">
      <span>${questionWords(question)}</span>
      <input
        class="field"
        autocomplete="off"
        .value=${live(answer)}
        @input=${(e: Event) => set((e.target as HTMLInputElement).value.trim())}
        @keydown=${(e: Event) => e.stopPropagation()}
      />
    </label>`;
  }
}

function whatToDo(problem: string | null): string {
  if (listsFormats(problem ?? "")) return msg("Nothing was added. Save it in one of these formats and drop it again.");
  return msg("Nothing was added. Mend the file and drop it again, or drop another one.");
}

customElements.define("esk-import-card", EskImportCard);
