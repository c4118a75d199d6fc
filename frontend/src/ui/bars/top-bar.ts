import { msg } from "@lit/localize";
import "@awesome.me/webawesome/dist/components/dropdown/dropdown.js";
import "@awesome.me/webawesome/dist/components/dropdown-item/dropdown-item.js";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import { chooseTheme, type ThemeChoice, themeChoice } from "../../app/device/theme.ts";
import type { Status } from "../../app/status.ts";
import { type KeyedAction, keyText } from "../../app/words/keys.ts";
import type { Doc } from "../../doc/document.ts";
import type { Lesson, Role } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { blurOnEnter } from "../panels/stroke-panel.ts";
import { shared } from "../styles/shared.ts";

/** The parts of the page that the top bar asks. */
export type PageCommand =
  | "share"
  | "profile"
  | "help"
  | "panel"
  | "download"
  | "export"
  | "about"
  | "delete"
  | "add-ground"
  | "layers"
  | "history"
  | "lesson";

const THEMES: readonly { readonly value: ThemeChoice; readonly label: string }[] = [
  { value: "system", label: msg("Colours like the system") },
  { value: "light", label: msg("Light") },
  { value: "dark", label: msg("Dark") },
];

/** Title, saved state, sharing, menu; people in the slot `people`. Fires `command`, and `retitle` with a new title. */
export class EskTopBar extends SignalElement {
  static override properties = {
    doc: { attribute: false },
    status: { attribute: false },
    canEdit: { attribute: false },
    myRole: { attribute: false },
    lesson: { attribute: false },
    actions: { attribute: false },
    panelOpen: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: flex;
        justify-content: space-between;
        align-items: flex-start;
        gap: var(--esk-gap);
        pointer-events: none;
      }
      .panel {
        display: flex;
        align-items: center;
        gap: 4px;
        height: 48px;
        padding: 0 6px;
        pointer-events: auto;
        min-width: 0;
      }
      .home {
        flex: none;
        display: grid;
        place-items: center;
        width: 36px;
        height: 36px;
        border-radius: 10px;
      }
      .home:hover {
        background: var(--esk-hover);
      }
      .title {
        width: 190px;
        min-width: 60px;
        height: 34px;
        border-color: transparent;
        background: transparent;
        font-size: 0.9375rem;
        font-weight: 620;
        text-overflow: ellipsis;
      }
      .title:hover:not(:disabled),
      .title:focus {
        border-color: var(--esk-line-strong);
        background: var(--esk-field);
      }
      .title:disabled {
        opacity: 1;
      }
      .state {
        display: inline-flex;
        align-items: center;
        gap: 6px;
        padding: 0 10px 0 8px;
        font-size: 0.8125rem;
        white-space: nowrap;
        color: var(--esk-quiet);
      }
      .state.ok .icon {
        color: var(--esk-ok);
      }
      .state.warn {
        color: var(--esk-warn);
      }
      .state.bad {
        color: var(--esk-bad);
      }
      .state.busy .icon {
        animation: pulse 1.1s ease-in-out infinite alternate;
      }
      @keyframes pulse {
        from {
          opacity: 0.35;
        }
      }
      ::slotted(*) {
        padding: 0 6px 0 4px;
      }
      .theme {
        font-size: 0.75rem;
        color: var(--esk-quiet);
        padding: 4px 12px;
      }
      wa-dropdown-item .icon {
        color: var(--esk-quiet);
      }
      @media (max-width: 720px) {
        :host {
          gap: 6px;
        }
        .panel {
          height: 44px;
          padding: 0 4px;
        }
        .title {
          width: auto;
          flex: 1 1 90px;
          padding: 0 4px;
        }
        .left {
          flex: 1 1 0;
        }
        .right {
          flex: none;
        }
        .state span,
        .share span {
          display: none;
        }
        .state {
          padding: 0 6px;
        }
        .share {
          flex: none;
          width: 36px;
          padding: 0;
        }
        .icon-btn {
          flex: none;
        }
        ::slotted(*) {
          padding: 0 2px;
        }
      }
      @media (pointer: coarse) {
        .panel {
          height: 48px;
        }
        .home,
        .share {
          min-width: 40px;
          height: 40px;
        }
        .title {
          height: 40px;
        }
      }
    `,
  ];

  declare doc: ReadonlySignal<Doc | null>;
  declare status: ReadonlySignal<Status>;
  declare canEdit: ReadonlySignal<boolean>;
  declare myRole: ReadonlySignal<Role | null>;
  declare lesson: ReadonlySignal<Lesson>;
  declare actions: ReadonlyMap<string, KeyedAction>;
  declare panelOpen: boolean;

  #command(command: PageCommand): void {
    this.dispatchEvent(new CustomEvent<PageCommand>("command", { detail: command }));
  }

  #retitle(event: Event): void {
    const title = (event.target as HTMLInputElement).value.trim();
    this.dispatchEvent(new CustomEvent<string>("retitle", { detail: title }));
  }

  #menu(event: CustomEvent<{ item: { value: string } }>): void {
    const value = event.detail.item.value;
    const theme = THEMES.find((t) => `theme-${t.value}` === value);
    if (theme) chooseTheme(theme.value);
    else this.#command(value as PageCommand);
    // The item has ticked itself: ticks follow the state, also where the choice changed nothing.
    this.requestUpdate();
  }

  protected override render(): TemplateResult {
    const title = this.doc.value?.settings.title ?? "";
    return html`
      <div class="panel left">
        <a class="home" href="/" title=${msg("All terrains")} aria-label=${msg("Start page")}><img src="/favicon.svg" alt="" width="24" height="24" /></a>
        <input
          class="field title"
          aria-label=${msg("Title of the terrain")}
          maxlength="80"
          placeholder=${msg("Untitled terrain")}
          .value=${title}
          ?disabled=${!this.canEdit.value}
          @change=${this.#retitle}
          @keydown=${blurOnEnter}
        />
        ${this.#state()}
      </div>
      <div class="panel right">
        <slot name="people"></slot>
        <button class="btn primary share" aria-label=${msg("Share")} @click=${() => this.#command("share")}>
          ${icon("share")} <span>${msg("Share")}</span>
        </button>
        <button
          class="icon-btn small"
          aria-label=${msg("Inspector")}
          title=${keyText(msg("Inspector"), this.actions.get("inspector"))}
          aria-pressed=${this.panelOpen}
          @click=${() => this.#command("panel")}
        >
          ${icon("settings")}
        </button>
        ${this.#more()}
      </div>
    `;
  }

  #state(): TemplateResult {
    const { tone, icon: name, text, detail } = this.status.value;
    return html`<span class="state ${tone}" role="status" title=${detail} data-tone=${tone}>
      ${icon(name)}<span>${text}</span>
    </span>`;
  }

  #more(): TemplateResult {
    return html`
      <wa-dropdown placement="bottom-end" @wa-select=${this.#menu}>
        <button slot="trigger" class="icon-btn small" aria-label=${msg("More")} title=${msg("More")}>${icon("ellipsis")}</button>
        <wa-dropdown-item value="add-ground" ?disabled=${!this.canEdit.value}>${msg("Add real ground…")}</wa-dropdown-item>
        <wa-dropdown-item value="layers">${msg("Layers of real ground")}</wa-dropdown-item>
        <wa-dropdown-item value="history">${msg("History")}</wa-dropdown-item>
        ${this.lesson.value.conducts ? html`<wa-dropdown-item value="lesson">${msg("Lead the lesson")}</wa-dropdown-item>` : nothing}
        <wa-dropdown-item value="export">${msg("Export for other programs…")}</wa-dropdown-item>
        <wa-dropdown-item value="download">${msg("Download a copy (.esker)")}</wa-dropdown-item>
        <wa-dropdown-item value="help">${msg("Keys and help")}</wa-dropdown-item>
        <wa-dropdown-item value="about">${msg("About this terrain")}</wa-dropdown-item>
        ${
          this.myRole.value === "owner"
            ? html`<wa-dropdown-item value="delete">${msg("Delete this terrain…")}</wa-dropdown-item>`
            : nothing
        }
        ${THEMES.map(
          (
            t,
          ) => html`<wa-dropdown-item type="checkbox" value=${`theme-${t.value}`} .checked=${live(themeChoice.value === t.value)}>
            ${t.label}
          </wa-dropdown-item>`,
        )}
      </wa-dropdown>
    `;
  }
}

customElements.define("esk-top-bar", EskTopBar);
