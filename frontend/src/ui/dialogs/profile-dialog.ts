import { msg, str } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, type TemplateResult } from "lit";
import { friendlyName } from "../../app/device/names.ts";
import { type Identity, MEMBER_COLOURS } from "../../app/device/storage.ts";
import { inkOn } from "../../app/view/colours.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** My name and colour, as the others see them. Fires `rename` with new ones, and `close`. */
export class EskProfile extends SignalElement {
  static override properties = { me: { attribute: false }, client: { attribute: false }, open: { type: Boolean } };
  static override styles = [
    shared,
    css`
      wa-dialog {
        --width: 380px;
      }
      form {
        display: grid;
        gap: 16px;
      }
      label {
        display: grid;
        gap: 6px;
        font-size: 0.8125rem;
        font-weight: 550;
      }
      .colours {
        display: flex;
        gap: 8px;
        flex-wrap: wrap;
      }
      .colour {
        width: 32px;
        height: 32px;
        padding: 0;
        display: grid;
        place-items: center;
        border: 0;
        border-radius: 50%;
        cursor: pointer;
      }
      .end {
        display: flex;
        justify-content: flex-end;
      }
    `,
  ];

  declare me: ReadonlySignal<Identity>;
  /** My client: gives a name to whoever has none. */
  declare client: string;
  declare open: boolean;

  #rename(who: Identity): void {
    this.dispatchEvent(new CustomEvent<Identity>("rename", { detail: who }));
  }

  #save(event: SubmitEvent): void {
    event.preventDefault();
    const name = this.renderRoot.querySelector<HTMLInputElement>("#name")?.value ?? "";
    this.#rename({ name, colour: this.me.value.colour });
    this.dispatchEvent(new CustomEvent("close"));
  }

  protected override render(): TemplateResult {
    const me = this.me.value;
    return html`
      <wa-dialog label=${msg("You")} light-dismiss ?open=${this.open} @wa-after-hide=${() => this.dispatchEvent(new CustomEvent("close"))}>
        <form @submit=${this.#save}>
          <label>
            ${msg("Name")}
            <input id="name" class="field" maxlength="80" autocomplete="nickname" placeholder=${friendlyName(this.client)} .value=${me.name} autofocus />
          </label>
          <div class="colours" role="radiogroup" aria-label=${msg("Colour")}>
            ${MEMBER_COLOURS.map(
              (c) => html`<button
                type="button"
                class="colour"
                role="radio"
                aria-checked=${c === me.colour}
                aria-label=${msg(str`Colour ${c}`)}
                style=${`background:${c};color:${inkOn(c)}`}
                @click=${() => this.#rename({ name: me.name, colour: c })}
              >
                ${c === me.colour ? icon("check") : null}
              </button>`,
            )}
          </div>
          <p class="quiet">${msg("The others see this name and colour at your cursor. It is kept on this device only.")}</p>
          <div class="end"><button class="btn primary">${msg("Done")}</button></div>
        </form>
      </wa-dialog>
    `;
  }
}

customElements.define("esk-profile", EskProfile);
