import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/qr-code/qr-code.js";
import { html, LitElement, nothing, type TemplateResult } from "lit";
import { deviceStore, type RecentTerrain, recentTerrains } from "../../app/device/storage.ts";
import { ApiError, api, type RoomFacts } from "../../app/server/api.ts";
import { codeWords } from "../../app/server/classes/copies.ts";
import { joinLink, roomPath } from "../../app/server/links.ts";
import { icon } from "../controls/icons.ts";
import { shared } from "../styles/shared.ts";
import { roomStyles } from "./room-styles.ts";

const POLL_MS = 3000;
/** A code that ends within this is prolonged, where this device has the link by which it was made. */
const PROLONG_S = 300;
const MOST_OFFERED = 3;

/** `/room#CODE`: for the projector. It shows a code, its picture, and how many are in; it knows no link. */
export class EskRoom extends LitElement {
  static override styles = [shared, roomStyles];
  static override properties = {
    code: { attribute: false },
    facts: { state: true },
    problem: { state: true },
    looking: { state: true },
    busy: { state: true },
  };

  declare code: string;
  declare facts: RoomFacts | null;
  declare problem: string;
  /** Whether the server was asked about the code and has not answered yet. */
  declare looking: boolean;
  declare busy: boolean;

  readonly #store = deviceStore();
  #timer: ReturnType<typeof setTimeout> | undefined;
  /** Whether this device's link of the terrain may prolong the code, as far as it was tried. */
  #prolongs = true;

  constructor() {
    super();
    this.code = "";
    this.facts = null;
    this.problem = "";
    this.looking = false;
    this.busy = false;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    document.title = msg("For the projector · Esker");
    this.looking = this.code !== "";
    if (this.looking) void this.#look();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    clearTimeout(this.#timer);
  }

  /** Asks what the code opens and who is in, again and again. */
  async #look(): Promise<void> {
    clearTimeout(this.#timer);
    try {
      this.facts = await api.room(this.code);
      this.problem = "";
      await this.#prolong(this.facts);
    } catch (error) {
      const refused = error instanceof ApiError && error.code === "bad_code";
      if (refused) this.facts = null;
      this.problem = refused
        ? msg(str`The code ${codeWords(this.code)} has ended, or was never one.`)
        : error instanceof ApiError
          ? error.message
          : msg("Something went wrong. Reload the page.");
      if (refused) return;
    } finally {
      this.looking = false;
    }
    if (this.isConnected) this.#timer = setTimeout(() => void this.#look(), POLL_MS);
  }

  async #prolong(facts: RoomFacts): Promise<void> {
    const known = recentTerrains(this.#store).find((each) => each.id === facts.terrain);
    if (!this.#prolongs || facts.expires_s > PROLONG_S || known === undefined) return;
    try {
      await api.prolong(known.id, known.secret, this.code);
    } catch {
      this.#prolongs = false;
    }
  }

  async #make(of: RecentTerrain): Promise<void> {
    this.busy = true;
    this.problem = "";
    try {
      const { code } = await api.code(of.id, of.secret, "edit");
      window.location.assign(roomPath(code));
    } catch (error) {
      this.problem = error instanceof ApiError ? error.message : msg("Something went wrong. Try again.");
    } finally {
      this.busy = false;
    }
  }

  readonly #typed = (event: SubmitEvent): void => {
    event.preventDefault();
    const code = String(new FormData(event.target as HTMLFormElement).get("code") ?? "").replace(/[\s-]/g, "");
    if (code !== "") window.location.assign(roomPath(code.toUpperCase()));
  };

  protected override render(): TemplateResult {
    return this.facts === null ? this.#nothingRuns() : this.#running(this.facts);
  }

  #running(facts: RoomFacts): TemplateResult {
    const { origin } = window.location;
    const { here } = facts;
    const doing =
      facts.kind === "class"
        ? msg("for a copy of your own")
        : facts.role === "view"
          ? msg("to watch")
          : msg("to draw along");
    return html`<main class="running">
      <header>
        <h1>${facts.title || "Esker"}</h1>
        <button class="btn outline fill" @click=${() => document.documentElement.requestFullscreen?.()}>
          ${icon("monitor")} ${msg("Fill the screen")}
        </button>
      </header>
      <section class="way" aria-label=${msg("The way in")}>
        <div class="words">
          <p>${msg("Open", { id: "open-address" })}</p>
          <p class="address" style=${`--letters: ${origin.length}`}>${origin}</p>
          <p>${msg(str`and type, ${doing},`)}</p>
          <p class="code" style=${`--letters: ${codeWords(this.code).length}`} aria-label=${msg(str`Code ${[...this.code].join(" ")}`)}>
            ${codeWords(this.code)}
          </p>
        </div>
        <figure>
          <wa-qr-code .value=${joinLink(origin, this.code)} label=${msg(str`QR code: ${origin}, code ${this.code}`)} size="560" error-correction="M"></wa-qr-code>
          <figcaption>${msg("or scan")}</figcaption>
        </figure>
      </section>
      <footer>
        <p class="here" role="status">
          ${here === 0 ? msg("Nobody is in yet") : html`<strong>${here}</strong> ${here === 1 ? msg("is in") : msg("are in")}`}
        </p>
        ${
          facts.warned
            ? html`<p class="warned">
                ${msg(html`The browser warns you? Here that is expected. <b>Advanced</b>, then <b>Proceed</b>; on iPads <b>Show Details</b>, then <b>visit this website</b>. <a href="/help/warning">Why</a>`)}
              </p>`
            : nothing
        }
        ${this.problem === "" ? nothing : html`<p class="problem" role="alert">${this.problem}</p>`}
      </footer>
    </main>`;
  }

  #nothingRuns(): TemplateResult {
    const own = recentTerrains(this.#store)
      .filter((each) => each.role === "owner")
      .slice(0, MOST_OFFERED);
    if (this.looking) return html`<main class="still"><p role="status">${msg("Looking…")}</p></main>`;
    return html`<main class="still">
      <a class="brand" href="/"><img src="/favicon.svg" alt="" width="28" height="28" />Esker</a>
      <h1>${msg("For the projector")}</h1>
      <p class="problem" role="alert">${this.problem}</p>
      <p>
        ${msg(html`This page shows a class the way in, and no link of yours. No code is running here: open your terrain, press <b>Share</b>, then <b>Show a code</b>, or <b>Make a class</b> for a copy each. Then type that code here.`)}
      </p>
      <form @submit=${this.#typed}>
        <label>${msg("Code")} <input class="field" name="code" autocomplete="off" autocapitalize="characters" maxlength="20" required /></label>
        <button class="btn primary">${msg("Show it")}</button>
      </form>
      ${
        own.length === 0
          ? nothing
          : html`<p>${msg("Or make a code of a terrain that this device owns:")}</p>
              <ul>
                ${own.map(
                  (each) => html`<li>
                    <button class="btn outline" ?disabled=${this.busy} @click=${() => this.#make(each)}>
                      ${icon("key")} ${each.title || msg("Untitled terrain")}
                    </button>
                  </li>`,
                )}
              </ul>`
      }
      <p class="quiet"><a href="/help/warning">${msg("The browser's warning")}</a> · <a href="/help/devices">${msg("School devices")}</a></p>
    </main>`;
  }
}

customElements.define("esk-room", EskRoom);

/** The page, to be put into the document. */
export function roomPage(code: string): HTMLElement {
  const page = document.createElement("esk-room") as EskRoom;
  page.code = code;
  return page;
}
