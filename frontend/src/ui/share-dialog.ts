import "@awesome.me/webawesome/dist/components/copy-button/copy-button.js";
import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import "@awesome.me/webawesome/dist/components/qr-code/qr-code.js";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import { html, nothing, type TemplateResult } from "lit";
import { type AccessLink, ApiError, api, type JoinCode, type Preview } from "./api.ts";
import { icon } from "./icons.ts";
import { terrainLink } from "./links.ts";
import "./segmented.ts";
import { type MadeLinks, madeLinks, rememberLink, type ShareRole } from "./share-links.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { shareStyles } from "./styles/share.ts";
import { shared } from "./styles/shared.ts";

type Tab = "edit" | "view" | "owner";

const WORDS: Readonly<Record<Tab, { readonly label: string; readonly says: string }>> = {
  edit: { label: "Can draw", says: "Everybody with this link draws along." },
  view: { label: "Can look", says: "Everybody with this link watches, and changes nothing." },
  owner: { label: "Owner", says: "This link can do everything, also revoke the others. Keep it to yourself." },
};

/** Links to give away, with QR code and join code; for the owner also the list of links, to rotate and revoke. */
export class EskShare extends SignalElement {
  static override properties = {
    stage: { attribute: false },
    open: { type: Boolean },
    tab: { state: true },
    made: { state: true },
    links: { state: true },
    code: { state: true },
    preview: { state: true },
    problem: { state: true },
    busy: { state: true },
    large: { state: true },
  };
  static override styles = [shared, shareStyles];

  declare stage: Stage;
  declare open: boolean;
  declare tab: Tab;
  declare made: MadeLinks;
  declare links: readonly AccessLink[] | null;
  declare code: (JoinCode & { readonly role: Tab }) | null;
  declare preview: Preview | null;
  declare problem: string;
  declare busy: boolean;
  /** The code fills the window, for a projector. */
  declare large: boolean;

  constructor() {
    super();
    this.open = false;
    this.tab = "edit";
    this.made = {};
    this.links = null;
    this.code = null;
    this.preview = null;
    this.problem = "";
    this.busy = false;
    this.large = false;
  }

  protected override willUpdate(changed: Map<PropertyKey, unknown>): void {
    if (changed.has("open") && this.open) this.#opened();
  }

