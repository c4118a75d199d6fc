import { msg } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import { keyText } from "../../app/words/keys.ts";
import type { Action, ActionId, ToolId } from "../../input/keys/action.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

const TOOLS: readonly { readonly id: ToolId; readonly icon: string; readonly label: string }[] = [
  { id: "select", icon: "select", label: msg("Select") },
  { id: "mountain", icon: "mountain", label: msg("Mountain") },
  { id: "crevice", icon: "crevice", label: msg("Crevice") },
  { id: "plateau", icon: "plateau", label: msg("Plateau") },
  { id: "course", icon: "river", label: msg("River, road or ridge") },
  { id: "paint", icon: "brush", label: msg("Paint") },
];

/** The tools, then undo and redo. Vertical at the left; a row at the bottom of a narrow window. */
export class EskTools extends SignalElement {
  static override properties = {
    tool: { attribute: false },
    fingerDraws: { attribute: false },
    canUndo: { attribute: false },
    canRedo: { attribute: false },
    canEdit: { attribute: false },
    actions: { attribute: false },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: flex;
        flex-direction: column;
        gap: 4px;
        padding: 5px;
      }
      hr {
        align-self: stretch;
        margin: 2px 6px;
        border: 0;
        border-top: 1px solid var(--esk-line);
      }
      [role="radiogroup"] {
        display: contents;
      }
      .mountain[aria-checked="true"],
      .crevice[aria-checked="true"] {
        background: color-mix(in oklab, var(--esk-mountain) 18%, transparent);
        color: var(--esk-mountain);
      }
      .plateau[aria-checked="true"] {
        background: color-mix(in oklab, var(--esk-plateau) 18%, transparent);
        color: var(--esk-plateau);
      }
      .course[aria-checked="true"],
      .paint[aria-checked="true"] {
        background: color-mix(in oklab, var(--esk-accent) 18%, transparent);
        color: var(--esk-accent);
      }
      .icon-btn {
        font-size: 18px;
      }
      /* A phone on its side: two columns stand between the bars at the top and the bottom, one does not. */
      @media (max-height: 500px) and (min-width: 721px) {
        :host {
          display: grid;
          grid-template-columns: auto auto;
        }
        hr {
          display: none;
        }
      }
      @media (max-width: 720px) {
        :host {
          flex-direction: row;
        }
        hr {
          margin: 6px 2px;
          border-top: 0;
          border-left: 1px solid var(--esk-line);
        }
        .icon-btn {
          flex: none;
          width: var(--tool-width, 44px);
          height: 44px;
        }
      }
      @media (max-width: 430px) {
        /* Nine of them beside each other. */
        .icon-btn {
          width: min(44px, calc((100vw - 22px) / 9));
        }
        :host {
          gap: 0;
          padding: 4px 2px;
        }
        hr {
          margin: 6px 0;
        }
      }
    `,
  ];

  declare tool: ReadonlySignal<ToolId>;
  /** One finger draws on a touch screen while this is on; else it moves the view. */
  declare fingerDraws: ReadonlySignal<boolean>;
  declare canUndo: ReadonlySignal<boolean>;
  declare canRedo: ReadonlySignal<boolean>;
  declare canEdit: ReadonlySignal<boolean>;
  /** Actions that the buttons run. */
  declare actions: ReadonlyMap<string, Action>;
  readonly #coarse = window.matchMedia("(pointer: coarse)");

  #run(id: ActionId): void {
    this.actions.get(id)?.run();
  }

  #key(event: KeyboardEvent): void {
    const step = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const at = TOOLS.findIndex((t) => t.id === this.tool.value);
    const next = TOOLS[(at + step + TOOLS.length) % TOOLS.length]!;
    this.#run(next.id);
    void this.updateComplete.then(() => this.renderRoot.querySelector<HTMLElement>(`.${next.id}`)?.focus());
  }

  protected override render(): TemplateResult {
    const editable = this.canEdit.value;
    return html`
      <div role="radiogroup" aria-label=${msg("Tool")} @keydown=${this.#key}>
        ${TOOLS.map((t) => {
          const on = this.tool.value === t.id;
          return html`
            <button
              class="icon-btn ${t.id}"
              role="radio"
              aria-checked=${on}
              aria-label=${t.label}
              title=${keyText(t.label, this.actions.get(t.id))}
              tabindex=${on ? 0 : -1}
              ?disabled=${!editable && t.id !== "select"}
              @click=${() => this.#run(t.id)}
            >
              ${icon(t.icon)}
            </button>
          `;
        })}
      </div>
      <hr />
      ${this.#history("undo", msg("Undo"), this.canUndo.value && editable)}
      ${this.#history("redo", msg("Redo"), this.canRedo.value && editable)}
      ${this.#coarse.matches && editable ? this.#finger() : nothing}
    `;
  }

  /** On a touch screen: does one finger draw, or move the view? */
  #finger(): TemplateResult {
    const draws = this.fingerDraws.value;
    const label = draws ? msg("One finger draws. Let it move the view") : msg("One finger moves the view. Let it draw");
    return html`<button
      class="icon-btn"
      aria-label=${label}
      title=${label}
      aria-pressed=${draws}
      @click=${() => this.#run("finger-draws")}
    >
      ${icon("finger")}
    </button>`;
  }

  #history(id: "undo" | "redo", label: string, enabled: boolean): TemplateResult {
    return html`
      <button
        class="icon-btn"
        aria-label=${label}
        title=${keyText(label, this.actions.get(id))}
        ?disabled=${!enabled}
        @click=${() => this.#run(id)}
      >
        ${icon(id)}
      </button>
    `;
  }
}

customElements.define("esk-tools", EskTools);
