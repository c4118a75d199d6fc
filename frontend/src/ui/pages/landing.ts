import { msg, str } from "@lit/localize";
import { html, LitElement, nothing, svg, type TemplateResult } from "lit";
import { ApiError, api, type LessonInfo, type OpenedTerrain } from "../../app/server/api.ts";
import type { TemplateInfo } from "../../core/types.ts";
import { type ImportStatus, MAX_GRID_BYTES } from "../../generated/contract.ts";
import "../controls/drop-zone.ts";
import { keepImport, keepStarted, type StartedImport, started } from "../../app/device/kept-imports.ts";
import {
  deviceId,
  deviceStore,
  forgetTerrain,
  type RecentTerrain,
  recentTerrains,
  serverKey,
} from "../../app/device/storage.ts";
import { chooseTheme, themeChoice } from "../../app/device/theme.ts";
import { readJoinInput, terrainPath } from "../../app/server/links.ts";
import { upload } from "../../app/server/upload.ts";
import { galleryWords } from "../../app/words/gallery.ts";
import { ago } from "../../app/words/words.ts";
import { icon } from "../controls/icons.ts";
import { languageChoice } from "../controls/language-choice.ts";
import { landingStyles } from "../styles/landing.ts";
import { shared } from "../styles/shared.ts";
import { type Layer, penRidge, ridgeLayers, seedOf } from "./ridges.ts";

/** `/`: what Esker is, a new terrain, joining, what this device opened lately, the starting terrains. */
export class EskLanding extends LitElement {
  static override styles = [shared, landingStyles];
  static override properties = {
    templates: { state: true },
    lessons: { state: true },
    recents: { state: true },
    busy: { state: true },
    problem: { state: true },
    templateProblem: { state: true },
    sent: { state: true },
    waiting: { state: true },
  };

  declare templates: readonly TemplateInfo[] | null;
  declare lessons: readonly LessonInfo[];
  declare recents: readonly RecentTerrain[];
  declare busy: string;
  declare problem: string;
  declare templateProblem: string;
  /** Share of a dropped file that has been sent. */
  declare sent: number;
  /** A file of this device that the server still works on, so that it takes no other one. */
  declare waiting: StartedImport | null;

  readonly #store = deviceStore();
  #abort: AbortController | null = null;

