import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/copy-button/copy-button.js";
import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import "@awesome.me/webawesome/dist/components/qr-code/qr-code.js";
import "@awesome.me/webawesome/dist/components/switch/switch.js";
import { html, nothing, type TemplateResult } from "lit";
import { type AccessLink, ApiError, api, type JoinCode, type Preview } from "../../app/server/api.ts";
import { roomPath, terrainLink } from "../../app/server/links.ts";
import { icon } from "../controls/icons.ts";
import "../controls/segmented.ts";
import {
  keepRenewing,
  type MadeLinks,
  madeLinks,
  newSecret,
  rememberLink,
  type ShareRole,
} from "../../app/device/share-links.ts";
import "./class-form.ts";
import "./share-list.ts";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shareStyles } from "../styles/share.ts";
import { shared } from "../styles/shared.ts";

type Tab = "edit" | "view" | "owner";

const WORDS: Readonly<Record<Tab, { readonly label: string; readonly says: string }>> = {
  edit: { label: msg("Can draw"), says: msg("Everybody with this link draws along.") },
  view: { label: msg("Can look"), says: msg("Everybody with this link watches, and changes nothing.") },
  owner: {
    label: msg("Owner"),
    says: msg("This link can do everything, also revoke the others. Keep it to yourself."),
  },
};

/** A join code with the time when it ends, in milliseconds of this device's clock. */
interface Shown {
  readonly code: string;
  readonly role: Tab;
  readonly ends: number;
}

/** The part of an open terrain by which links are made and changed. */
type Shareable = Pick<OpenTerrain, "id" | "secret" | "client" | "store" | "role" | "adoptSecret" | "toasts">;

/** Links to give away, with QR code and join code; for the owner also the list of links, to rotate and revoke. */
export class EskShare extends SignalElement {
  static override properties = {
    terrain: { attribute: false },
    open: { type: Boolean },
    tab: { state: true },
    made: { state: true },
    links: { state: true },
    code: { state: true },
    preview: { state: true },
    problem: { state: true },
    busy: { state: true },
  };
  static override styles = [shared, shareStyles];

  declare terrain: Shareable;
  declare open: boolean;
  declare tab: Tab;
  declare made: MadeLinks;
  declare links: readonly AccessLink[] | null;
  /** The code that was made last, for as long as it lives. */
  declare code: Shown | null;
  declare preview: Preview | null;
  declare problem: string;
  declare busy: boolean;

