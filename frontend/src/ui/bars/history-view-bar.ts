import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import type { History } from "../../app/history/history.ts";
import { entryAt } from "../../app/history/history.ts";
import type { HistoryView } from "../../app/history/history-view.ts";
import { historyWords } from "../../app/history/history-words.ts";
import { SPEEDS } from "../../app/history/pace.ts";
import type { TimeLapse } from "../../app/history/timelapse.ts";
import { ago } from "../../app/words/words.ts";
import { whoDid } from "../../core/language.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { historyViewBarStyles } from "../styles/history-view-bar.ts";
import { shared } from "../styles/shared.ts";

/** While the past is shown: what one sees, the slider and the time lapse, a copy, and the way back. */
export class EskHistoryViewBar extends SignalElement {
  static override properties = {
    historyView: { attribute: false },
    timeLapse: { attribute: false },
    history: { attribute: false },
    newest: { attribute: false },
    mayEdit: { attribute: false },
    client: { attribute: false },
  };
  static override styles = [shared, historyViewBarStyles];

  /** The clock that is asked for. */
  declare historyView: Pick<HistoryView, "wanted">;
  declare timeLapse: TimeLapse;
  declare history: History;
  /** Clock of the present. */
  declare newest: ReadonlySignal<number>;
  declare mayEdit: ReadonlySignal<boolean>;
  /** My client. */
  declare client: string;

  protected override render(): TemplateResult | typeof nothing {
    const { timeLapse, mayEdit } = this;
    const clock = this.historyView.wanted.value;
    if (clock === null) return nothing;
    return html`
      <section class="panel bar" aria-label=${msg("The terrain as it was")}>
        <div class="row head">
          ${icon("clock")}
          <div class="says" role="status">
            <strong>${msg("As it was")}</strong>
            <span title=${this.#words(clock)}>${this.#what(clock)}</span>
          </div>
          <button
            class="btn outline"
            ?disabled=${!mayEdit.value || timeLapse.copying.value}
            title=${mayEdit.value ? msg("A new terrain of your own that begins here") : msg("This link lets you look, not copy.")}
            @click=${() => void timeLapse.copy()}
          >
            ${icon("copy")} ${msg("Make a copy")}
          </button>
          <button class="btn primary" @click=${() => timeLapse.leave()}>${msg("Back to now")}</button>
        </div>
        ${this.#time(clock)}
      </section>
    `;
  }

  #time(clock: number): TemplateResult {
    const { timeLapse } = this;
    const playing = timeLapse.playing.value;
    const newest = this.newest.value;
    const label = playing ? msg("Pause") : msg("Play");
    return html`<div class="row">
      <button class="icon-btn small" aria-label=${label} title=${label} @click=${() => (playing ? timeLapse.pause() : timeLapse.play())}>
        ${icon(playing ? "pause" : "play")}
      </button>
      <input
        type="range"
        aria-label=${msg("Moment of the history")}
        aria-valuetext=${msg(str`${clock} of ${newest}: ${this.#words(clock)}`)}
        min="0"
        max=${newest}
        .value=${String(clock)}
        style=${`--share:${newest > 0 ? (100 * clock) / newest : 0}%`}
        @input=${(e: Event) => timeLapse.show(Number((e.target as HTMLInputElement).value))}
      />
      <button
        class="btn speed"
        aria-label=${msg(str`Speed ${timeLapse.speed.value}, change it`)}
        title=${msg("Speed of the time lapse")}
        @click=${() => {
          const at = SPEEDS.indexOf(timeLapse.speed.value as (typeof SPEEDS)[number]);
          timeLapse.speed.value = SPEEDS[(at + 1) % SPEEDS.length]!;
        }}
      >
        ${timeLapse.speed.value}×
      </button>
    </div>`;
  }

  #what(clock: number): TemplateResult {
    const entry = entryAt(this.history.entries.value, clock);
    const at = entry?.at ?? null;
    const when = at === null ? "" : ` · ${ago(Math.max(0, Date.now() - at * 1000))}`;
    return html`${this.#words(clock)}${when}`;
  }

  #words(clock: number): string {
    const { history, client } = this;
    if (clock === 0) return msg("at the beginning");
    const entry = entryAt(history.entries.value, clock);
    if (entry === null) return msg(str`step ${clock}`);
    const name = entry.author === client ? msg("you") : history.nameOf(entry.author);
    const what = whoDid(name, historyWords(entry));
    return entry.last > clock ? msg(str`while ${what}`) : msg(str`after ${what}`);
  }
}

customElements.define("esk-history-view-bar", EskHistoryViewBar);
