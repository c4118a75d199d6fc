import { msg, str } from "@lit/localize";
import { html, LitElement, nothing, type TemplateResult } from "lit";
import type { AccessLink } from "../../app/server/api.ts";
import { icon } from "../controls/icons.ts";
import { shareListStyles } from "../styles/share-list.ts";
import { shared } from "../styles/shared.ts";

type Act = "replace" | "revoke";

/** The living links of a terrain. Replacing and revoking one ask first: for its users it is the door. */
export class EskShareList extends LitElement {
  static override styles = [shared, shareListStyles];
  static override properties = {
    links: { attribute: false },
    words: { attribute: false },
    disabled: { type: Boolean },
    asked: { state: true },
  };

  declare links: readonly AccessLink[];
  /** The rights of a link, in words. */
  declare words: (link: AccessLink) => string;
  declare disabled: boolean;
  /** The question that stands open. */
  declare asked: { readonly link: string; readonly act: Act } | null;

  constructor() {
    super();
    this.links = [];
    this.words = (link) => link.role;
    this.disabled = false;
    this.asked = null;
  }

  #ask(link: AccessLink, act: Act): void {
    this.asked = { link: link.id, act };
    void this.updateComplete.then(() => this.renderRoot.querySelector<HTMLElement>(".keep")?.focus());
  }

  #answer(link: AccessLink, act: Act | null): void {
    this.asked = null;
    if (act !== null) this.dispatchEvent(new CustomEvent(act, { detail: link }));
  }

  protected override render(): TemplateResult {
    const alive = this.links.filter((l) => !l.revoked);
    return html`
      <details
        @toggle=${(e: Event) => {
          // Other people may have joined by code since: each of them has a link of their own.
          if ((e.target as HTMLDetailsElement).open) this.dispatchEvent(new CustomEvent("reload"));
        }}
      >
        <summary>${msg(str`Links of this terrain (${alive.length})`)}</summary>
        <ul>
          ${alive.map((l) => (this.asked?.link === l.id ? this.#question(l, this.asked.act) : this.#row(l)))}
        </ul>
      </details>
    `;
  }

  #row(l: AccessLink): TemplateResult {
    const name = l.name || this.words(l);
    return html`
      <li>
        <span class="name">${name}</span>
        <span class="quiet">${this.words(l)}${l.own ? msg(", yours") : ""}</span>
        <button
          class="icon-btn small"
          title=${msg("Replace by a new link…")}
          aria-label=${msg(str`Replace ${name} by a new link`)}
          ?disabled=${this.disabled}
          @click=${() => this.#ask(l, "replace")}
        >
          ${icon("rotate")}
        </button>
        ${
          l.own
            ? nothing
            : html`<button
                class="icon-btn small"
                title=${msg("Revoke…")}
                aria-label=${msg(str`Revoke ${name}`)}
                ?disabled=${this.disabled}
                @click=${() => this.#ask(l, "revoke")}
              >
                ${icon("trash")}
              </button>`
        }
      </li>
    `;
  }

  #question(l: AccessLink, act: Act): TemplateResult {
    const last = l.role === "owner" && this.links.filter((each) => each.role === "owner" && !each.revoked).length === 1;
    return html`
      <li class="asks" role="alertdialog" aria-label=${act === "replace" ? msg(str`Replace ${l.name || this.words(l)}?`) : msg(str`Revoke ${l.name || this.words(l)}?`)}>
        <p>${question(l, act, last)}</p>
        <button class="btn outline keep" @click=${() => this.#answer(l, null)}>${msg("Keep it")}</button>
        <button class="btn primary yes" ?disabled=${this.disabled} @click=${() => this.#answer(l, act)}>
          ${act === "replace" ? msg("Replace it") : msg("Revoke it")}
        </button>
      </li>
    `;
  }
}

/** Returns the question that tells what a button will do before it does it. */
export function question(link: AccessLink, act: Act, lastOwner: boolean): string {
  const name = link.name === "" ? msg("this link") : msg(str`“${link.name}”`);
  if (act === "revoke")
    return msg(str`Revoke ${name}? Whoever came by it is sent away, and so are those whom they let in.`);
  if (link.own) {
    const only = lastOwner ? ` ${msg("It is the only one that owns this terrain.")}` : "";
    return msg(
      str`Replace ${name}, by which you came in?${only} This page keeps the new one; all others who use the old one are shut out.`,
    );
  }
  return msg(str`Replace ${name}? Whoever came by the old one is sent away and needs the new one.`);
}

customElements.define("esk-share-list", EskShareList);