  constructor() {
    super();
    this.templates = null;
    this.lessons = [];
    this.recents = recentTerrains(this.#store);
    this.busy = "";
    this.problem = "";
    this.templateProblem = "";
    this.sent = 0;
    this.waiting = null;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    document.title = "Esker";
    window.addEventListener("pageshow", this.#shown);
    void this.#loadTemplates();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#abort?.abort();
    window.removeEventListener("pageshow", this.#shown);
  }

  /** Back from a terrain: the browser may show this page as it was left, busy and with an old list. */
  readonly #shown = (): void => {
    this.busy = "";
    this.recents = recentTerrains(this.#store);
  };

  /** A terrain to open again, or a file with heights: then a new terrain of its size. */
  #take(file: File): void {
    if (/\.esker$/i.test(file.name)) void this.#open("file", () => api.open(file));
    else void this.#open("grid", () => this.#fromGrid(file));
  }

  async #fromGrid(file: File): Promise<OpenedTerrain> {
    if (file.size > MAX_GRID_BYTES)
      throw new ApiError(
        "too_large",
        msg(str`“${file.name}” is larger than ${MAX_GRID_BYTES >> 20} MB. Cut it, or make it coarser.`),
      );
    this.#abort = new AbortController();
    this.sent = 0;
    this.waiting = null;
    const made = await upload<OpenedTerrain & { import: ImportStatus }>({
      path: `/api/terrains/from-grid?name=${encodeURIComponent(file.name)}&client=${deviceId(this.#store)}`,
      file,
      onShare: (share) => {
        this.sent = share;
      },
      signal: this.#abort.signal,
    });
    keepImport(made.id, { id: made.import.id, file: file.name });
    keepStarted(this.#store, { terrain: made.id, secret: made.secret, job: made.import.id, file: file.name });
    return made;
  }

  async #loadTemplates(): Promise<void> {
    try {
      this.templates = await api.templates();
    } catch (error) {
      this.templates = [];
      this.templateProblem = sentence(error);
    }
    // Where the terrains came and these do not, the page goes without.
    this.lessons = await api.lessons().catch(() => []);
  }

  async #open(what: string, get: () => Promise<OpenedTerrain>): Promise<void> {
    if (this.busy) return;
    this.busy = what;
    this.problem = "";
    try {
      const terrain = await get();
      window.location.assign(terrainPath(terrain.id, terrain.secret));
    } catch (error) {
      const cancelled = error instanceof ApiError && error.code === "cancelled";
      this.problem = cancelled ? "" : sentence(error);
      if (what === "grid" && error instanceof ApiError && error.code === "busy") this.waiting = started(this.#store);
      this.busy = "";
    }
  }

  /** Gives up the file that another page of this device brought in. */
  async #giveUp(waiting: StartedImport): Promise<void> {
    this.waiting = null;
    this.problem = "";
    try {
      await api.cancelImport(waiting.terrain, waiting.secret, waiting.job);
      keepStarted(this.#store, null);
    } catch (error) {
      this.problem = sentence(error);
    }
  }

  #join(event: SubmitEvent): void {
    event.preventDefault();
    const field = this.renderRoot.querySelector<HTMLInputElement>("#join");
    const input = readJoinInput(field?.value ?? "", window.location.origin);
    if (input.kind === "unreadable") {
      this.problem = input.message;
      field?.focus();
    } else if (input.kind === "link") {
      window.location.assign(terrainPath(input.id, input.secret));
    } else {
      void this.#code(input.code);
    }
  }

