import { css, html, nothing, type TemplateResult } from "lit";
import type { Member } from "../generated/contract.ts";
import { icon } from "./icons.ts";
import { friendlyName } from "./names.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { inkOn } from "./styles/colours.ts";
import { shared } from "./styles/shared.ts";
import { initials } from "./words.ts";

const SHOWN = 5;

/** The name to show for a member; one who gave none (a script, say) goes by a friendly name made from the client's id. */
export function memberName(member: Pick<Member, "client" | "name">): string {
  return member.name.trim() || friendlyName(member.client);
}

/** Who is here. A click on a person flies to their view and follows it; a click on oneself opens one's own name. */
export class EskPeople extends SignalElement {
  static override properties = { stage: { attribute: false } };
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
        margin-left: 6px;
        color: var(--esk-quiet);
        font-size: 0.8125rem;
      }
      @media (pointer: coarse) {
        .avatar {
          position: relative;
        }
        .avatar::after {
          content: "";
          position: absolute;
          inset: -7px -2px;
        }
      }
      @media (max-width: 720px) {
        .other:nth-of-type(n + 3) {
          display: none;
        }
      }
    `,
  ];

  declare stage: Stage;

  protected override render(): TemplateResult {
    const { session, following } = this.stage;
    const others = session.members.value.filter((m) => m.client !== session.client);
    const me = session.people.value;
    return html`
      <button
        class="avatar"
        style=${colours(me.myColour)}
        title=${`${session.me.value.name} (you): change name and colour`}
        aria-label=${`${session.me.value.name}, you: change name and colour`}
        @click=${() => this.dispatchEvent(new CustomEvent("profile"))}
      >
        ${initials(session.me.value.name) || icon("user")}
      </button>
      ${others.slice(0, SHOWN).map((m) => this.#other(m, following.value === m.client))}
      ${others.length > SHOWN ? html`<span class="more">+${others.length - SHOWN}</span>` : nothing}
    `;
  }

  #other(member: Member, followed: boolean): TemplateResult {
    const name = memberName(member);
    const label = followed ? `Stop following ${name}` : `Follow ${name}`;
    return html`<button
      class="avatar other ${followed ? "followed" : ""}"
      style=${colours(member.colour)}
      title=${label}
      aria-label=${label}
      aria-pressed=${followed}
      @click=${() => this.stage.follow(member.client)}
    >
      ${initials(name) || icon("user")}
    </button>`;
  }
}

function colours(colour: string): string {
  return `background:${colour};color:${inkOn(colour)}`;
}

customElements.define("esk-people", EskPeople);
