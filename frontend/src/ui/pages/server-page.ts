import { msg, str } from "@lit/localize";
import { html, LitElement, nothing, type TemplateResult } from "lit";
import { deviceStore, keepServerKey, serverKey } from "../../app/device/storage.ts";
import { ApiError, api, type KeptTerrain } from "../../app/server/api.ts";
import { terrainPath } from "../../app/server/links.ts";
import { ago } from "../../app/words/words.ts";
import { serverStyles } from "../styles/server.ts";
import { shared } from "../styles/shared.ts";

/** `/server#key`: every terrain that this server keeps, for the owner of its computer (docs/decisions/0035). */
export class EskServer extends LitElement {
  static override styles = [shared, serverStyles];
  static override properties = {
    key: { attribute: false },
    terrains: { state: true },
    total: { state: true },
    problem: { state: true },
    busy: { state: true },
  };

  declare key: string;
  declare terrains: readonly KeptTerrain[] | null;
  declare total: number;
  declare problem: string;
  declare busy: boolean;

  constructor() {
    super();
    this.key = "";
    this.terrains = null;
    this.total = 0;
    this.problem = "";
    this.busy = false;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    document.title = msg("Terrains of this server · Esker");
    if (this.key === "")
      this.problem = msg("This link is incomplete: the part after # is missing. `esker link` prints it.");
    else void this.#more();
  }

  async #try(what: () => Promise<void>): Promise<void> {
    this.busy = true;
    this.problem = "";
    try {
      await what();
    } catch (error) {
      this.problem =
        error instanceof ApiError ? error.message : msg("Something went wrong. Reload the page and try again.");
      const dead = error instanceof ApiError && error.code === "not_keeper" && serverKey(deviceStore()) === this.key;
      if (dead) keepServerKey(deviceStore(), null);
    } finally {
      this.busy = false;
    }
  }

  #more(): Promise<void> {
    return this.#try(async () => {
      const known = this.terrains ?? [];
      const { total, terrains } = await api.kept(this.key, known.length);
      const here = new Set(known.map((t) => t.id));
      this.terrains = [...known, ...terrains.filter((t) => !here.has(t.id))];
      this.total = total;
      // From now on the start page of this device leads here.
      keepServerKey(deviceStore(), this.key);
    });
  }

  #open(id: string): Promise<void> {
    return this.#try(async () => {
      const opened = await api.openKept(this.key, id);
      window.location.assign(terrainPath(opened.id, opened.secret));
    });
  }

  protected override render(): TemplateResult {
    const { terrains } = this;
    return html`
      <main>
        <a class="brand" href="/"><img src="/favicon.svg" alt="" width="28" height="28" />Esker</a>
        <h1>${msg("Terrains of this server")}</h1>
        <p class="quiet">
          ${msg("Only you see this list: its link stands in a private file on the server's computer. Opening a terrain makes an owner link to it. Do not put this page on the projector.")}
        </p>
        <p class="problem" role="alert">${this.problem}</p>
        ${terrains === null && !this.problem ? html`<p role="status">${msg("Looking…")}</p>` : nothing}
        ${terrains?.length === 0 ? html`<p>${msg(html`There is no terrain yet. <a href="/">Make one</a>.`)}</p>` : nothing}
        <ul>
          ${terrains?.map((t) => this.#row(t))}
        </ul>
        ${
          terrains !== null && terrains.length < this.total
            ? html`<button class="btn outline" ?disabled=${this.busy} @click=${() => this.#more()}>
                ${msg(str`Show more (${this.total - terrains.length})`)}
              </button>`
            : nothing
        }
      </main>
    `;
  }

  #row(t: KeptTerrain): TemplateResult {
    const title = t.title || msg("Untitled terrain");
    const facts = [
      ago(Date.now() - 1000 * t.changed),
      t.clock === 1 ? msg("1 change") : msg(str`${t.clock} changes`),
      t.links === 1 ? msg("1 link") : msg(str`${t.links} links`),
      t.here === 0 ? "" : t.here === 1 ? msg("1 person here now") : msg(str`${t.here} people here now`),
    ];
    return html`<li>
      <span class="words"><strong>${title}</strong><span class="quiet">${facts.filter(Boolean).join(" · ")}</span></span>
      <button class="btn outline" aria-label=${msg(str`Open ${title} as its owner`)} ?disabled=${this.busy} @click=${() => this.#open(t.id)}>
        ${msg("Open")}
      </button>
    </li>`;
  }
}

customElements.define("esk-server", EskServer);

/** The page, to be put into the document. */
export function serverPage(key: string): HTMLElement {
  const page = document.createElement("esk-server") as EskServer;
  page.key = key;
  return page;
}