  /** A class asks for a name first, on a page of its own. */
  async #code(code: string): Promise<void> {
    if (this.busy) return;
    this.busy = "join";
    this.problem = "";
    try {
      const opened = await api.join(code);
      window.location.assign("secret" in opened ? terrainPath(opened.id, opened.secret) : `/join#${code}`);
    } catch (error) {
      this.problem = sentence(error);
      this.busy = "";
    }
  }

  #openFile(event: Event): void {
    const field = event.target as HTMLInputElement;
    const file = field.files?.[0];
    field.value = "";
    if (file) this.#take(file);
  }

  #forget(id: string): void {
    forgetTerrain(this.#store, id);
    this.recents = recentTerrains(this.#store);
  }

  protected override render(): TemplateResult {
    return html`
      ${this.#hero()}
      <main>
        ${this.recents.length > 0 ? this.#recentSection() : nothing} ${this.#templateSection()} ${this.#lessonSection()}
      </main>
      <esk-drop-zone
        lead=${msg("Drop it: a new terrain")}
        detail=${msg("A file with heights becomes a terrain of its size and place. An .esker file opens as it was.")}
        @files=${(e: CustomEvent<File[]>) => e.detail[0] && this.#take(e.detail[0])}
      ></esk-drop-zone>
      <footer>
        <span>${msg("A terrain is its strokes: nothing is ever baked.")}</span>
        <span>${msg("Everything stays on this server. No account, no tracking.")}</span>
        <a href="/privacy">${msg("What is known of people")}</a>
        <a href="/licences.txt">${msg("Licences and sources")}</a>
        ${languageChoice()}
      </footer>
    `;
  }

  #hero(): TemplateResult {
    return html`
      <header class="hero">
        ${heroPicture()}
        <nav>
          <span class="brand"><img src="/favicon.svg" alt="" width="28" height="28" />Esker</span>
          <button class="icon-btn" aria-label=${msg("Switch between dark and light")} @click=${toggleTheme}>
            ${icon("moon")}
          </button>
        </nav>
        <div class="pitch">
          <h1>${msg("Sketch a landscape together.")}</h1>
          <p>${msg("Draw a line across the land and the ground rises to meet it, for everybody who has the link.")}</p>
          <div class="start">
            <button class="btn primary big" ?disabled=${this.busy !== ""} @click=${() => this.#open("new", () => api.create())}>
              ${icon("plus")} ${this.busy === "new" ? msg("Making a terrain…") : msg("New terrain")}
            </button>
            <form class="join" @submit=${this.#join}>
              <label class="visually-hidden" for="join">${msg("Join code or link")}</label>
              <input
                id="join"
                class="field"
                placeholder=${msg("Join code or link")}
                autocomplete="off"
                autocapitalize="characters"
                spellcheck="false"
                aria-describedby="problem"
                @input=${() => {
                  this.problem = "";
                }}
              />
              <button class="btn solid" ?disabled=${this.busy !== ""}>${this.busy === "join" ? msg("Joining…") : msg("Join")}</button>
            </form>
          </div>
          <p id="problem" class="problem" role="alert">${this.problem}${this.waiting ? this.#waiting(this.waiting) : nothing}</p>
          <label class="file">
            ${icon("upload")} <span>${this.#fileWords()}</span>
            <input class="visually-hidden" type="file" ?disabled=${this.busy !== ""} @change=${this.#openFile} />
          </label>
          ${this.busy === "grid" ? html`<button class="btn outline" @click=${() => this.#abort?.abort()}>${msg("Cancel")}</button>` : nothing}
          ${serverKey(this.#store) ? html`<a class="kept" href=${`/server#${serverKey(this.#store)}`}>${msg("All terrains of this server")}</a>` : nothing}
        </div>
      </header>
    `;
  }

  #waiting(waiting: StartedImport): TemplateResult {
    return html` <span>${msg(str`It is ${waiting.file}.`)}</span>
      <button class="btn outline" @click=${() => window.location.assign(terrainPath(waiting.terrain, waiting.secret))}>${msg("Go there")}</button>
      <button class="btn outline" @click=${() => this.#giveUp(waiting)}>${msg("Cancel it")}</button>`;
  }

  #fileWords(): string {
    if (this.busy === "file") return msg("Opening the file…");
    if (this.busy !== "grid") return msg("Open a file: real ground (GeoTIFF, HGT, ASC, PNG…) or .esker");
    return this.sent < 1 ? msg(str`Uploading, ${Math.round(100 * this.sent)} %`) : msg("Looking at the file…");
  }

  #recentSection(): TemplateResult {
    return html`
      <section aria-labelledby="recent-title">
        <h2 id="recent-title">${msg("Recent on this device")}</h2>
        <ul class="recents">
          ${this.recents.map(
            (r) => html`
              <li>
                <a class="recent" href=${terrainPath(r.id, r.secret)}>
                  <span class="thumb">${ridgePicture(r.id)}</span>
                  <span class="words">
                    <strong>${r.title || msg("Untitled terrain")}</strong>
                    <span class="quiet">${ROLE_WORDS[r.role]} · ${ago(Date.now() - r.opened)}</span>
                  </span>
                </a>
                <button
                  class="icon-btn small"
                  title=${msg("Remove from this list")}
                  aria-label=${msg(str`Remove ${r.title || msg("Untitled terrain")} from this list`)}
                  @click=${() => this.#forget(r.id)}
                >
                  ${icon("xmark")}
                </button>
              </li>
            `,
          )}
        </ul>
      </section>
    `;
  }

  #templateSection(): TemplateResult | typeof nothing {
    if (this.templates !== null && this.templates.length === 0 && !this.templateProblem) return nothing;
    return html`
      <section aria-labelledby="templates-title">
        <h2 id="templates-title">${msg("Start from a terrain")}</h2>
        ${this.templateProblem ? html`<p class="quiet">${this.templateProblem}</p>` : nothing}
        <ul class="cards">
          ${
            this.templates === null
              ? [0, 1, 2, 3, 4].map(() => html`<li class="card ghost" aria-hidden="true"></li>`)
              : this.templates.map((t) => this.#card(t))
          }
        </ul>
      </section>
    `;
  }

  #lessonSection(): TemplateResult | typeof nothing {
    if (this.lessons.length === 0) return nothing;
    return html`
      <section aria-labelledby="lessons-title">
        <h2 id="lessons-title">${msg("Start a lesson")}</h2>
        <ul class="cards">
          ${this.lessons.map((lesson) =>
            this.#card(
              lesson,
              html`<a class="plan" href=${`/lessons/${lesson.id}`}>${msg(str`For teachers: ${lesson.minutes} minutes, steps, questions`)}</a>`,
            ),
          )}
        </ul>
      </section>
    `;
  }

  #card(template: TemplateInfo, more: TemplateResult | typeof nothing = nothing): TemplateResult {
    const busy = this.busy === template.id;
    const { title, description } = galleryWords(template);
    return html`
      <li>
        <button
          class="card"
          ?disabled=${this.busy !== ""}
          @click=${() => this.#open(template.id, () => api.create(template.id))}
        >
          <span class="picture">
            ${ridgePicture(template.id)}
            <img src=${`/templates/${template.id}.webp`} alt="" loading="lazy" @error=${hideImage} />
          </span>
          <strong>${busy ? msg("Making a copy…") : title}</strong>
          <span class="quiet">${description}</span>
        </button>
        ${more}
      </li>
    `;
  }
}

