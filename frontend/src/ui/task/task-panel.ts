import { msg } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import type { ReadonlySignal } from "@preact/signals-core";
import { signal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import { pictureUrl } from "../../app/lesson/task/pictures.ts";
import { scoreWords } from "../../app/lesson/task/score-words.ts";
import type { TaskView } from "../../app/lesson/task/task-view.ts";
import { goalWords } from "../../app/lesson/task/words.ts";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import type { Lesson, Score, Task } from "../../generated/contract.ts";
import type { Ruler } from "../../input/tools/ruler.ts";
import type { TileStore } from "../../tiles/store.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { panelStyles } from "../styles/panel.ts";
import { shared } from "../styles/shared.ts";
import { contourPicture } from "./contour-picture.ts";
import { taskStyles } from "./styles.ts";
import "./task-form.ts";

/** What is asked, how far one is, and, for who leads, the way to write it. */
export class EskTaskPanel extends SignalElement {
  static override properties = {
    view: { attribute: false },
    score: { attribute: false },
    lesson: { attribute: false },
    ruler: { attribute: false },
    tiles: { attribute: false },
    edits: { attribute: false },
  };
  static override styles = [shared, panelStyles, taskStyles];

  declare view: TaskView;
  declare score: ReadonlySignal<Score | null>;
  declare lesson: ReadonlySignal<Lesson>;
  declare ruler: Ruler;
  declare tiles: TileStore;
  declare edits: Pick<OpenTerrain, "newGesture" | "setTerrain">;
  readonly #writing = signal(false);
  readonly #urls = new Map<string, string>();

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    for (const url of this.#urls.values()) URL.revokeObjectURL(url);
    this.#urls.clear();
  }

  protected override render(): TemplateResult {
    const task = this.view.task.value;
    const leads = this.lesson.value.conducts;
    if (leads && this.#writing.value)
      return html`<esk-task-form
        .view=${this.view}
        .ruler=${this.ruler}
        .tiles=${this.tiles}
        .edits=${this.edits}
        @done=${() => {
          this.#writing.value = false;
        }}
      ></esk-task-form>`;
    const write = html`<button
      class="btn ${task === null ? "primary" : "outline"}"
      @click=${() => {
        this.#writing.value = true;
      }}
    >
      ${icon("sketch")} ${task === null ? msg("Write a task") : msg("Change the task")}
    </button>`;
    if (task === null)
      return html`<div class="empty">
        ${icon("star")}
        <p>${leads ? msg("Ask a class for something: a target, a profile, a dam that holds. Everybody sees how far they are.") : msg("This terrain has no task.")}</p>
        ${leads ? write : nothing}
      </div>`;
    return html`${this.#told(task)} ${this.#score()} ${this.#shown(task)} ${leads ? html`<div class="group">${write}</div>` : nothing}`;
  }

  #told(task: Task): TemplateResult {
    const { view } = this;
    const wrong = view.broken.value;
    return html`<section class="text">
      <h2>${task.title || msg("The task")}</h2>
      ${task.text
        .split("\n")
        .filter((line) => line.trim() !== "")
        .map((line) => html`<p>${line}</p>`)}
      <div class="pictures">${view.pictures.value.map((picture) => html`<img src=${this.#url(picture)} alt=${msg("Picture of the task")} />`)}</div>
      ${task.goal ? html`<p class="goal">${goalWords(task.goal)}</p>` : nothing}
      ${task.goal?.type === "contours" ? contourPicture(view.contourMap.value, view.sizeM, task.goal.interval_m) : nothing}
      ${wrong === null ? nothing : html`<p class="wrong" role="alert">${wrong}</p>`}
    </section>`;
  }

  #url(picture: string): string {
    const known = this.#urls.get(picture) ?? pictureUrl(picture);
    this.#urls.set(picture, known);
    return known;
  }

  #score(): TemplateResult | typeof nothing {
    const score = this.score.value;
    if (!this.view.task.value?.goal) return nothing;
    const points = score?.points ?? null;
    return html`<section class="group" aria-label=${msg("Score")}>
      <div class="score" role="status">
        <span class="points">${points ?? "–"} <small>${msg("of 100")}</small></span>
        <span class="bar"><i style="width:${points ?? 0}%"></i></span>
        <span class="why">${score ? scoreWords(this.view.task.value.goal, score) : msg("It is counted when the ground has come to rest.")}</span>
      </div>
    </section>`;
  }

  #shown(task: Task): TemplateResult | typeof nothing {
    const { view } = this;
    const goal = task.goal;
    if (!goal) return nothing;
    const differs = view.target.value !== null && view.mayDiffer.value;
    const contours = goal.type === "contours" && view.target.value !== null;
    if (!differs && !contours && goal.type !== "profile") return nothing;
    return html`<section class="group" aria-label=${msg("What is shown")}>
      <div class="switches">
        ${differs ? toggle(msg("Red and blue"), msg("Red is too high, blue too low"), view.differs, (on) => view.differ(on)) : nothing}
        ${
          contours
            ? toggle(msg("Contours on the ground"), "", view.contours.value, (on) => {
                view.contours.value = on;
              })
            : nothing
        }
      </div>
      ${
        goal.type === "profile"
          ? html`<button class="btn outline" @click=${() => this.#measure([goal.first, goal.last])}>${icon("ruler")} ${msg("Show the profile")}</button>`
          : nothing
      }
    </section>`;
  }

  #measure(line: readonly (readonly [number, number])[]): void {
    this.ruler.clear();
    for (const [x, y] of line) this.ruler.add([x, y]);
    this.ruler.open("line");
  }
}

function toggle(label: string, about: string, on: boolean, change: (on: boolean) => void): TemplateResult {
  return html`<wa-switch size="small" title=${about} .checked=${live(on)} @change=${(e: Event) => change((e.target as HTMLInputElement).checked)}>${label}</wa-switch>`;
}

customElements.define("esk-task-panel", EskTaskPanel);
