import { html, nothing, type TemplateResult } from "lit";
import { entryAt } from "./history.ts";
import { icon } from "./icons.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { pastBarStyles } from "./styles/past-bar.ts";
import { shared } from "./styles/shared.ts";
import { SPEEDS } from "./timelapse.ts";
import { ago } from "./words.ts";

/** While the past is shown: what one sees, the slider and the time lapse, a copy, and the way back. */
export class EskPastBar extends SignalElement {
  static override properties = { stage: { attribute: false } };
  static override styles = [shared, pastBarStyles];

  declare stage: Stage;

  protected override render(): TemplateResult | typeof nothing {
    const { session } = this.stage;
    const { lapse } = session;
    const clock = session.past.wanted.value;
    if (clock === null) return nothing;
    return html`
      <section class="panel bar" aria-label="The terrain as it was">
        <div class="row head">
          ${icon("clock")}
          <div class="says" role="status">
            <strong>As it was</strong>
            <span title=${this.#words(clock)}>${this.#what(clock)}</span>
          </div>
          <button
            class="btn outline"
            ?disabled=${!session.mayEdit.value || lapse.copying.value}
            title=${session.mayEdit.value ? "A new terrain of your own that begins here" : "This link lets you look, not copy."}
            @click=${() => void lapse.copy()}
          >
            ${icon("copy")} Make a copy
          </button>
          <button class="btn primary" @click=${() => lapse.leave()}>Back to now</button>
        </div>
        ${this.#time(clock)}
      </section>
    `;
  }

  #time(clock: number): TemplateResult {
    const { session } = this.stage;
    const { lapse } = session;
    const playing = lapse.playing.value;
    const newest = session.newest.value;
    const label = playing ? "Pause" : "Play";
    return html`<div class="row">
      <button class="icon-btn small" aria-label=${label} title=${label} @click=${() => (playing ? lapse.pause() : lapse.play())}>
        ${icon(playing ? "pause" : "play")}
      </button>
      <input
        type="range"
        aria-label="Moment of the history"
        aria-valuetext=${`${clock} of ${newest}: ${this.#words(clock)}`}
        min="0"
        max=${newest}
        .value=${String(clock)}
        style=${`--share:${newest > 0 ? (100 * clock) / newest : 0}%`}
        @input=${(e: Event) => lapse.show(Number((e.target as HTMLInputElement).value))}
      />
      <button
        class="btn speed"
        aria-label=${`Speed ${lapse.speed.value}, change it`}
        title="Speed of the time lapse"
        @click=${() => {
          const at = SPEEDS.indexOf(lapse.speed.value as (typeof SPEEDS)[number]);
          lapse.speed.value = SPEEDS[(at + 1) % SPEEDS.length]!;
        }}
      >
        ${lapse.speed.value}×
      </button>
    </div>`;
  }

  #what(clock: number): TemplateResult {
    const entry = entryAt(this.stage.session.history.entries.value, clock);
    const at = entry?.at ?? null;
    const when = at === null ? "" : ` · ${ago(Math.max(0, Date.now() - at * 1000))}`;
    return html`${this.#words(clock)}${when}`;
  }

  #words(clock: number): string {
    const { history, client } = this.stage.session;
    if (clock === 0) return "at the beginning";
    const entry = entryAt(history.entries.value, clock);
    if (entry === null) return `step ${clock}`;
    const name = entry.author === client ? "you" : history.nameOf(entry.author);
    const verb = entry.last > clock ? "while" : "after";
    return `${verb} ${name} ${entry.text}`;
  }
}

customElements.define("esk-past-bar", EskPastBar);