const ROLE_WORDS = { owner: msg("Yours"), edit: msg("You can draw"), view: msg("View only") } as const;

function sentence(error: unknown): string {
  return error instanceof ApiError ? error.message : msg("Something went wrong. Reload the page and try again.");
}

function hideImage(event: Event): void {
  (event.target as HTMLImageElement).hidden = true;
}

function toggleTheme(): void {
  const dark = document.documentElement.classList.contains("wa-dark");
  chooseTheme(themeChoice.value === "system" ? (dark ? "light" : "dark") : dark ? "light" : "dark");
}

function heroPicture(): TemplateResult {
  const [width, height] = [1600, 640];
  const layers = ridgeLayers(23, 5, width, height, 0.6);
  const pen = penRidge(5, width, height, 500, 905, 1545);
  const draw = (l: Layer): TemplateResult =>
    svg`<path class="ridge" style=${`--depth:${l.depth.toFixed(2)}`} d=${l.path} />` as unknown as TemplateResult;
  return html`
    <svg class="scene" viewBox="0 0 ${width} ${height}" preserveAspectRatio="xMaxYMax slice" aria-hidden="true">
      ${svg`<circle class="disc" cx="1215" cy="205" r="58" />`}
      ${layers.slice(0, 2).map(draw)}
      ${svg`
        <path class="ridge" style="--depth:0.42" d=${pen.land} />
        <path class="stroke" d=${pen.line} pathLength="100" />
        <circle class="knob" cx=${pen.start[0]} cy=${pen.start[1]} r="6.5" />
        <circle class="knob last" cx=${pen.end[0]} cy=${pen.end[1]} r="6.5" />
      `}
      ${layers.slice(3).map(draw)}
    </svg>
  `;
}

function ridgePicture(id: string): TemplateResult {
  return html`
    <svg viewBox="0 0 320 180" preserveAspectRatio="xMidYMax slice" aria-hidden="true">
      ${ridgeLayers(seedOf(id), 4, 320, 180).map(
        (l) => svg`<path class="ridge" style=${`--depth:${l.depth.toFixed(2)}`} d=${l.path} />`,
      )}
    </svg>
  `;
}

customElements.define("esk-landing", EskLanding);
