import { msg, str } from "@lit/localize";
import { fixed } from "../../core/language.ts";
import "@awesome.me/webawesome/dist/components/divider/divider.js";
import "@awesome.me/webawesome/dist/components/dropdown/dropdown.js";
import "@awesome.me/webawesome/dist/components/dropdown-item/dropdown-item.js";
import { css, html, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import { QUALITIES } from "../../app/device/quality-choice.ts";
import { OVERLAYS } from "../../app/view/overlays.ts";
import { keyText } from "../../app/words/keys.ts";
import type { QualityMode, Scene } from "../../core/types.ts";
import { icon } from "../controls/icons.ts";
import "../controls/segmented.ts";
import type { ReadonlySignal } from "@preact/signals-core";
import type { ViewChoices } from "../../app/device/view-choices.ts";
import type { RendererInfo } from "../../app/view/graphics.ts";
import type { CameraState } from "../../core/types.ts";
import type { Action } from "../../input/keys/action.ts";
import type { RulerKind } from "../../input/tools/ruler.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";
import { compassButton } from "./compass.ts";
import "./view-options.ts";

/**
 * How the terrain is looked at: camera mode, the whole terrain, overlays. Fires `overlay` and `quality` with what was chosen,
 * and `strokes` to show or hide them.
 */
export class EskViewBar extends SignalElement {
  static override properties = {
    view: { attribute: false },
    overlay: { attribute: false },
    showStrokes: { attribute: false },
    quiet: { attribute: false },
    quality: { attribute: false },
    coarsenedPx: { attribute: false },
    renderer: { attribute: false },
    measuring: { attribute: false },
    choices: { attribute: false },
    actions: { attribute: false },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: flex;
        align-items: center;
        gap: 2px;
        padding: 4px;
      }
      esk-segmented {
        margin-right: 2px;
      }
      @media (max-width: 460px) {
        :host {
          gap: 0;
          padding: 2px;
        }
        esk-segmented {
          margin-right: 0;
        }
      }
      @media (max-width: 380px) {
        .icon-btn.small {
          width: 36px;
        }
      }
      .heading {
        display: block;
        padding: 2px 12px 4px;
        color: var(--esk-quiet);
      }
    `,
  ];

  declare view: ReadonlySignal<CameraState>;
  declare overlay: ReadonlySignal<Scene["overlay"]>;
  declare showStrokes: ReadonlySignal<boolean>;
  /** Strokes of a terrain that was just opened are not shown yet. */
  declare quiet: ReadonlySignal<boolean>;
  declare quality: ReadonlySignal<QualityMode>;
  /** Screen-error bound of the picture, pixels, where this device has no room for the chosen one. */
  declare coarsenedPx: ReadonlySignal<number | null>;
  declare renderer: ReadonlySignal<RendererInfo | null>;
  /** How this device shows terrains. */
  declare choices: ViewChoices;
  /** What is measured; null: nothing. */
  declare measuring: ReadonlySignal<RulerKind | null>;
  /** Actions that the buttons run. */
  declare actions: ReadonlyMap<string, Action>;

  #run(id: string): void {
    this.actions.get(id)?.run();
  }

  #fire(name: string, detail?: string): void {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  #overlay(event: CustomEvent<{ item: { value: string } }>): void {
    const value = event.detail.item.value;
    const quality = QUALITIES.find((q) => q.value === value);
    if (quality) this.#fire("quality", quality.value);
    else if (value === "strokes") this.#fire("strokes");
    else this.#fire("overlay", value);
    // The item has ticked itself: ticks follow the state, also where the choice changed nothing.
    this.requestUpdate();
  }

  #qualities(chosen: QualityMode): TemplateResult {
    const coarsened = this.coarsenedPx.value;
    return html`
      <wa-divider></wa-divider>
      <small class="heading">${msg("Quality")}</small>
      ${
        coarsened === null
          ? null
          : html`<small class="heading" role="status">${msg(str`This view is held to ${fixed(coarsened, 1)} px: no room for finer ground`)}</small>`
      }
      ${QUALITIES.map(
        (q) => html`
          <wa-dropdown-item type="checkbox" value=${q.value} title=${q.title} .checked=${live(chosen === q.value)}>${q.label}</wa-dropdown-item>
        `,
      )}
    `;
  }

  protected override render(): TemplateResult {
    const { actions, overlay, showStrokes, quiet, quality, renderer } = this;
    const flat = renderer.value?.kind === "map";
    const modes = [
      { value: "orbit", label: msg("Orbit"), icon: "orbit", title: keyText(msg("Orbit"), actions.get("camera-orbit")) },
      { value: "fly", label: msg("Fly"), icon: "fly", title: keyText(msg("Fly"), actions.get("camera-fly")) },
      { value: "map", label: msg("Map"), icon: "map", title: keyText(msg("Map"), actions.get("camera-map")) },
    ];
    return html`
      ${
        flat
          ? null
          : html`<esk-segmented
              compact
              label=${msg("Camera")}
              .segments=${modes}
              .value=${this.view.value.mode}
              @pick=${(e: CustomEvent<string>) => this.#run(`camera-${e.detail}`)}
            ></esk-segmented>`
      }
      ${compassButton(this.view.value, keyText(msg("North up"), actions.get("north")), () => this.#run("north"))}
      <button
        class="icon-btn small"
        aria-label=${msg("See the whole terrain")}
        title=${keyText(msg("See the whole terrain"), actions.get("home"))}
        @click=${() => this.#run("home")}
      >
        ${icon("frame")}
      </button>
      <button
        class="icon-btn small"
        aria-label=${msg("Measure")}
        title=${keyText(msg("Measure: profile, distance, area, volume"), actions.get("measure-line"))}
        aria-pressed=${this.measuring.value !== null && this.measuring.value !== "water"}
        @click=${() => this.#run(this.measuring.value === "area" ? "measure-area" : "measure-line")}
      >
        ${icon("ruler")}
      </button>
      <button
        class="icon-btn small"
        aria-label=${msg("Water")}
        title=${keyText(msg("Water: a drop's way, rain, floods, the sea"), actions.get("water"))}
        aria-pressed=${this.measuring.value === "water"}
        @click=${() => this.#run("water")}
      >
        ${icon("drop")}
      </button>
      <wa-dropdown placement="top-end" @wa-select=${this.#overlay}>
        <button slot="trigger" class="icon-btn small" aria-label=${msg("Overlays")} title=${msg("Overlays")} aria-pressed=${overlay.value !== "none"}>
          ${icon("layers")}
        </button>
        ${OVERLAYS.map(
          (o) => html`
            <wa-dropdown-item type="checkbox" value=${o.value} .checked=${live(overlay.value === o.value)}>${o.label}</wa-dropdown-item>
          `,
        )}
        <wa-dropdown-item type="checkbox" value="strokes" .checked=${live(showStrokes.value && !quiet.value)}>${msg("Show strokes")}</wa-dropdown-item>
        ${flat ? null : this.#qualities(quality.value)}
      </wa-dropdown>
      <esk-view-options .choices=${this.choices} .renderer=${this.renderer}></esk-view-options>
    `;
  }
}

customElements.define("esk-view-bar", EskViewBar);
