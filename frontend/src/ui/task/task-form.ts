import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import { signal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import { TaskDraft } from "../../app/lesson/task/draft.ts";
import { pictureUrl } from "../../app/lesson/task/pictures.ts";
import { scoredGround } from "../../app/lesson/task/snapshot.ts";
import type { TaskView } from "../../app/lesson/task/task-view.ts";
import { GOALS, type GoalType } from "../../app/lesson/task/words.ts";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import {
  MAX_AMOUNT,
  MAX_GRADE,
  MAX_NAME_LENGTH,
  MAX_TASK_LINE,
  MAX_TASK_PICTURES,
  MAX_TASK_TEXT,
  MIN_AMOUNT,
  MIN_TOLERANCE_M,
} from "../../generated/contract.ts";
import type { Ruler } from "../../input/tools/ruler.ts";
import type { TileStore } from "../../tiles/store.ts";
import { icon } from "../controls/icons.ts";
import "../controls/number-field.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { panelStyles } from "../styles/panel.ts";
import { shared } from "../styles/shared.ts";
import { taskStyles } from "./styles.ts";

const KM2 = 1e6;
const CHOICES = {
  line: { take: msg("Take this line"), choose: msg("Choose the line"), another: msg("Choose another line") },
  path: { take: msg("Take this path"), choose: msg("Choose the path"), another: msg("Choose another path") },
  point: { take: msg("Take this point"), choose: msg("Choose the point"), another: msg("Choose another point") },
} as const;
const PLACES: Readonly<
  Partial<Record<GoalType, { readonly what: keyof typeof CHOICES; readonly least: number; readonly most: number }>>
> = {
  profile: { what: "line", least: 2, most: 2 },
  slope: { what: "path", least: 2, most: MAX_TASK_LINE },
  volume: { what: "point", least: 1, most: 1 },
  watershed: { what: "point", least: 1, most: 1 },
};

/** Writing a task, without code. Fires `done`. */
export class EskTaskForm extends SignalElement {
  static override properties = {
    view: { attribute: false },
    ruler: { attribute: false },
    tiles: { attribute: false },
    edits: { attribute: false },
  };
  static override styles = [shared, panelStyles, taskStyles];

  declare view: TaskView;
  declare ruler: Ruler;
  declare tiles: TileStore;
  declare edits: Pick<OpenTerrain, "newGesture" | "setTerrain">;
  readonly #draft = signal<TaskDraft | null>(null);
  readonly #choosing = signal(false);

  override connectedCallback(): void {
    super.connectedCallback();
    this.#draft.value ??= new TaskDraft(this.view.task.peek(), this.view.pictures.peek(), this.view.sizeM);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    if (this.#choosing.peek()) this.ruler.close();
  }

  protected override render(): TemplateResult | typeof nothing {
    const draft = this.#draft.value;
    if (draft === null) return nothing;
    return html`
      <section class="group">${this.#words(draft)}</section>
      <section class="group">${this.#goal(draft)}</section>
      <section class="group">
        ${draft.wrong.value === null ? nothing : html`<p class="wrong" role="alert">${draft.wrong.value}</p>`}
        <div class="buttons">
          <button class="btn primary" @click=${() => this.#set(draft)}>${icon("check")} ${msg("Set the task")}</button>
          <button class="btn outline" @click=${() => this.#done()}>${msg("Cancel")}</button>
        </div>
        <div class="buttons">
          <button class="btn quiet" @click=${() => this.#save(draft)}>${icon("download")} ${msg("Save as a file")}</button>
          <button class="btn quiet" @click=${() => this.renderRoot.querySelector<HTMLInputElement>("#open")?.click()}>${icon("upload")} ${msg("Open a file")}</button>
          ${this.view.task.value === null ? nothing : html`<button class="btn quiet" @click=${() => this.#remove()}>${icon("trash")} ${msg("No task")}</button>`}
        </div>
        <input id="open" class="visually-hidden" type="file" accept=".eskertask,application/json" tabindex="-1" aria-hidden="true" @change=${(e: Event) => void this.#open(draft, e)} />
      </section>
    `;
  }

  #words(draft: TaskDraft): TemplateResult {
    return html`
      <h3>${msg("What is asked")}</h3>
      <label class="field-label">${msg("Title")}
        <input class="field" name="title" maxlength=${MAX_NAME_LENGTH} .value=${live(draft.title.value)} @input=${(
          e: Event,
        ) => {
          draft.title.value = (e.target as HTMLInputElement).value;
        }} @keydown=${keep} />
      </label>
      <label class="field-label">${msg("Text")}
        <textarea class="field" name="text" maxlength=${MAX_TASK_TEXT} .value=${live(draft.text.value)} @input=${(
          e: Event,
        ) => {
          draft.text.value = (e.target as HTMLTextAreaElement).value;
        }} @keydown=${keep}></textarea>
      </label>
      ${draft.pictures.value.map(
        (picture, i) => html`<div class="thumb"><img src=${pictureUrl(picture)} alt=${msg(str`Picture ${i + 1}`)} />
          <button class="btn quiet" @click=${() => draft.dropPicture(i)}>${msg("Take it out")}</button></div>`,
      )}
      ${
        draft.pictures.value.length < MAX_TASK_PICTURES
          ? html`<label class="btn outline">${icon("plus")} ${msg("A picture")}
              <input class="visually-hidden" type="file" accept="image/*" @change=${(e: Event) => {
                const field = e.target as HTMLInputElement;
                const file = field.files?.[0];
                if (file) void draft.addPicture(file);
                field.value = "";
              }} /></label>`
          : nothing
      }
    `;
  }

  #goal(draft: TaskDraft): TemplateResult {
    const kind = draft.kind.value;
    return html`
      <h3>${msg("The goal")}</h3>
      <label class="field-label">${msg("Goal")}
        <select class="field" name="goal" @change=${(e: Event) => {
          draft.kind.value = (e.target as HTMLSelectElement).value as GoalType;
        }}>
          ${GOALS.map((goal) => html`<option value=${goal.value} ?selected=${goal.value === kind}>${goal.label}</option>`)}
        </select>
      </label>
      <p class="lead">${GOALS.find((goal) => goal.value === kind)?.about}</p>
      ${this.#places(draft)} ${this.#numbers(draft)} ${this.#take(draft)}
    `;
  }

  #places(draft: TaskDraft): TemplateResult | typeof nothing {
    const wanted = PLACES[draft.kind.value];
    if (wanted === undefined) return nothing;
    const { what, least, most } = wanted;
    const chosen = this.ruler.points.value.length;
    if (this.#choosing.value)
      return html`<div class="note">${least === 1 ? msg("Set a point on the ground: click, tap, or use the arrow keys and Enter.") : msg("Set points on the ground: click, tap, or use the arrow keys and Enter.")}</div>
        <button class="btn primary" ?disabled=${chosen < least} @click=${() => this.#chosen(draft, most)}>${icon("check")} ${CHOICES[what].take}</button>`;
    const known = draft.places.value;
    return html`<button class="btn outline" @click=${() => this.#choose()}>${icon("ruler")} ${known.length < least ? CHOICES[what].choose : CHOICES[what].another}</button>
      ${known.length < least ? nothing : html`<p class="lead">${known.length === 1 ? msg(str`At ${known[0]!.map(Math.round).join(", ")} m.`) : msg(str`${known.length} points, from ${known[0]!.map(Math.round).join(", ")} m to ${known.at(-1)!.map(Math.round).join(", ")} m.`)}</p>`}`;
  }

  #choose(): void {
    this.ruler.clear();
    this.ruler.open("line");
    this.#choosing.value = true;
  }

  #chosen(draft: TaskDraft, most: number): void {
    const points = this.ruler.points.peek();
    draft.choose(most === 2 && points.length > 2 ? [points[0]!, points.at(-1)!] : points.slice(0, most));
    this.#choosing.value = false;
    this.ruler.close();
  }

  #numbers(draft: TaskDraft): TemplateResult | typeof nothing {
    const kind = draft.kind.value;
    const n = draft.numbers.value;
    const size = this.view.sizeM;
    if (kind === "none") return nothing;
    const tolerance = number(msg("Counts whole within"), "m", n.toleranceM, MIN_TOLERANCE_M, size, (toleranceM) =>
      draft.set({ toleranceM }),
    );
    const level = number(msg("Level"), "m", n.levelM, -10 * size, 10 * size, (levelM) => draft.set({ levelM }));
    const area = number(msg("At least"), "km²", n.amount / KM2, MIN_AMOUNT / KM2, MAX_AMOUNT / KM2, (v) =>
      draft.set({ amount: v * KM2 }),
    );
    if (kind === "terrain" || kind === "profile")
      return html`<div class="two">${tolerance}</div>${this.#differs(draft)}`;
    if (kind === "contours")
      return html`<div class="two">${tolerance} ${number(msg("Contours every"), "m", n.intervalM, MIN_TOLERANCE_M, size, (intervalM) => draft.set({ intervalM }))}</div>${this.#differs(draft)}`;
    if (kind === "volume")
      return html`<div class="two">${number(msg("At least"), msg("million m³"), n.amount / 1e6, 1e-6, MAX_AMOUNT / 1e6, (v) => draft.set({ amount: v * 1e6 }))} ${number(msg("No higher than"), "m", n.levelM, -10 * size, 10 * size, (levelM) => draft.set({ levelM }))}</div>`;
    if (kind === "slope")
      return html`<div class="two">${number(msg("At most"), "%", 100 * n.grade, 0.1, 100 * MAX_GRADE, (v) => draft.set({ grade: v / 100 }))}</div>`;
    if (kind === "watershed") return html`<div class="two">${area}</div>`;
    return html`<div class="two">${area} ${level}</div>
      <wa-switch size="small" .checked=${live(n.dry)} @change=${(e: Event) => draft.set({ dry: (e.target as HTMLInputElement).checked })}>${msg("Land behind dykes counts")}</wa-switch>`;
  }

  #differs(draft: TaskDraft): TemplateResult {
    return html`<wa-switch size="small" .checked=${live(draft.difference.value)} @change=${(e: Event) => {
      draft.difference.value = (e.target as HTMLInputElement).checked;
    }}>${msg("Pupils may see red and blue")}</wa-switch>`;
  }

  #take(draft: TaskDraft): TemplateResult | typeof nothing {
    const kind = draft.kind.value;
    if (kind !== "terrain" && kind !== "contours" && kind !== "profile") return nothing;
    const taken = draft.taken;
    const use =
      kind === "profile" ? msg("Use the ground on this line as the profile") : msg("Use this terrain as the target");
    return html`<button class="btn ${taken ? "outline" : "primary"}" name="take" @click=${() => void draft.take(() => scoredGround(this.tiles.freeze(), this.tiles.solved))}>
        ${icon("landscape")} ${taken ? msg("Use it anew, as it is now") : use}
      </button>
      <p class="lead">${taken ? msg("Taken. Now bring the ground to where pupils shall begin: undo or delete, then set the task.") : msg("What the ground is at this moment is what is asked for. Your lines are not in the task.")}</p>`;
  }

  #set(draft: TaskDraft): void {
    const task = draft.finish();
    if (task === null) return;
    const gesture = this.edits.newGesture();
    const pictures = draft.pictures.peek();
    if (!this.edits.setTerrain({ task }, gesture)) return;
    if (pictures.join() !== this.view.pictures.peek().join())
      this.edits.setTerrain({ task_pictures: [...pictures] }, gesture);
    this.#done();
  }

  #remove(): void {
    const gesture = this.edits.newGesture();
    this.edits.setTerrain({ task: null }, gesture);
    if (this.view.pictures.peek().length > 0) this.edits.setTerrain({ task_pictures: [] }, gesture);
    this.#done();
  }

  #done(): void {
    this.dispatchEvent(new CustomEvent("done"));
  }

  #save(draft: TaskDraft): void {
    const text = draft.file();
    if (text === null) return;
    const url = URL.createObjectURL(new Blob([text], { type: "application/json" }));
    const name =
      draft.title
        .peek()
        .replace(/[^\p{L}\p{N}]+/gu, "-")
        .replace(/^-|-$/g, "")
        .toLowerCase() || "task";
    Object.assign(document.createElement("a"), { href: url, download: `${name}.eskertask` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  }

  async #open(draft: TaskDraft, event: Event): Promise<void> {
    const field = event.target as HTMLInputElement;
    const file = field.files?.[0];
    field.value = "";
    if (file) draft.open(await file.text());
  }
}

/** Keys that are typed here are not the picture's. */
function keep(event: KeyboardEvent): void {
  if (event.key !== "Escape") event.stopPropagation();
}

function number(
  label: string,
  unit: string,
  value: number,
  min: number,
  max: number,
  change: (value: number) => void,
): TemplateResult {
  return html`<esk-number label=${label} unit=${unit} .value=${value} .min=${min} .max=${max} .digits=${4} @number=${(e: CustomEvent<number>) => change(e.detail)}></esk-number>`;
}

customElements.define("esk-task-form", EskTaskForm);
