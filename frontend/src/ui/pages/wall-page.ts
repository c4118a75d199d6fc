import { msg, str } from "@lit/localize";
import { effect, signal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { ApiError } from "../../app/server/api.ts";
import { type ClassInfo, ClassOrders, type Collecting } from "../../app/server/classes/class-api.ts";
import { arrange, copyName, type Sorting } from "../../app/server/classes/copies.ts";
import { WallConnection } from "../../app/server/classes/wall.ts";
import { terrainPath } from "../../app/server/links.ts";
import { MAX_COMPARED, type WallCopy } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import "../controls/segmented.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";
import { CardPainter, type CardState, cardWidth, wallCards } from "./wall-cards.ts";
import { emptyWall, openDoor } from "./wall-door.ts";
import { wallStyles } from "./wall-styles.ts";

const SORTS = [
  { value: "number", label: msg("As they came") },
  { value: "name", label: msg("By name") },
  { value: "last", label: msg("Drawn last") },
];
const BY_SCORE = { value: "score", label: msg("By score") };
const POLL_MS = 400;
const WORDS_MS = 15_000;

/** `/wall/terrain/class#secret`: every copy of a class, live, for its teacher and the projector. */
export class EskWall extends SignalElement {
  static override styles = [shared, wallStyles];
  static override properties = {
    sorting: { state: true },
    filter: { state: true },
    chosen: { state: true },
    comparing: { state: true },
    asking: { state: true },
    busy: { state: true },
    problem: { state: true },
    done: { state: true },
    qr: { state: true },
    collecting: { state: true },
  };

  terrain = "";
  secret = "";
  lesson = "";
  declare sorting: Sorting;
  declare filter: string;
  declare chosen: ReadonlySet<number>;
  declare comparing: readonly number[] | null;
  /** What is about to be done and is asked for once more. */
  declare asking: "delete" | "restart" | null;
  declare busy: boolean;
  declare problem: string;
  /** What was done, in words. */
  declare done: string;
  declare qr: boolean;
  declare collecting: Collecting | null;

  #wall: WallConnection | null = null;
  #orders: ClassOrders | null = null;
  readonly #tick = signal(0);
  #cards: CardPainter | null = null;
  #timer: ReturnType<typeof setInterval> | undefined;
  #stop: (() => void) | null = null;

  constructor() {
    super();
    this.sorting = "number";
    this.filter = "";
    this.chosen = new Set();
    this.comparing = null;
    this.asking = null;
    this.busy = false;
    this.problem = "";
    this.done = "";
    this.qr = true;
    this.collecting = null;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    document.title = msg("The wall · Esker");
    const { terrain, secret, lesson } = this;
    const scheme = window.location.protocol === "https:" ? "wss" : "ws";
    const wall = new WallConnection({
      terrain,
      secret,
      lesson,
      url: `${scheme}://${window.location.host}/ws/wall?terrain=${terrain}`,
    });
    this.#wall = wall;
    const cards = new CardPainter(this.renderRoot, wall);
    this.#cards = cards;
    this.#orders = new ClassOrders(terrain, secret, lesson);
    this.#timer = setInterval(() => {
      this.#tick.value += 1;
    }, WORDS_MS);
    this.#stop = effect(() => {
      if (wall.changed.value.size === 0) return;
      cards.changed(wall.take());
    });
    // For tests, which look at what was drawn.
    Object.assign(window, { __wall: wall });
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    clearInterval(this.#timer);
    this.#cards?.stop();
    this.#stop?.();
    this.#wall?.close();
  }

  protected override updated(): void {
    this.#cards?.rendered();
  }

  async #do(what: (orders: ClassOrders) => Promise<string>): Promise<void> {
    if (this.busy || this.#orders === null) return;
    this.busy = true;
    this.problem = this.done = "";
    this.asking = null;
    try {
      this.done = await what(this.#orders);
    } catch (error) {
      this.problem = error instanceof ApiError ? error.message : msg("Something went wrong. Try again.");
    } finally {
      this.busy = false;
    }
  }

  get #numbers(): number[] {
    const there = this.#wall?.copies.value ?? new Map<number, WallCopy>();
    return [...this.chosen].filter((n) => there.has(n)).sort((a, b) => a - b);
  }

  #toggle(number: number): void {
    const next = new Set(this.chosen);
    if (!next.delete(number)) next.add(number);
    this.chosen = next;
    this.asking = null;
  }

  /** Opens another page, which a browser allows only while the press is being handled. */
  #open(get: (orders: ClassOrders) => Promise<{ id: string; secret: string }>, words: string): Promise<void> {
    const page = window.open("about:blank", "_blank");
    return this.#do(async (orders) => {
      try {
        const { id, secret } = await get(orders);
        const path = terrainPath(id, secret);
        if (page) page.location.href = window.location.origin + path;
        else window.location.assign(path);
        return words;
      } catch (error) {
        page?.close();
        throw error;
      }
    });
  }

  #compare(numbers: readonly number[]): void {
    // The 3D view is loaded with the first comparison: a wall that only hangs there needs none.
    void import("./wall-compare.ts");
    this.comparing = numbers;
    this.#wall?.focus(numbers);
  }

  async #collect(): Promise<void> {
    await this.#do(async (orders) => {
      let job = await orders.collect();
      while (job.stage === "waiting" || job.stage === "collecting") {
        this.collecting = job;
        await new Promise((resolve) => setTimeout(resolve, POLL_MS));
        job = await orders.collected(job.id);
      }
      this.collecting = null;
      if (job.stage !== "done") throw new ApiError("failed", job.text || msg("The class could not be collected."));
      const url = URL.createObjectURL(await orders.file(job.id));
      const name = `${this.#wall?.state.peek()?.title || "class"}.zip`;
      Object.assign(document.createElement("a"), { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10_000);
      return msg("The class is collected: a file and a picture of each copy, and a table.");
    });
    this.collecting = null;
  }

  protected override render(): TemplateResult {
    const wall = this.#wall;
    if (wall === null) return html``;
    const state = wall.state.value;
    if (wall.over.value || state === null) return this.#closed(wall);
    void this.#tick.value;
    const copies = arrange([...wall.copies.value.values()], this.sorting, this.filter);
    return html`
      ${this.#head(state)} ${this.#toolbar(
        wall.copies.value.size,
        copies.some((copy) => (copy.score?.points ?? null) !== null),
      )}
      ${
        wall.copies.value.size === 0
          ? emptyWall(state.code)
          : wallCards(copies, cardWidth(wall.copies.value.size), (copy) => this.#cardState(copy, state.show))
      }
      ${this.#actions(state.show)}
      ${this.comparing === null ? nothing : this.#compared(this.comparing)}
    `;
  }

  #closed(wall: WallConnection): TemplateResult {
    const problem = wall.problem.value;
    return html`<div class="empty alone">
      <img src="/favicon.svg" alt="" width="52" height="52" />
      <p role="status">${problem ?? msg("Opening the wall…")}</p>
      <p class="problem" role="alert">${this.problem}</p>
      ${
        wall.over.value
          ? html`<button class="btn outline" @click=${() => this.#bringBack()}>${msg("Bring a deleted class back")}</button>
              <a class="btn" href=${terrainPath(this.terrain, this.secret)}>${msg("Go to the terrain")}</a>`
          : nothing
      }
    </div>`;
  }

  async #bringBack(): Promise<void> {
    await this.#do(async (orders) => {
      await orders.bringBack();
      window.location.reload();
      return "";
    });
  }

  #head(state: Pick<ClassInfo, "title" | "code" | "pupils">): TemplateResult {
    const here = [...(this.#wall?.copies.value.values() ?? [])].reduce((sum, copy) => sum + copy.online, 0);
    return html`<header>
      <div class="title">
        <h1>${state.title || msg("Untitled terrain")}</h1>
        <p class="quiet">${state.pupils === 0 ? msg("The wall of this class") : state.pupils === 1 ? msg(str`${here} of 1 device is here`) : msg(str`${here} of ${state.pupils} devices are here`)}</p>
      </div>
      ${
        state.code === null
          ? html`<button class="btn outline" ?disabled=${this.busy} @click=${() => this.#door(true)}>${icon("unlock")} ${msg("Let more people in")}</button>`
          : state.pupils === 0
            ? nothing
            : openDoor({
                code: state.code,
                busy: this.busy,
                hasPicture: this.qr,
                onClose: () => void this.#door(false),
              })
      }
    </header>`;
  }

  #door(open: boolean): Promise<void> {
    return this.#do(async (orders) => {
      await orders.door(open);
      return open ? "" : msg("The door is closed. Who is in stays in.");
    });
  }

  #toolbar(count: number, isScored: boolean): TemplateResult {
    const problem = this.#wall?.problem.value ?? "";
    return html`
      <div class="tools">
        <esk-segmented
          label=${msg("Order")}
          .segments=${isScored ? [...SORTS, BY_SCORE] : SORTS}
          .value=${this.sorting}
          @pick=${(e: CustomEvent<Sorting>) => {
            this.sorting = e.detail;
          }}
        ></esk-segmented>
        <input
          class="field"
          type="search"
          placeholder=${msg("Find a name")}
          aria-label=${msg("Find a name")}
          .value=${this.filter}
          @input=${(e: Event) => {
            this.filter = (e.target as HTMLInputElement).value;
          }}
        />
        <span class="grow"></span>
        <button class="btn outline" ?disabled=${this.busy || count === 0} @click=${() => this.#push()}>
          ${icon("share")} ${msg("Send my additions")}
        </button>
        <button class="btn outline" ?disabled=${this.busy || count === 0} @click=${() => this.#collect()}>
          ${icon("download")} ${this.collecting ? msg(str`Collecting, ${Math.round(100 * this.collecting.share)} %`) : msg("Collect")}
        </button>
        <button
          class="btn outline"
          ?disabled=${this.busy}
          @click=${() => {
            this.asking = "delete";
          }}
        >
          ${icon("trash")} ${msg("Delete this class")}
        </button>
      </div>
      ${problem || this.problem ? html`<p class="notice problem" role="alert">${this.problem || problem}</p>` : nothing}
      ${this.done ? html`<p class="notice" role="status">${this.done}</p>` : nothing}
      ${this.asking === "delete" ? this.#confirmDelete(count) : nothing}
    `;
  }

  #push(): Promise<void> {
    return this.#do(async (orders) => {
      const { changed } = await orders.push();
      if (changed === 0) return msg("There is nothing new in your terrain.");
      return changed === 1
        ? msg("Your additions are in one copy. What pupils changed stayed as they have it.")
        : msg(str`Your additions are in ${changed} copies. What pupils changed stayed as they have it.`);
    });
  }

  #confirmDelete(count: number): TemplateResult {
    return html`<div class="notice" role="alertdialog" aria-label=${msg("Delete this class")}>
      <span>${count === 1 ? msg("Delete this class with its copy, all names and links? Within a week it can be brought back; at once, never.") : msg(str`Delete this class with its ${count} copies, all names and links? Within a week it can be brought back; at once, never.`)}</span>
      <button class="btn danger" @click=${() => this.#delete(false)}>${msg("Delete")}</button>
      <button class="btn danger" @click=${() => this.#delete(true)}>${msg("Delete at once")}</button>
      <button class="btn outline" @click=${this.#neverMind}>${msg("Keep it")}</button>
    </div>`;
  }

  readonly #neverMind = (): void => {
    this.asking = null;
  };

  #delete(atOnce: boolean): Promise<void> {
    return this.#do(async (orders) => {
      await orders.delete(atOnce);
      return "";
    });
  }

  #cardState({ number }: WallCopy, shown: number | null): CardState {
    return {
      isShown: shown === number,
      isChosen: this.chosen.has(number),
      onPress: () => this.#toggle(number),
    };
  }

  #actions(shown: number | null): TemplateResult | typeof nothing {
    const numbers = this.#numbers;
    if (numbers.length === 0 && shown === null) return nothing;
    const copies = this.#wall?.copies.value;
    const frozen = numbers.length > 0 && numbers.every((n) => copies?.get(n)?.frozen);
    const [one] = numbers;
    const single = numbers.length === 1 && one !== undefined;
    const button = (words: string, name: string, on: () => unknown, able = true): TemplateResult =>
      html`<button class="btn outline" ?disabled=${this.busy || !able} @click=${on}>${icon(name)} ${words}</button>`;
    return html`<footer>
      ${
        shown === null
          ? nothing
          : html`<button class="btn primary" ?disabled=${this.busy} @click=${() => this.#show(null)}>${icon("eye-slash")} ${msg("Stop showing")}</button>`
      }
      ${
        numbers.length === 0
          ? nothing
          : html`<span class="count">${numbers.length === 1 ? copyName(copies!.get(one!)!) : msg(str`${numbers.length} copies`)}</span>
              ${button(msg("Open"), "arrow-right", () => single && this.#open((o) => o.open(one), ""), single)}
              ${button(msg("Show to all"), "eye", () => single && this.#show(one), single)}
              ${button(msg("Compare"), "swap", () => this.#compare(numbers), numbers.length === MAX_COMPARED)}
              ${button(msg("Put together"), "layers", () => this.#open((o) => o.together(numbers), msg("The new terrain is open in a page of its own.")), numbers.length > 1)}
              ${button(frozen ? msg("Let them go on") : msg("Freeze"), frozen ? "unlock" : "lock", () => this.#freeze(numbers, !frozen))}
              ${
                this.asking === "restart"
                  ? html`<button class="btn danger" @click=${() => this.#restart(numbers)}>${msg("Yes, start again")}</button>
                      <button class="btn outline" @click=${this.#neverMind}>${msg("No")}</button>`
                  : button(msg("Start again"), "rotate", () => {
                      this.asking = "restart";
                    })
              }
              <button
                class="btn"
                @click=${() => {
                  this.chosen = new Set();
                }}
              >
                ${msg("Choose none")}
              </button>`
      }
      ${
        numbers.length > 0 && copies && numbers.length < copies.size
          ? html`<button
              class="btn"
              @click=${() => {
                this.chosen = new Set(copies.keys());
              }}
            >
              ${msg("Choose all")}
            </button>`
          : nothing
      }
    </footer>`;
  }

  #show(number: number | null): Promise<void> {
    return this.#do(async (orders) => {
      await orders.show(number);
      return "";
    });
  }

  #freeze(numbers: readonly number[], frozen: boolean): Promise<void> {
    return this.#do(async (orders) => {
      await orders.freeze(frozen, numbers);
      return "";
    });
  }

  #restart(numbers: readonly number[]): Promise<void> {
    return this.#do(async (orders) => {
      const { changed } = await orders.restart(numbers);
      return changed === 0
        ? msg("They were as they began already.")
        : msg("They are as they were at the beginning. What was drawn stays in their history.");
    });
  }

  #compared(numbers: readonly number[]): TemplateResult {
    return html`<esk-wall-compare
      .wall=${this.#wall}
      .numbers=${numbers}
      @close=${() => {
        this.comparing = null;
        this.#wall?.focus([]);
        this.requestUpdate();
      }}
    ></esk-wall-compare>`;
  }
}

customElements.define("esk-wall", EskWall);

/** The page, to be put into the document. */
export function wallPage(terrain: string, lesson: string, secret: string): HTMLElement {
  const page = document.createElement("esk-wall") as EskWall;
  Object.assign(page, { terrain, lesson, secret });
  return page;
}
