import { msg, str } from "@lit/localize";
import { computed, signal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { deviceStore } from "../../app/device/storage.ts";
import { ViewChoices } from "../../app/device/view-choices.ts";
import { type ComparedOverlay, type ComparedSide, Comparison } from "../../app/lesson/comparison.ts";
import { copyName } from "../../app/server/classes/copies.ts";
import type { WallConnection } from "../../app/server/classes/wall.ts";
import { icon } from "../controls/icons.ts";
import "../controls/segmented.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";
import { compareStyles } from "./wall-compare-styles.ts";

const OVERLAYS = [
  { value: "none", label: msg("Ground") },
  { value: "contours", label: msg("Contours") },
  { value: "difference", label: msg("Difference") },
];
const VIEWS = [
  { value: "orbit", label: msg("3D") },
  { value: "map", label: msg("Map") },
];

/** Two copies side by side, under one camera: what moves one moves the other. Fires `close`. */
export class EskWallCompare extends SignalElement {
  static override styles = [shared, compareStyles];
  static override properties = { wall: { attribute: false }, numbers: { attribute: false } };

  declare wall: WallConnection;
  declare numbers: readonly number[];
  readonly #comparison = signal<Comparison | null>(null);

  constructor() {
    super();
    this.numbers = [];
  }

  override connectedCallback(): void {
    super.connectedCallback();
    window.addEventListener("keydown", this.#key);
  }

  protected override firstUpdated(): void {
    const places = [...this.renderRoot.querySelectorAll<HTMLElement>(".picture")];
    const [left, right] = this.numbers.map((number, k) => this.#side(number, places[k]!));
    if (!left || !right) return;
    const comparison = new Comparison([left, right], new ViewChoices(deviceStore()));
    this.#comparison.value = comparison;
    // For tests, which look at what both show.
    Object.assign(window, { __compared: comparison });
    void comparison.start();
    this.renderRoot.querySelector<HTMLElement>(".pair")?.focus();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    window.removeEventListener("keydown", this.#key);
    this.#comparison.peek()?.dispose();
    Object.assign(window, { __compared: null });
  }

  #side(number: number, viewport: HTMLElement): ComparedSide | null {
    const tiles = this.wall.ground(number);
    const copy = this.wall.copies.peek().get(number);
    if (tiles === undefined || copy === undefined) return null;
    const settings = computed(() => this.wall.copies.value.get(number)?.settings ?? copy.settings);
    return { tiles, settings, viewport };
  }

  readonly #key = (event: KeyboardEvent): void => {
    if (event.key !== "Escape") return;
    event.preventDefault();
    this.#close();
  };

  #close(): void {
    this.dispatchEvent(new CustomEvent("close"));
  }

  protected override render(): TemplateResult {
    const comparison = this.#comparison.value;
    const copies = this.wall.copies.value;
    return html`
      <header>
        ${comparison === null ? html`<span class="grow"></span>` : this.#choices(comparison)}
        <button class="btn outline" @click=${() => this.#close()}>${icon("xmark")} ${msg("Back to the wall")}</button>
      </header>
      <div
        class="pair"
        tabindex="0"
        role="application"
        aria-label=${msg("Two copies side by side. Arrow keys move, comma and full stop turn, plus and minus come closer, Home shows all, Escape closes.")}
      >
        ${this.numbers.map((number) => {
          const copy = copies.get(number);
          return html`<figure>
            <div class="picture"></div>
            <figcaption>${copy ? copyName(copy) : ""}</figcaption>
          </figure>`;
        })}
      </div>
      ${comparison === null ? nothing : this.#words(comparison)}
    `;
  }

  #choices({ overlay, camera, reason }: Comparison): TemplateResult {
    const mode = camera.state.value.mode === "map" ? "map" : "orbit";
    return html`
      <esk-segmented
        label=${msg("What is shown")}
        .segments=${OVERLAYS}
        .value=${overlay.value}
        @pick=${(e: CustomEvent<ComparedOverlay>) => {
          overlay.value = e.detail;
        }}
      ></esk-segmented>
      ${
        reason.value === null
          ? html`<esk-segmented
              label=${msg("View")}
              .segments=${VIEWS}
              .value=${mode}
              @pick=${(e: CustomEvent<"orbit" | "map">) => camera.setMode(e.detail)}
            ></esk-segmented>`
          : nothing
      }
      <span class="grow"></span>
    `;
  }

  /** What the colours mean, or how one moves; and why it is a map where it is one. */
  #words({ overlay, difference, reason }: Comparison): TemplateResult {
    const apart = difference.value;
    return html`<footer>
      ${
        overlay.value === "difference" && apart !== null
          ? html`<p>
              <span class="spot high"></span> ${msg("higher than the other")}
              <span class="spot low"></span> ${msg("lower")} · ${msg(str`full colour from ${metres(apart.fullM)} m`)}
            </p>`
          : html`<p>${msg("Drag to turn, with Shift to move, wheel or pinch to come closer: both follow.")}</p>`
      }
      ${reason.value === null ? nothing : html`<p role="status">${reason.value}</p>`}
    </footer>`;
  }
}

function metres(value: number): string {
  return String(value < 10 ? Math.round(value * 10) / 10 : Math.round(value));
}

customElements.define("esk-wall-compare", EskWallCompare);
