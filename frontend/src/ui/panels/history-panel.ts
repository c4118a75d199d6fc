import { msg } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { effect } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { repeat } from "lit/directives/repeat.js";
import type { History } from "../../app/history/history.ts";
import { type HistoryEntry, keyOf } from "../../app/history/history.ts";
import type { HistoryView } from "../../app/history/history-view.ts";
import { historyWords } from "../../app/history/history-words.ts";
import type { TimeLapse } from "../../app/history/timelapse.ts";
import { ago } from "../../app/words/words.ts";
import { language, region } from "../../core/language.ts";
import type { Member } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { historyPanelStyles } from "../styles/history-panel.ts";
import { panelStyles } from "../styles/panel.ts";
import { shared } from "../styles/shared.ts";

const ICONS: Readonly<Record<string, string>> = {
  draw: "sketch",
  paint: "brush",
  move: "pen",
  reshape: "pen",
  edit: "settings",
  hide: "eye-slash",
  show: "eye",
  name: "pen",
  lock: "lock",
  unlock: "unlock",
  delete: "trash",
  restore: "rotate",
  settings: "sun",
  layer: "landscape",
  order: "layers",
  several: "layers",
};
/** How long ago something was is told anew this often. */
const TICK_MS = 30_000;

/** The activity log, newest first. A click shows the terrain as it was then. */
export class EskHistoryPanel extends SignalElement {
  static override properties = {
    history: { attribute: false },
    historyView: { attribute: false },
    timeLapse: { attribute: false },
    newest: { attribute: false },
    members: { attribute: false },
    client: { attribute: false },
  };
  static override styles = [shared, panelStyles, historyPanelStyles];

  declare history: History;
  declare historyView: Pick<HistoryView, "active" | "wanted" | "leave">;
  declare timeLapse: Pick<TimeLapse, "play" | "show">;
  /** Clock of the present. */
  declare newest: ReadonlySignal<number>;
  declare members: ReadonlySignal<readonly Member[]>;
  /** My client. */
  declare client: string;
  #stop: (() => void) | undefined;
  #clock: ReturnType<typeof setInterval> | undefined;

  override connectedCallback(): void {
    super.connectedCallback();
    this.#clock = setInterval(() => this.requestUpdate(), TICK_MS);
  }

  protected override firstUpdated(): void {
    this.#follow();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    clearInterval(this.#clock);
    this.#stop?.();
    this.history.stop();
  }

  #follow(): void {
    const { history, newest } = this;
    this.#stop = effect(() => history.follow(newest.value));
  }

  protected override render(): TemplateResult {
    const { history, historyView } = this;
    const entries = history.entries.value;
    const state = history.state.value;
    if (state === "failed" && entries.length === 0) return this.#failed();
    if (state === "waiting" && entries.length === 0)
      return html`<p class="lead" role="status">${msg("Reading the history…")}</p>`;
    if (entries.length === 0) return this.#empty();
    return html`
      ${this.#now(historyView.active.value)}
      <ol class="entries" aria-label=${msg("What people did, newest first")}>
        ${repeat(entries, keyOf, (entry) => this.#entry(entry))}
      </ol>
      ${
        history.more.value
          ? html`<button class="btn outline" @click=${() => void history.earlier()}>${msg("Show earlier")}</button>`
          : html`<p class="lead end">${history.first.value > 0 ? msg("The list begins here. The slider goes back to the beginning.") : msg("This is where the terrain began.")}</p>`
      }
    `;
  }

  #empty(): TemplateResult {
    return html`<div class="empty">
      ${icon("clock")}
      <p>${msg("Nothing has happened here yet. Everything that anybody draws, paints, changes or takes back will be listed here.")}</p>
      <p>${msg("A click on an entry shows the terrain as it was then. Nothing is ever lost.")}</p>
    </div>`;
  }

  #failed(): TemplateResult {
    return html`<div class="empty">
      ${icon("warning")}
      <p>${msg("The history could not be read.")}</p>
      <button class="btn outline" @click=${() => this.history.retry()}>${msg("Try again")}</button>
    </div>`;
  }

  #now(isHistory: boolean): TemplateResult {
    return html`<div class="ways">
      <button
        class="btn ${isHistory ? "outline" : "primary"}"
        @click=${() => (isHistory ? this.historyView.leave() : this.timeLapse.play())}
      >
        ${icon(isHistory ? "arrow-right" : "play")} ${isHistory ? msg("Back to now") : msg("Watch it come to be")}
      </button>
    </div>`;
  }

  #entry(entry: HistoryEntry): TemplateResult {
    const { history, historyView, client } = this;
    const shown = historyView.wanted.value;
    const chosen = shown !== null && shown === entry.last;
    const later = shown !== null && entry.first > shown;
    const name = entry.author === client ? msg("You") : history.nameOf(entry.author);
    const colour = this.#colour(entry.author);
    const when = entry.at === null ? "" : ago(Math.max(0, Date.now() - entry.at * 1000));
    return html`<li>
      <button
        class="btn item ${later ? "later" : ""}"
        aria-pressed=${chosen}
        title=${entry.at === null ? nothing : new Date(entry.at * 1000).toLocaleString(region())}
        @click=${() => this.timeLapse.show(entry.last)}
      >
        <span class="mark" style=${`--who:${colour}`}>${icon(entry.turn || (ICONS[entry.action] ?? "pen"))}</span>
        <span class="what"><b>${language() === "en" ? name : `${name}:`}</b> ${historyWords(entry)}</span>
        <span class="when">${when}</span>
      </button>
    </li>`;
  }

  /** People who are here have the colour of now; others the one that they had. */
  #colour(author: string): string {
    const { history, members } = this;
    const here = members.value.find((m) => m.client === author)?.colour;
    return here ?? (history.people.value.get(author)?.colour || "#8a8f98");
  }
}

customElements.define("esk-history-panel", EskHistoryPanel);
