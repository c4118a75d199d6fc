import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import { scoreWords } from "../../app/lesson/task/score-words.ts";
import type { TaskView } from "../../app/lesson/task/task-view.ts";
import type { Score } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** The task in one line over the picture: its title, and how far one is. Fires `open`. */
export class EskTaskChip extends SignalElement {
  static override properties = { view: { attribute: false }, score: { attribute: false } };
  static override styles = [
    shared,
    css`
      :host {
        position: relative;
        display: block;
        max-width: min(280px, 100%);
      }
      :host([hidden]) {
        display: none;
      }
      button {
        display: flex;
        align-items: center;
        gap: 8px;
        width: 100%;
        min-height: 40px;
        padding: 4px 12px;
        border: 0;
        border-radius: inherit;
        background: transparent;
        color: inherit;
        font: inherit;
        font-size: 0.8125rem;
        cursor: pointer;
      }
      .icon {
        flex: none;
        color: var(--esk-accent-text);
      }
      .name {
        overflow: hidden;
        text-overflow: ellipsis;
        white-space: nowrap;
      }
      b {
        flex: none;
        font-variant-numeric: tabular-nums;
      }
      i {
        position: absolute;
        left: 10px;
        right: 10px;
        bottom: 3px;
        height: 3px;
        border-radius: 2px;
        background: linear-gradient(var(--esk-accent) 0 0) left / var(--done) 100% no-repeat var(--esk-hover);
      }
    `,
  ];

  declare view: TaskView;
  declare score: ReadonlySignal<Score | null>;

  protected override render(): TemplateResult | typeof nothing {
    const task = this.view.task.value;
    this.toggleAttribute("hidden", task === null);
    if (task === null) return nothing;
    const score = this.score.value;
    const points = score?.points ?? null;
    return html`<button
      title=${score?.text ? scoreWords(task.goal, score) : msg("What is asked")}
      aria-label=${points === null ? msg(str`Task: ${task.title}`) : msg(str`Task: ${task.title}, ${points} of 100 points`)}
      @click=${() => this.dispatchEvent(new CustomEvent("open"))}
    >
      ${icon("star")}<span class="name">${task.title || msg("The task")}</span>
      ${points === null ? nothing : html`<b>${points}</b><i style="--done:${points}%"></i>`}
    </button>`;
  }
}

customElements.define("esk-task-chip", EskTaskChip);
