import { msg, str } from "@lit/localize";
import { css, html, LitElement, nothing, type TemplateResult } from "lit";
import { ApiError } from "../../app/server/api.ts";
import { type ClassInfo, classApi } from "../../app/server/classes/class-api.ts";
import { wallPath } from "../../app/server/links.ts";
import { ago } from "../../app/words/words.ts";
import { MAX_TOGETHER } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import { shared } from "../styles/shared.ts";

const EACH = [msg("One copy each"), msg("Two share a copy"), msg("Three share a copy"), msg("Four share a copy")].slice(
  0,
  MAX_TOGETHER,
);

/** A copy for everyone: makes a class of a terrain, and leads to the walls of those there are. */
export class EskClassForm extends LitElement {
  static override properties = {
    terrain: { attribute: false },
    secret: { attribute: false },
    classes: { state: true },
    together: { state: true },
    problem: { state: true },
    busy: { state: true },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 8px;
        padding-top: 14px;
        border-top: 1px solid var(--esk-line);
      }
      .row {
        display: flex;
        flex-wrap: wrap;
        align-items: center;
        gap: 8px;
      }
      select {
        flex: 1 1 10em;
      }
      ul {
        display: grid;
        gap: 4px;
        margin: 0;
        padding: 0;
        list-style: none;
      }
      .problem {
        color: var(--esk-bad);
      }
    `,
  ];

  declare terrain: string;
  declare secret: string;
  declare classes: readonly ClassInfo[];
  declare together: number;
  declare problem: string;
  declare busy: boolean;

  constructor() {
    super();
    this.classes = [];
    this.together = 1;
    this.problem = "";
    this.busy = false;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    void this.#try(async () => {
      this.classes = (await classApi.list(this.terrain, this.secret)).filter((each) => each.ended === null);
    });
  }

  async #try(what: () => Promise<void>): Promise<void> {
    this.busy = true;
    this.problem = "";
    try {
      await what();
    } catch (error) {
      this.problem = error instanceof ApiError ? error.message : msg("Something went wrong. Close this and try again.");
    } finally {
      this.busy = false;
    }
  }

  #wallWords({ pupils, created }: ClassInfo): string {
    const when = ago(Date.now() - 1000 * created);
    return pupils === 1
      ? msg(str`To the wall · 1 device · made ${when}`)
      : msg(str`To the wall · ${pupils} devices · made ${when}`);
  }

  #make(): Promise<void> {
    return this.#try(async () => {
      const made = await classApi.make(this.terrain, this.secret, { together: this.together });
      this.classes = [made, ...this.classes];
      window.location.assign(wallPath(this.terrain, made.id, this.secret));
    });
  }

  protected override render(): TemplateResult {
    return html`
      <strong>${msg("A copy for everyone")}</strong>
      <p class="quiet">${msg("Each device that types one code draws on a copy of this terrain as it is now. You see all of them on a wall.")}</p>
      <div class="row">
        <select
          class="field"
          aria-label=${msg("Copies")}
          @change=${(e: Event) => {
            this.together = Number((e.target as HTMLSelectElement).value);
          }}
        >
          ${EACH.map((words, k) => html`<option value=${k + 1} ?selected=${this.together === k + 1}>${words}</option>`)}
        </select>
        <button class="btn outline" ?disabled=${this.busy} @click=${() => this.#make()}>${icon("plus")} ${msg("Make a class")}</button>
      </div>
      <p class="problem" role="alert">${this.problem}</p>
      ${
        this.classes.length === 0
          ? nothing
          : html`<ul>
              ${this.classes.map(
                (each) => html`<li>
                  <a class="btn outline" href=${wallPath(this.terrain, each.id, this.secret)}>
                    ${icon("map")} ${this.#wallWords(each)}
                  </a>
                </li>`,
              )}
            </ul>`
      }
    `;
  }
}

customElements.define("esk-class-form", EskClassForm);