  #clock: ReturnType<typeof setInterval> | undefined;

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
  }

  protected override willUpdate(changed: Map<PropertyKey, unknown>): void {
    if (changed.has("open") && this.open) this.#opened();
  }

  #opened(): void {
    const { terrain } = this;
    this.made = madeLinks(terrain.store, terrain.id);
    this.problem = "";
    this.tab = terrain.role.value === "view" ? "view" : "edit";
    void this.#try(async () => {
      // Asking for the picture also has it drawn, so that it is there when the link is pasted.
      this.preview = await api.preview(terrain.id, terrain.secret);
      if (terrain.role.value === "owner") await this.#loadLinks();
    });
  }

  async #showPreview(shown: boolean): Promise<void> {
    const { terrain } = this;
    this.preview = await api.showPreview(terrain.id, terrain.secret, shown);
  }

  async #loadLinks(): Promise<void> {
    const { terrain } = this;
    this.links = await api.links(terrain.id, terrain.secret);
    for (const role of ["edit", "view"] as const) {
      const known = this.made[role];
      const alive = known && this.links.some((l) => l.id === known.link && !l.revoked);
      if (known && !alive) this.made = rememberLink(terrain.store, terrain.id, role, null);
    }
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

  /** The secret for the chosen kind of link, if this device has it. */
  get #secret(): string | null {
    const { terrain } = this;
    if (this.tab === terrain.role.value) return terrain.secret;
    return this.tab === "owner" ? null : (this.made[this.tab]?.secret ?? null);
  }

  async #make(role: ShareRole): Promise<void> {
    const { terrain } = this;
    const name = role === "edit" ? msg("Shared for drawing") : msg("Shared for looking");
    const link = await api.addLink(terrain.id, terrain.secret, role, name);
    this.made = rememberLink(terrain.store, terrain.id, role, { link: link.id, secret: link.secret });
    await this.#loadLinks();
  }

  async #makeCode(role: Tab): Promise<void> {
    const { terrain } = this;
    this.#setCode(await api.code(terrain.id, terrain.secret, role), role);
  }

  async #prolong(code: Shown): Promise<void> {
    const { terrain } = this;
    this.#setCode(await api.prolong(terrain.id, terrain.secret, code.code), code.role);
  }

  /** Counts down while the dialog is open. */
  #setCode(code: JoinCode | null, role: Tab = "edit"): void {
    clearInterval(this.#clock);
    this.code = code && { code: code.code, role, ends: Date.now() + 1000 * code.expires_s };
    if (code) this.#clock = setInterval(() => this.#tick(), 1000);
  }

  #tick(): void {
    if (this.code && this.code.ends <= Date.now()) {
      this.#setCode(null);
      this.problem = msg("The code has ended. Make a new one.");
    } else if (this.open) this.requestUpdate();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    clearInterval(this.#clock);
  }

  async #rotate(link: AccessLink): Promise<void> {
    const { terrain } = this;
    const secret = newSecret();
    // Kept before it is asked for: an answer that is lost must not lose the last owner link.
    if (link.own) keepRenewing(terrain.store, terrain.id, secret);
    try {
      await api.rotateLink(terrain.id, terrain.secret, link.id, secret, terrain.client);
    } catch (error) {
      const taken = link.own && !(await dead(terrain.id, secret));
      if (!taken) {
        if (error instanceof ApiError && error.code !== "unreachable") keepRenewing(terrain.store, terrain.id, null);
        throw error;
      }
    }
    if (link.role === "owner") {
      if (link.own) terrain.adoptSecret(secret);
      keepRenewing(terrain.store, terrain.id, null);
    } else {
      this.made = rememberLink(terrain.store, terrain.id, link.role, { link: link.id, secret });
      this.tab = link.role;
    }
    await this.#loadLinks();
    terrain.toasts.show(msg("The old link no longer works. The new one is shown here."));
  }

  async #revoke(link: AccessLink): Promise<void> {
    const { terrain } = this;
    await api.revokeLink(terrain.id, terrain.secret, link.id);
    await this.#loadLinks();
  }

  protected override render(): TemplateResult {
    const role = this.terrain.role.value;
    const tabs: Tab[] = role === "owner" ? ["edit", "view", "owner"] : role === "edit" ? ["edit"] : ["view"];
    return html`
      <wa-dialog label=${msg("Share this terrain")} light-dismiss ?open=${this.open} @wa-after-hide=${this.#hidden}>
        ${
          tabs.length > 1
            ? html`<esk-segmented
                label=${msg("Kind of link")}
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
        ${role === "owner" && this.open ? html`<esk-class-form .terrain=${this.terrain.id} .secret=${this.terrain.secret}></esk-class-form>` : nothing}
        ${role === "owner" && this.preview?.available ? this.#picture(this.preview) : nothing}
        ${
          role === "owner" && this.links
            ? html`<esk-share-list
                .links=${this.links}
                .words=${(l: AccessLink) => WORDS[l.role].label}
                ?disabled=${this.busy}
                @reload=${() => this.#try(() => this.#loadLinks())}
                @replace=${(e: CustomEvent<AccessLink>) => this.#try(() => this.#rotate(e.detail))}
                @revoke=${(e: CustomEvent<AccessLink>) => this.#try(() => this.#revoke(e.detail))}
              ></esk-share-list>`
            : nothing
        }
      </wa-dialog>
    `;
  }

  #prolongButton(code: Shown): TemplateResult {
    return html`<button
      class="btn outline"
      title=${msg("Fifteen minutes from now, for ten hours at most")}
      ?disabled=${this.busy}
      @click=${() => this.#try(() => this.#prolong(code))}
    >
      ${icon("rotate")} ${msg("Prolong")}
    </button>`;
  }

  #link(): TemplateResult {
    const secret = this.#secret;
    const tab = this.tab;
    if (secret === null && tab !== "owner") {
      return html`<button class="btn primary make" ?disabled=${this.busy} @click=${() => this.#try(() => this.#make(tab))}>
        ${icon("link")} ${msg("Make a link")}
      </button>`;
    }
    const { preview } = this;
    const token = tab !== "owner" && preview?.shown && preview.available ? preview.token : null;
    const link = terrainLink(window.location.origin, this.terrain.id, secret ?? "", token);
    return html`
      <div class="link">
        <input class="field" readonly aria-label=${msg("Link")} .value=${link} @focus=${(e: Event) => (e.target as HTMLInputElement).select()} />
        <wa-copy-button .value=${link} copy-label=${msg("Copy the link")}></wa-copy-button>
      </div>
      ${
        tab === "owner"
          ? nothing
          : html`<div class="qr"><wa-qr-code .value=${link} label=${msg("QR code of the link")} size="168"></wa-qr-code></div>`
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
                  <span class="quiet">${msg(str`${left(code)} Type it at ${window.location.origin}.`)}</span>
                </span>
                <span class="acts">
                  ${this.#prolongButton(code)}
                  <a class="btn outline" href=${roomPath(code.code)} target="_blank">${icon("monitor")} ${msg("Show it large")}</a>
                  <wa-copy-button .value=${code.code} copy-label=${msg("Copy the code")}></wa-copy-button>
                </span>`
            : html`<span class="quiet">${msg("For a classroom: a short code to type instead of the link.")}</span>
                <button class="btn outline" ?disabled=${this.busy} @click=${() => this.#try(() => this.#makeCode(tab))}>
                  ${icon("key")} ${msg("Show a code")}
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
        >${msg("Links show a picture of the terrain where they are pasted")}</wa-switch
      >
    `;
  }

  #hidden(event: Event): void {
    if (event.target === event.currentTarget) this.dispatchEvent(new CustomEvent("close"));
  }
}

/** How long a code lives on, in words. */
function left(code: Shown): string {
  const seconds = Math.max(0, Math.round((code.ends - Date.now()) / 1000));
  if (seconds < 60) return msg(str`Valid for ${seconds} more seconds.`);
  const minutes = Math.floor(seconds / 60);
  return minutes === 1 ? msg("Valid for 1 more minute.") : msg(str`Valid for ${minutes} more minutes.`);
}

/** Says whether a secret no longer opens the terrain. */
async function dead(id: string, secret: string): Promise<boolean> {
  try {
    await api.about(id, secret);
    return false;
  } catch (error) {
    return error instanceof ApiError && ["bad_secret", "revoked"].includes(error.code);
  }
}

customElements.define("esk-share", EskShare);
