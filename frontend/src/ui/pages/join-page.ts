import { msg, str } from "@lit/localize";
import { html, LitElement, nothing, type TemplateResult } from "lit";
import { newSecret } from "../../app/device/share-links.ts";
import { deviceStore, identity, rememberIdentity } from "../../app/device/storage.ts";
import { ApiError, api, type ClassDoor } from "../../app/server/api.ts";
import { classApi } from "../../app/server/classes/class-api.ts";
import { forgetSeat, type KeptSeat, keepSeat, keptSeats, seatIn } from "../../app/server/classes/seats.ts";
import { terrainPath } from "../../app/server/links.ts";
import { MAX_NAME_LENGTH } from "../../generated/contract.ts";
import { languageChoice } from "../controls/language-choice.ts";
import { shared } from "../styles/shared.ts";
import { joinStyles } from "./wall-styles.ts";

const AGAIN_MS = 3000;

/** `/join#CODE`: into a class, with a name and one's own copy; or back into it, on the same device. */
export class EskJoin extends LitElement {
  static override styles = [shared, joinStyles];
  static override properties = {
    door: { state: true },
    seat: { state: true },
    problem: { state: true },
    busy: { state: true },
  };

  code = "";
  declare door: ClassDoor | null;
  /** A seat that this device has already. */
  declare seat: KeptSeat | null;
  declare problem: string;
  declare busy: boolean;

  readonly #store = deviceStore();
  #again: ReturnType<typeof setTimeout> | undefined;

  constructor() {
    super();
    this.door = null;
    this.seat = null;
    this.problem = "";
    this.busy = false;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    document.title = msg("Join a class · Esker");
    void this.#knock();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    clearTimeout(this.#again);
  }

  /** Does something; where too many come at once it comes again by itself. */
  async #try(what: () => Promise<void>): Promise<void> {
    clearTimeout(this.#again);
    this.busy = true;
    this.problem = "";
    try {
      await what();
    } catch (error) {
      this.problem =
        error instanceof ApiError ? error.message : msg("Something went wrong. Reload the page and try again.");
      if (error instanceof ApiError && error.code === "rate_limited") {
        this.problem = msg("Many come in at once. You are next in a moment.");
        this.#again = setTimeout(() => void this.#try(what), AGAIN_MS);
        return;
      }
    }
    this.busy = false;
  }

  #knock(): Promise<void> {
    return this.#try(async () => {
      if (this.code === "") {
        this.seat = keptSeats(this.#store)[0] ?? null;
        if (this.seat === null) window.location.replace("/");
        return;
      }
      const door = await api.join(this.code);
      if ("secret" in door) {
        window.location.replace(terrainPath(door.id, door.secret));
        return;
      }
      this.seat = seatIn(this.#store, door.class);
      this.door = door;
    });
  }

  #back(seat: KeptSeat): Promise<void> {
    return this.#try(async () => {
      try {
        const { id } = await classApi.seat(seat.secret);
        window.location.assign(terrainPath(id, seat.secret));
      } catch (error) {
        if (error instanceof ApiError && error.code === "no_seat") {
          forgetSeat(this.#store, seat.lesson);
          this.seat = null;
        }
        throw error;
      }
    });
  }

  #come(event: SubmitEvent): void {
    event.preventDefault();
    const { door } = this;
    if (door === null || this.busy) return;
    const form = new FormData(event.target as HTMLFormElement);
    const name = String(form.get("name") ?? "").trim();
    const group = form.get("group");
    const secret = newSecret();
    void this.#try(async () => {
      // Kept before it is asked for: an answer that is lost must not cost a second copy.
      const kept = { lesson: door.class, title: door.title, secret, name, at: Date.now() };
      keepSeat(this.#store, kept);
      const number = group === null || group === "" ? {} : { number: Number(group) };
      try {
        const seat = await classApi.sit(door.class, { code: this.code, seat: secret, name, ...number });
        if (name !== "") rememberIdentity(this.#store, { ...identity(this.#store, Math.random, "join"), name });
        window.location.assign(terrainPath(seat.id, secret));
      } catch (error) {
        if (error instanceof ApiError && error.code !== "unreachable") forgetSeat(this.#store, door.class);
        throw error;
      }
    });
  }

  protected override render(): TemplateResult {
    const { door, seat } = this;
    return html`<main class="panel">
      <a class="brand" href="/"><img src="/favicon.svg" alt="" width="28" height="28" />Esker</a>
      <h1>${door?.title || seat?.title || msg("Join a class")}</h1>
      ${seat ? this.#welcomeBack(seat) : door ? this.#form(door) : nothing}
      <p class="problem" role="alert">${this.problem}</p>
      ${!door && !seat && this.problem ? html`<a class="btn outline" href="/">${msg("Type the code again")}</a>` : nothing}
      ${!door && !seat && !this.problem ? html`<p role="status">${msg("Looking…")}</p>` : nothing}
      <footer>${languageChoice()}</footer>
    </main>`;
  }

  #welcomeBack(seat: KeptSeat): TemplateResult {
    return html`<div class="choices">
      <p>${msg("This device has a terrain in this class already.")}</p>
      <button class="btn primary big" ?disabled=${this.busy} @click=${() => this.#back(seat)}>
        ${seat.name ? msg(str`Go on as ${seat.name}`) : msg("Go on")}
      </button>
      ${
        this.door
          ? html`<button
              class="btn outline"
              @click=${() => {
                this.seat = null;
              }}
            >
              ${msg("I am somebody else")}
            </button>`
          : nothing
      }
    </div>`;
  }

  #form(door: ClassDoor): TemplateResult {
    return html`<form @submit=${this.#come}>
      <label>
        ${msg("What are you called?")}
        <input class="field" name="name" maxlength=${MAX_NAME_LENGTH} autocomplete="off" autofocus />
      </label>
      ${
        door.together > 1
          ? html`<fieldset>
              <legend>${msg("Who do you work with?")}</legend>
              <label><input type="radio" name="group" value="" checked /> ${msg("Whoever has room")}</label>
              ${door.groups.map(
                (group) => html`<label>
                  <input type="radio" name="group" value=${group.number} />
                  ${msg(str`With ${group.names.filter(Boolean).join(", ") || msg(str`group ${group.number}`)}`)}
                </label>`,
              )}
              <label><input type="radio" name="group" value="0" /> ${msg("A new group")}</label>
            </fieldset>`
          : nothing
      }
      <button class="btn primary big" ?disabled=${this.busy}>${this.busy ? msg("Making your terrain…") : msg("Start")}</button>
      <p class="quiet">${msg("A first name or a nickname will do, or none. Your teacher and your group see it.")}</p>
    </form>`;
  }
}

customElements.define("esk-join", EskJoin);

/** The page, to be put into the document. */
export function joinPage(code: string): HTMLElement {
  const page = document.createElement("esk-join") as EskJoin;
  page.code = code;
  return page;
}
