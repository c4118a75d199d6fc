import "@awesome.me/webawesome/dist/components/dialog/dialog.js";
import { css, html, type TemplateResult } from "lit";
import { icon } from "./icons.ts";
import { friendlyName } from "./names.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { MEMBER_COLOURS } from "./storage.ts";
import { inkOn } from "./styles/colours.ts";
import { shared } from "./styles/shared.ts";

/** My name and colour, as the others see them. */
export class EskProfile extends SignalElement {
  static override properties = { stage: { attribute: false }, open: { type: Boolean } };
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

  declare stage: Stage;
  declare open: boolean;

  #save(event: SubmitEvent): void {
    event.preventDefault();
    const name = this.renderRoot.querySelector<HTMLInputElement>("#name")?.value ?? "";
    const { session } = this.stage;
    session.rename({ name, colour: session.me.value.colour });
    this.dispatchEvent(new CustomEvent("close"));
  }

  protected override render(): TemplateResult {
    const { session } = this.stage;
    const me = session.me.value;
    return html`
      <wa-dialog label="You" light-dismiss ?open=${this.open} @wa-after-hide=${() => this.dispatchEvent(new CustomEvent("close"))}>
        <form @submit=${this.#save}>
          <label>
            Name
            <input id="name" class="field" maxlength="80" autocomplete="nickname" placeholder=${friendlyName(session.client)} .value=${me.name} autofocus />
          </label>
          <div class="colours" role="radiogroup" aria-label="Colour">
            ${MEMBER_COLOURS.map(
              (c) => html`<button
                type="button"
                class="colour"
                role="radio"
                aria-checked=${c === me.colour}
                aria-label=${`Colour ${c}`}
                style=${`background:${c};color:${inkOn(c)}`}
                @click=${() => session.rename({ name: me.name, colour: c })}
              >
                ${c === me.colour ? icon("check") : null}
              </button>`,
            )}
          </div>
          <p class="quiet">The others see this name and colour at your cursor. It is kept on this device only.</p>
          <div class="end"><button class="btn primary">Done</button></div>
        </form>
      </wa-dialog>
    `;
  }
}

customElements.define("esk-profile", EskProfile);
