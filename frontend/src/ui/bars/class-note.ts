import { msg, str } from "@lit/localize";
import { effect, type ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import { Following } from "../../app/server/classes/following.ts";
import type { InClass, Role } from "../../generated/contract.ts";
import type { ConnectionState } from "../../net/connection.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** In a copy of a class: that it is frozen, and where the teacher leads. */
export class EskClassNote extends SignalElement {
  static override properties = {
    told: { attribute: false },
    standing: { attribute: false },
    state: { attribute: false },
    terrain: { attribute: false },
    secret: { attribute: false },
  };
  static override styles = [
    shared,
    css`
      :host {
        position: absolute;
        inset: 64px 12px auto;
        display: grid;
        justify-items: center;
        gap: 8px;
        z-index: 3;
        pointer-events: none;
      }
      .note {
        display: flex;
        flex-wrap: wrap;
        align-items: center;
        justify-content: center;
        gap: 8px 12px;
        max-width: 560px;
        padding: 8px 10px 8px 16px;
        pointer-events: auto;
        font-weight: 550;
      }
    `,
  ];

  /** What the server said of the class whose copy this is. */
  declare told: ReadonlySignal<InClass | null>;
  declare standing: ReadonlySignal<Role | null>;
  declare state: ReadonlySignal<ConnectionState>;
  declare terrain: string;
  declare secret: string;
  #following: Following | null = null;
  #stop: (() => void) | null = null;

  protected override firstUpdated(): void {
    const following = new Following(this.terrain, this.secret);
    this.#following = following;
    this.#stop = effect(() => {
      if (this.standing.value !== "owner") following.told(this.told.value, this.state.value === "closed");
    });
    this.requestUpdate();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#stop?.();
    this.#following?.stop();
  }

  protected override render(): TemplateResult | typeof nothing {
    const told = this.told.value;
    const following = this.#following;
    if (told === null || following === null || this.standing.value === "owner") return nothing;
    const show = following.invitation.value;
    if (show !== null)
      return html`<div class="note panel" role="alert">
        ${icon("eye")}<span>${msg(str`Your teacher shows the terrain of ${show.name}. Your page goes there.`)}</span>
        <button class="btn primary" @click=${() => following.go()}>${msg("Look now")}</button>
      </div>`;
    if (following.away.value)
      return html`<div class="note panel" role="status">
        ${icon("eye")}<span>${msg(str`You look at the terrain of ${told.show?.name ?? msg("somebody else")}. Yours waits for you.`)}</span>
      </div>`;
    if (told.frozen)
      return html`<div class="note panel" role="status">
        ${icon("lock")}<span>${msg("Your teacher has frozen your terrain: nobody draws for now.")}</span>
      </div>`;
    return nothing;
  }
}

customElements.define("esk-class-note", EskClassNote);
