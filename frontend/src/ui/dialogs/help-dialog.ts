import { msg } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import { css, html, type TemplateResult } from "lit";
import { type KeyedAction, keyParts } from "../../app/words/keys.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** Gestures of pointers. Keys come from the actions themselves. */
const POINTERS: readonly { readonly what: string; readonly how: string }[] = [
  { what: msg("Draw, or use the chosen tool"), how: msg("Left button, pen or one finger") },
  {
    what: msg("Redraw a part of the selected line"),
    how: msg("Begin on it with the tool that drew it (Alt: a new line)"),
  },
  { what: msg("Paint the opposite"), how: msg("Alt with the brush, or the other end of a pen") },
  {
    what: msg("Draw with the keys"),
    how: msg("Enter shows the pen and sets points, arrows move it (Shift: finely), Enter again ends"),
  },
  { what: msg("Orbit"), how: msg("Right button; left button on empty ground with Select") },
  { what: msg("Pan"), how: msg("Middle button, Shift + right button, Space + left button, or two fingers") },
  { what: msg("Zoom"), how: msg("Wheel, or two fingers") },
  { what: msg("Fly there"), how: msg("Double click") },
  { what: msg("Bring in real ground"), how: msg("Drop elevation files anywhere on the page") },
];

/** The help dialog: every action with its keys. */
export class EskHelp extends SignalElement {
  static override properties = { actions: { attribute: false }, open: { type: Boolean } };
  static override styles = [
    shared,
    css`
      wa-dialog {
        --width: 760px;
      }
      .columns {
        columns: 2 280px;
        column-gap: 36px;
      }
      h3 {
        margin: 0 0 6px;
        font-size: 0.8125rem;
        font-weight: 620;
        color: var(--esk-quiet);
        break-after: avoid;
      }
      dl {
        margin: 0 0 20px;
      }
      .pair {
        display: flex;
        justify-content: space-between;
        align-items: baseline;
        gap: 12px;
        padding: 4px 0;
        break-inside: avoid;
        border-bottom: 1px solid var(--esk-line);
      }
      dt {
        font-size: 0.8125rem;
      }
      dd {
        margin: 0;
        text-align: right;
        font-size: 0.8125rem;
        color: var(--esk-quiet);
      }
      kbd {
        display: inline-block;
        min-width: 20px;
        padding: 1px 5px;
        border: 1px solid var(--esk-line-strong);
        border-bottom-width: 2px;
        border-radius: 5px;
        background: var(--esk-field);
        color: var(--esk-text);
        font: 550 0.6875rem/1.4 var(--wa-font-family-body);
        text-align: center;
      }
    `,
  ];

  declare actions: ReadonlyMap<string, KeyedAction>;
  declare open: boolean;

  protected override render(): TemplateResult {
    return html`
      <wa-dialog label=${msg("Keys and help")} light-dismiss ?open=${this.open} @wa-after-hide=${this.#closed}>
        <div class="columns">
          <h3>${msg("Mouse, pen and touch")}</h3>
          <dl>
            ${POINTERS.map((p) => html`<div class="pair"><dt>${p.what}</dt><dd>${p.how}</dd></div>`)}
          </dl>
          <h3>${msg("Keys")}</h3>
          <dl>
            ${[...this.actions.values()].map(
              (a) =>
                html`<div class="pair"><dt>${a.title}</dt><dd>${a.keys.map((k, i) => keyCombination(k, i > 0))}</dd></div>`,
            )}
          </dl>
        </div>
      </wa-dialog>
    `;
  }

  #closed(event: Event): void {
    if (event.target === event.currentTarget) this.dispatchEvent(new CustomEvent("close"));
  }
}

function keyCombination(combination: string, or: boolean): TemplateResult {
  const parts = keyParts(combination);
  return html`${or ? ` ${msg("or")} ` : ""}${parts.map((p, i) => html`${i > 0 ? "+" : ""}<kbd>${p}</kbd>`)}`;
}

customElements.define("esk-help", EskHelp);
