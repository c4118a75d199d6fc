import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/dropdown/dropdown.js";
import "@awesome.me/webawesome/dist/components/dropdown-item/dropdown-item.js";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import { memberName } from "../../app/device/names.ts";
import type { Identity } from "../../app/device/storage.ts";
import { inkOn } from "../../app/view/colours.ts";
import type { People } from "../../app/view/scene.ts";
import { initials } from "../../app/words/words.ts";
import type { Member } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** People with a circle of their own beside mine; all others are in a list. */
const SHOWN = { wide: 5, narrow: 2, phone: 1 } as const;
const NARROW = "(max-width: 720px)";
const PHONE = "(max-width: 430px)";

/** The people who are here. A click on a person fires `follow` with that client, a click on oneself `profile`. */
export class EskPeople extends SignalElement {
  static override properties = {
    client: { attribute: false },
    me: { attribute: false },
    members: { attribute: false },
    people: { attribute: false },
    following: { attribute: false },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: flex;
        align-items: center;
      }
      .avatar {
        appearance: none;
        display: grid;
        place-items: center;
        width: 30px;
        height: 30px;
        margin-left: -6px;
        padding: 0;
        border: 2px solid var(--esk-panel-solid);
        border-radius: 50%;
        font: 650 0.6875rem/1 var(--wa-font-family-body);
        cursor: pointer;
      }
      .avatar:first-child {
        margin-left: 0;
      }
      .avatar.followed {
        box-shadow: 0 0 0 2px var(--esk-accent);
      }
      .avatar:hover,
      .avatar:focus-visible {
        z-index: 1;
      }
      .avatar .icon {
        width: 15px;
        height: 15px;
      }
      .more {
        min-width: 34px;
        height: 34px;
        min-height: 0;
        margin-left: 2px;
        padding: 0 6px;
        color: var(--esk-quiet);
        font-size: 0.8125rem;
      }
      wa-dropdown::part(menu) {
        max-height: min(70vh, 480px);
        overflow-y: auto;
      }
      .spot {
        width: 14px;
        height: 14px;
        border-radius: 50%;
      }
      @media (pointer: coarse) {
        .more {
          min-width: 40px;
          height: 40px;
        }
        .avatar {
          position: relative;
        }
        .avatar::after {
          content: "";
          position: absolute;
          inset: -7px -2px;
        }
      }
    `,
  ];

  /** My client. */
  declare client: string;
  declare me: ReadonlySignal<Identity>;
  declare members: ReadonlySignal<readonly Member[]>;
  declare people: ReadonlySignal<People>;
  /** The client whose view mine goes along with. */
  declare following: ReadonlySignal<string | null>;
  readonly #narrow = window.matchMedia(NARROW);
  readonly #phone = window.matchMedia(PHONE);
  readonly #turned = (): void => this.requestUpdate();

  override connectedCallback(): void {
    super.connectedCallback();
    for (const query of [this.#narrow, this.#phone]) query.addEventListener("change", this.#turned);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    for (const query of [this.#narrow, this.#phone]) query.removeEventListener("change", this.#turned);
  }

  protected override render(): TemplateResult {
    const others = this.members.value.filter((m) => m.client !== this.client);
    const me = this.me.value;
    const shown = SHOWN[this.#phone.matches ? "phone" : this.#narrow.matches ? "narrow" : "wide"];
    return html`
      <button
        class="avatar"
        style=${colours(this.people.value.myColour)}
        title=${msg(str`${me.name} (you): change name and colour`)}
        aria-label=${msg(str`${me.name}, you: change name and colour`)}
        @click=${() => this.dispatchEvent(new CustomEvent("profile"))}
      >
        ${initials(me.name) || icon("user")}
      </button>
      ${others.slice(0, shown).map((m) => this.#other(m, this.following.value === m.client))}
      ${others.length > shown ? this.#all(others, others.length - shown) : nothing}
    `;
  }

  /** Everybody by name: a class does not fit beside each other. */
  #all(others: readonly Member[], hidden: number): TemplateResult {
    const named = others.map((m) => ({ ...m, shown: memberName(m) })).sort((a, b) => a.shown.localeCompare(b.shown));
    const follow = (e: CustomEvent<{ item: { value: string } }>): void => this.#follow(e.detail.item.value);
    return html`<wa-dropdown placement="bottom-end" @wa-select=${follow}>
      <button slot="trigger" class="btn more" aria-label=${msg(str`Everybody here: ${others.length + 1} people`)} title=${msg("Everybody here")}>
        +${hidden}
      </button>
      ${named.map(
        (
          m,
        ) => html`<wa-dropdown-item type="checkbox" value=${m.client} .checked=${live(this.following.value === m.client)}>
          <span slot="icon" class="spot" style=${`background:${m.colour}`}></span>${m.shown}
        </wa-dropdown-item>`,
      )}
    </wa-dropdown>`;
  }

  #follow(client: string): void {
    this.dispatchEvent(new CustomEvent<string>("follow", { detail: client }));
  }

  #other(member: Member, followed: boolean): TemplateResult {
    const name = memberName(member);
    const label = followed ? msg(str`Stop following ${name}`) : msg(str`Follow ${name}`);
    return html`<button
      class="avatar other ${followed ? "followed" : ""}"
      style=${colours(member.colour)}
      title=${label}
      aria-label=${label}
      aria-pressed=${followed}
      @click=${() => this.#follow(member.client)}
    >
      ${initials(name) || icon("user")}
    </button>`;
  }
}

function colours(colour: string): string {
  return `background:${colour};color:${inkOn(colour)}`;
}

customElements.define("esk-people", EskPeople);
