import { msg, str } from "@lit/localize";
import { css, html, LitElement, nothing, type TemplateResult } from "lit";
import { shared } from "../styles/shared.ts";
import "../controls/range-field.ts";
import { height } from "../../app/words/words.ts";

/** A stroke that crosses the selected one. */
export interface MeetingRow {
  readonly id: string;
  readonly name: string;
  /** The heights that the selected stroke and the other one ask for where they cross, metres. */
  readonly mine: number;
  readonly theirs: number;
  readonly yields: boolean;
  readonly locked: boolean;
}

/**
 * The event `change` carries how far which stroke yields, and whether the gesture is over; without an id it is the
 * selected one.
 */
export interface YieldChange {
  readonly id: string | null;
  readonly yields: number;
  readonly settled: boolean;
}

/**
 * Lists the strokes that cross the selected one, and says which of them gives way. Fires `change`, and `select` with an
 * id.
 */
export class EskMeetingForm extends LitElement {
  static override properties = {
    yields: { type: Number },
    rows: { attribute: false },
    disabled: { type: Boolean },
    editable: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 8px;
        padding-top: 10px;
        border-top: 1px solid var(--esk-line);
      }
      h3 {
        font-size: 0.8125rem;
        font-weight: 620;
      }
      p,
      small {
        color: var(--esk-quiet);
        font-size: 0.8125rem;
      }
      ul {
        display: grid;
        gap: 6px;
        margin: 0;
        padding: 0;
        list-style: none;
      }
      li {
        display: grid;
        grid-template-columns: 1fr auto;
        align-items: center;
        gap: 2px 8px;
      }
      small {
        grid-column: 1;
      }
      .name {
        min-width: 0;
        justify-content: flex-start;
        overflow: hidden;
        text-overflow: ellipsis;
        white-space: nowrap;
      }
    `,
  ];

  declare yields: number;
  declare rows: readonly MeetingRow[];
  declare disabled: boolean;
  /** Whether other strokes may be changed. */
  declare editable: boolean;

  constructor() {
    super();
    this.yields = 0;
    this.rows = [];
    this.disabled = false;
    this.editable = false;
  }

  #emit(id: string | null, yields: number, settled: boolean): void {
    if (id === null) this.yields = yields;
    this.dispatchEvent(new CustomEvent<YieldChange>("change", { detail: { id, yields, settled } }));
  }

  protected override render(): TemplateResult {
    const share = (percent: number): number => Math.min(1, Math.max(0, percent / 100));
    return html`
      <h3>${msg("Where strokes meet")}</h3>
      ${this.rows.length === 0 ? html`<p>${msg("No other stroke crosses this one.")}</p>` : html`<ul>${this.rows.map((row) => this.#row(row))}</ul>`}
      <esk-range
        label=${msg("Yields to others")}
        unit="%"
        min="0"
        max="100"
        step="1"
        .value=${100 * this.yields}
        ?disabled=${this.disabled}
        @value=${(e: CustomEvent<number>) => this.#emit(null, share(e.detail), false)}
        @settle=${(e: CustomEvent<number>) => this.#emit(null, share(e.detail), true)}
      ></esk-range>
      <p>${this.yields === 0 ? msg("Counts as much as any other stroke.") : this.yields === 1 ? msg("Gives way to every other stroke.") : msg("Counts less than other strokes.")}</p>
    `;
  }

  #row(row: MeetingRow): TemplateResult {
    return html`
      <li>
        <button class="btn name" @click=${() => this.dispatchEvent(new CustomEvent("select", { detail: row.id }))}>${row.name}</button>
        ${
          this.editable
            ? html`<button
                class="btn outline"
                aria-pressed=${row.yields}
                aria-label=${msg(str`${row.name} yields`)}
                ?disabled=${row.locked}
                @click=${() => this.#emit(row.id, row.yields ? 0 : 1, true)}
              >
                ${row.yields ? msg("Yields") : msg("Let it yield")}
              </button>`
            : nothing
        }
        <small>${msg(str`at ${height(row.theirs)}, this one at ${height(row.mine)}`)}</small>
      </li>
    `;
  }
}

customElements.define("esk-meeting-form", EskMeetingForm);