  #opened(): void {
    const { session } = this.stage;
    this.made = madeLinks(session.store, session.id);
    this.code = null;
    this.large = false;
    this.problem = "";
    this.tab = session.role.value === "view" ? "view" : "edit";
    void this.#try(async () => {
      // Asking for the picture also has it drawn, so that it is there when the link is pasted.
      this.preview = await api.preview(session.id, session.secret);
      if (session.role.value === "owner") await this.#loadLinks();
    });
  }

  async #showPreview(shown: boolean): Promise<void> {
    const { session } = this.stage;
    this.preview = await api.showPreview(session.id, session.secret, shown);
  }

  async #loadLinks(): Promise<void> {
    const { session } = this.stage;
    this.links = await api.links(session.id, session.secret);
    for (const role of ["edit", "view"] as const) {
      const known = this.made[role];
      const alive = known && this.links.some((l) => l.id === known.link && !l.revoked);
      if (known && !alive) this.made = rememberLink(session.store, session.id, role, null);
    }
  }

  async #try(what: () => Promise<void>): Promise<void> {
    this.busy = true;
    this.problem = "";
    try {
      await what();
    } catch (error) {
      this.problem = error instanceof ApiError ? error.message : "Something went wrong. Close this and try again.";
    } finally {
      this.busy = false;
    }
  }

  /** The secret for the chosen kind of link, if this device has it. */
  get #secret(): string | null {
    const { session } = this.stage;
    if (this.tab === session.role.value) return session.secret;
    return this.tab === "owner" ? null : (this.made[this.tab]?.secret ?? null);
  }

  async #make(role: ShareRole): Promise<void> {
    const { session } = this.stage;
    const name = role === "edit" ? "Shared for drawing" : "Shared for looking";
    const link = await api.addLink(session.id, session.secret, role, name);
    this.made = rememberLink(session.store, session.id, role, { link: link.id, secret: link.secret });
    await this.#loadLinks();
  }

  async #makeCode(role: Tab): Promise<void> {
    const { session } = this.stage;
    this.code = { ...(await api.code(session.id, session.secret, role)), role };
  }

  async #rotate(link: AccessLink): Promise<void> {
    const { session } = this.stage;
    const { secret } = await api.rotateLink(session.id, session.secret, link.id);
    if (link.role === "owner") {
      if (await dead(session.id, session.secret)) session.adoptSecret(secret);
    } else {
      this.made = rememberLink(session.store, session.id, link.role, { link: link.id, secret });
      this.tab = link.role;
    }
    await this.#loadLinks();
    session.toasts.show("The old link no longer works. The new one is shown here.");
  }

  async #revoke(link: AccessLink): Promise<void> {
    const { session } = this.stage;
    await api.revokeLink(session.id, session.secret, link.id);
    await this.#loadLinks();
  }

  protected override render(): TemplateResult {
    if (this.large && this.code) return this.#projected(this.code.code);
    const role = this.stage.session.role.value;
    const tabs: Tab[] = role === "owner" ? ["edit", "view", "owner"] : role === "edit" ? ["edit"] : ["view"];
    return html`
      <wa-dialog label="Share this terrain" light-dismiss ?open=${this.open} @wa-after-hide=${this.#hidden}>
        ${
          tabs.length > 1
            ? html`<esk-segmented
                label="Kind of link"
                .segments=${tabs.map((t) => ({ value: t, label: WORDS[t].label }))}
                .value=${this.tab}
                @pick=${(e: CustomEvent<Tab>) => {
                  this.tab = e.detail;
                }}
              ></esk-segmented>`
            : nothing
        }
        <p class="says">${WORDS[this.tab].says}</p>
        ${this.#link()}
        <p class="problem" role="alert">${this.problem}</p>
        ${role !== "view" && this.tab !== "owner" ? this.#codeRow(this.tab) : nothing}
        ${role === "owner" && this.preview?.available ? this.#picture(this.preview) : nothing}
        ${role === "owner" && this.links ? this.#list(this.links) : nothing}
      </wa-dialog>
    `;
  }

  /** Readable from the last row: the code, where to type it, and the link as a QR code where there is one. */
  #projected(code: string): TemplateResult {
    const { host, origin } = window.location;
    const secret = this.#secret;
    return html`
      <wa-dialog class="large" label="Join this terrain" light-dismiss ?open=${this.open} @wa-after-hide=${this.#hidden}>
        <div class="projected">
          <div class="words">
            <p>Open <strong>${host}</strong> and type</p>
            <p class="letters">${code.slice(0, 3)} ${code.slice(3)}</p>
          </div>
          ${
            secret === null
              ? nothing
              : html`<div class="qr"><wa-qr-code .value=${terrainLink(origin, this.stage.session.id, secret)} label="QR code of the link" size="320"></wa-qr-code></div>`
          }
        </div>
        <button class="btn outline" @click=${() => this.#enlarge(false)}>Back</button>
      </wa-dialog>
    `;
  }

  #enlarge(large: boolean): void {
    this.large = large;
  }

  #link(): TemplateResult {
    const secret = this.#secret;
    const tab = this.tab;
    if (secret === null && tab !== "owner") {
      return html`<button class="btn primary make" ?disabled=${this.busy} @click=${() => this.#try(() => this.#make(tab))}>
        ${icon("link")} Make a link
      </button>`;
    }
    const { preview } = this;
    const token = tab !== "owner" && preview?.shown && preview.available ? preview.token : null;
    const link = terrainLink(window.location.origin, this.stage.session.id, secret ?? "", token);
    return html`
      <div class="link">
        <input class="field" readonly aria-label="Link" .value=${link} @focus=${(e: Event) => (e.target as HTMLInputElement).select()} />
        <wa-copy-button .value=${link} copy-label="Copy the link"></wa-copy-button>
      </div>
      ${
        tab === "owner"
          ? nothing
          : html`<div class="qr"><wa-qr-code .value=${link} label="QR code of the link" size="168"></wa-qr-code></div>`
      }
    `;
  }

  #codeRow(tab: Tab): TemplateResult {
    const code = this.code?.role === tab ? this.code : null;
    return html`
      <div class="code">
        ${
          code
            ? html`<span>
                  <strong>${code.code.slice(0, 3)} ${code.code.slice(3)}</strong>
                  <span class="quiet">Valid for ${Math.round(code.expires_s / 60)} minutes. Type it at ${window.location.host}.</span>
                </span>
                <span class="acts">
                  <button class="btn outline" @click=${() => this.#enlarge(true)}>${icon("monitor")} Show it large</button>
                  <wa-copy-button .value=${code.code} copy-label="Copy the code"></wa-copy-button>
                </span>`
            : html`<span class="quiet">For a classroom: a short code to type instead of the link.</span>
                <button class="btn outline" ?disabled=${this.busy} @click=${() => this.#try(() => this.#makeCode(tab))}>
                  ${icon("key")} Show a code
                </button>`
        }
      </div>
    `;
  }

  #picture(preview: Preview): TemplateResult {
    return html`
      <wa-switch
        size="s"
        ?checked=${preview.shown}
        ?disabled=${this.busy}
        @change=${(e: Event) => this.#try(() => this.#showPreview((e.target as HTMLInputElement).checked))}
        >Links show a picture of the terrain where they are pasted</wa-switch
      >
    `;
  }

  #list(links: readonly AccessLink[]): TemplateResult {
    const alive = links.filter((l) => !l.revoked);
    return html`
      <details
        @toggle=${(e: Event) => {
          // Others may have joined by code since: each of them has a link of their own.
          if ((e.target as HTMLDetailsElement).open) void this.#try(() => this.#loadLinks());
        }}
      >
        <summary>Links of this terrain (${alive.length})</summary>
        <ul>
          ${alive.map(
            (l) => html`
              <li>
                <span class="name">${l.name || WORDS[l.role].label}</span>
                <span class="quiet">${WORDS[l.role].label}</span>
                <button
                  class="icon-btn small"
                  title="Replace by a new link"
                  aria-label=${`Replace ${l.name || WORDS[l.role].label} by a new link`}
                  ?disabled=${this.busy}
                  @click=${() => this.#try(() => this.#rotate(l))}
                >
                  ${icon("rotate")}
                </button>
                <button
                  class="icon-btn small"
                  title="Revoke"
                  aria-label=${`Revoke ${l.name || WORDS[l.role].label}`}
                  ?disabled=${this.busy}
                  @click=${() => this.#try(() => this.#revoke(l))}
                >
                  ${icon("trash")}
                </button>
              </li>
            `,
          )}
        </ul>
      </details>
    `;
  }

  #hidden(event: Event): void {
    if (event.target === event.currentTarget) this.dispatchEvent(new CustomEvent("close"));
  }
}

/** Whether a secret no longer opens the terrain. */
async function dead(id: string, secret: string): Promise<boolean> {
  try {
    await api.about(id, secret);
    return false;
  } catch (error) {
    return error instanceof ApiError && ["bad_secret", "revoked"].includes(error.code);
  }
}

customElements.define("esk-share", EskShare);
