import { msg } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import { LayerPlacing } from "../../app/layers/placing.ts";
import type { Placing } from "../../input/tools/placement.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** While a grid is in hand: what to do with it, and the buttons for those without a keyboard. Fires `numbers`. */
export class EskPlacingBar extends SignalElement {
  static override properties = { placing: { attribute: false }, beside: { type: Boolean, reflect: true } };
  static override styles = [
    shared,
    css`
      :host {
        position: absolute;
        left: 50%;
        bottom: 64px;
        transform: translateX(-50%);
        width: max-content;
        max-width: calc(100% - 2 * var(--edge));
      }
      .panel {
        display: flex;
        flex-wrap: wrap;
        align-items: center;
        justify-content: center;
        gap: 8px 10px;
        padding: 7px 7px 7px 14px;
        font-weight: 500;
      }
      .what {
        display: flex;
        align-items: center;
        gap: 10px;
      }
      .what .icon {
        color: var(--esk-accent-text);
      }
      .keys {
        color: var(--esk-quiet);
        font-weight: 400;
      }
      .row {
        display: flex;
        gap: 6px;
      }
      /* The panel at the right has these buttons too. */
      @media (min-width: 721px) {
        :host([beside]) {
          left: calc((100% - 324px) / 2);
          max-width: calc(100% - 324px - 160px);
        }
        :host([beside]) .row {
          display: none;
        }
        :host([beside]) .panel {
          padding: 11px 18px 11px 14px;
        }
      }
      @media (max-width: 720px) {
        :host {
          bottom: calc(118px + env(safe-area-inset-bottom));
          width: auto;
          left: var(--edge);
          right: var(--edge);
          transform: none;
        }
        .panel {
          padding: 10px;
          font-size: 0.8125rem;
        }
        .row {
          width: 100%;
        }
        .row .btn {
          flex: 1;
        }
        .keys {
          display: none;
        }
      }
      @media (pointer: coarse) {
        .btn {
          min-height: 44px;
        }
        .keys {
          display: none;
        }
      }
    `,
  ];

  declare placing: ReadonlySignal<Placing | null>;
  /** The panel with the grid's numbers is open. */
  declare beside: boolean;

  protected override render(): TemplateResult | typeof nothing {
    const placing = this.placing.value;
    if (placing === null) return nothing;
    const layer = placing instanceof LayerPlacing;
    return html`<div class="panel" role="group" aria-label=${msg("The grid in hand")}>
      <span class="what" role="status">
        ${icon("select")}
        <span>
          ${msg("Drag the grid where it belongs.")}
          <span class="keys">${layer ? msg("Enter leaves it, Esc puts it back.") : msg("Enter places it, Esc gives it up.")}</span>
        </span>
      </span>
      <span class="row">
        <button class="btn outline" @click=${() => this.dispatchEvent(new CustomEvent("numbers"))}>${msg("Numbers")}</button>
        <button class="btn outline" @click=${() => placing.cancel()}>${layer ? msg("Put it back") : msg("Cancel")}</button>
        <button class="btn primary" @click=${() => placing.finish()}>${layer ? msg("Leave it here") : msg("Place it")}</button>
      </span>
    </div>`;
  }
}

customElements.define("esk-placing-bar", EskPlacingBar);
