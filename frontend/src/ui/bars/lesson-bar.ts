import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import type { LessonView } from "../../app/lesson/lesson-view.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** How the lesson stands, in words: who shows, whether drawing is paused, and the lines that wait for their author. */
export class EskLessonBar extends SignalElement {
  static override properties = {
    lesson: { attribute: false },
    mayEdit: { attribute: false },
    client: { attribute: false },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        justify-items: center;
        gap: 6px;
        pointer-events: none;
      }
      .say {
        display: flex;
        align-items: center;
        gap: 10px;
        min-height: 44px;
        max-width: 100%;
        padding: 2px 6px 2px 14px;
        font-weight: 500;
        animation: settle 180ms ease-out;
      }
      .say.plain {
        padding-right: 16px;
      }
      @keyframes settle {
        from {
          opacity: 0;
          transform: translateY(-6px);
        }
      }
      .say > .icon {
        flex: none;
        color: var(--esk-accent-text);
      }
      .off > .icon {
        color: var(--esk-warn);
      }
      button {
        flex: none;
        min-height: 40px;
        pointer-events: auto;
      }
      @media (max-width: 720px) {
        .say {
          font-size: 0.8125rem;
        }
      }
    `,
  ];

  declare lesson: LessonView;
  declare mayEdit: ReadonlySignal<boolean>;
  declare client: string;

  protected override render(): TemplateResult {
    const said = [this.#look(), this.#hands(), this.#kept()];
    // Other sentences make way for what is said here.
    this.toggleAttribute(
      "speaks",
      said.some((each) => each !== nothing),
    );
    return html`<div role="status" aria-live="polite" style="display: contents">${said}</div>`;
  }

  #look(): TemplateResult | typeof nothing {
    const { lesson } = this;
    const { look, held } = lesson.state.value;
    if (look === this.client)
      return say(
        "eye",
        msg("Everybody sees your view."),
        button(msg("Stop"), () => lesson.conduct({ look: false })),
      );
    const name = lesson.shower.value;
    if (name === null) return nothing;
    if (lesson.leader.value === null)
      return say(
        "eye",
        msg(str`${name} is showing.`),
        button(msg("Look along"), () => lesson.lookAway(false)),
      );
    return say(
      "eye",
      msg(str`${name} is showing.`),
      held ? nothing : button(msg("Look away"), () => lesson.lookAway(true)),
    );
  }

  #hands(): TemplateResult | typeof nothing {
    const { hands_off, draws, conducts } = this.lesson.state.value;
    if (!hands_off || !this.mayEdit.value) return nothing;
    if (conducts)
      return say(
        "lock",
        msg("Hands off: only who leads draws."),
        button(msg("Let draw"), () => this.lesson.conduct({ hands_off: false })),
      );
    if (draws) return say("pen", msg("Hands off for the others. You have a pen."));
    const kept = this.lesson.drafts.list.value.length > 0 ? ` ${msg("Your line is kept for you.")}` : "";
    return say("lock", msg(str`Hands off: drawing is paused for now.${kept}`), nothing, "off");
  }

  #kept(): TemplateResult | typeof nothing {
    const { lesson } = this;
    const count = lesson.drafts.list.value.length;
    if (count === 0 || !lesson.state.value.draws || !this.mayEdit.value) return nothing;
    const words =
      count === 1
        ? msg("Your line from before the pause is still here.")
        : msg(str`${count} lines of yours are still here.`);
    return say(
      "sketch",
      words,
      html`${button(msg("Put it back"), () => lesson.putBack(), "primary")}
        ${button(msg("Let it go"), () => lesson.drafts.drop())}`,
    );
  }
}

function say(name: string, words: string, act: TemplateResult | typeof nothing = nothing, kind = ""): TemplateResult {
  return html`<div class="say panel ${kind} ${act === nothing ? "plain" : ""}">${icon(name)}<span>${words}</span>${act}</div>`;
}

function button(label: string, run: () => void, kind = "outline"): TemplateResult {
  return html`<button class="btn ${kind}" @click=${run}>${label}</button>`;
}

customElements.define("esk-lesson-bar", EskLessonBar);
