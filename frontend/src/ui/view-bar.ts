import "@awesome.me/webawesome/dist/components/divider/divider.js";
import "@awesome.me/webawesome/dist/components/dropdown/dropdown.js";
import "@awesome.me/webawesome/dist/components/dropdown-item/dropdown-item.js";
import { css, html, type TemplateResult } from "lit";
import { live } from "lit/directives/live.js";
import type { QualityMode, Scene } from "../core/types.ts";
import { icon } from "./icons.ts";
import { keyText } from "./keys.ts";
import { QUALITIES } from "./quality-choice.ts";
import "./segmented.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { shared } from "./styles/shared.ts";

/** Overlays in the order of the menu. */
export const OVERLAYS: readonly { readonly value: Scene["overlay"]; readonly label: string }[] = [
  { value: "none", label: "Plain ground" },
  { value: "contours", label: "Contour lines" },
  { value: "slope", label: "Steepness" },
  { value: "detail", label: "Roughness and amplitude" },
  { value: "snow", label: "Painted snow" },
  { value: "forest", label: "Painted forest" },
  { value: "grass", label: "Painted meadow" },
  { value: "wetness", label: "Painted wetness" },
  { value: "influence", label: "Reach of the selected stroke" },
  { value: "patches", label: "Levels of detail" },
];

/** How the terrain is looked at: camera mode, the whole terrain, overlays. */
export class EskViewBar extends SignalElement {
  static override properties = { stage: { attribute: false } };
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
      .heading {
        display: block;
        padding: 2px 12px 4px;
        color: var(--esk-quiet);
      }
    `,
  ];

  declare stage: Stage;

  #run(id: string): void {
    this.stage.input.actions.get(id)?.run();
  }

  #overlay(event: CustomEvent<{ item: { value: string } }>): void {
    const value = event.detail.item.value;
    const quality = QUALITIES.find((q) => q.value === value);
    if (quality) this.stage.quality.choose(quality.value);
    else if (value === "strokes") this.stage.showStrokes.value = !this.stage.showStrokes.value;
    else this.stage.setOverlay(value as Scene["overlay"]);
    // The item has ticked itself: ticks follow the state, also where the choice changed nothing.
    this.requestUpdate();
  }

  #qualities(chosen: QualityMode): TemplateResult {
    const coarsened = this.stage.coarsenedPx.value;
    return html`
      <wa-divider></wa-divider>
      <small class="heading">Quality</small>
      ${
        coarsened === null
          ? null
          : html`<small class="heading" role="status">This view is held to ${coarsened.toFixed(1)} px: no room for finer ground</small>`
      }
      ${QUALITIES.map(
        (q) => html`
          <wa-dropdown-item type="checkbox" value=${q.value} title=${q.title} .checked=${live(chosen === q.value)}>${q.label}</wa-dropdown-item>
        `,
      )}
    `;
  }

  protected override render(): TemplateResult {
    const { camera, input, overlay, showStrokes, graphics, quality } = this.stage;
    const flat = graphics.info.value?.kind === "map";
    const modes = [
      { value: "orbit", label: "Orbit", icon: "orbit", title: keyText("Orbit", input.actions.get("camera-orbit")) },
      { value: "fly", label: "Fly", icon: "fly", title: keyText("Fly", input.actions.get("camera-fly")) },
      { value: "map", label: "Map", icon: "map", title: keyText("Map", input.actions.get("camera-map")) },
    ];
    return html`
      ${
        flat
          ? null
          : html`<esk-segmented
              compact
              label="Camera"
              .segments=${modes}
              .value=${camera.state.value.mode}
              @pick=${(e: CustomEvent<string>) => this.#run(`camera-${e.detail}`)}
            ></esk-segmented>`
      }
      <button
        class="icon-btn small"
        aria-label="See the whole terrain"
        title=${keyText("See the whole terrain", input.actions.get("home"))}
        @click=${() => this.#run("home")}
      >
        ${icon("frame")}
      </button>
      <wa-dropdown placement="top-end" @wa-select=${this.#overlay}>
        <button slot="trigger" class="icon-btn small" aria-label="Overlays" title="Overlays" aria-pressed=${overlay.value !== "none"}>
          ${icon("layers")}
        </button>
        ${OVERLAYS.map(
          (o) => html`
            <wa-dropdown-item type="checkbox" value=${o.value} .checked=${live(overlay.value === o.value)}>${o.label}</wa-dropdown-item>
          `,
        )}
        <wa-dropdown-item type="checkbox" value="strokes" .checked=${live(showStrokes.value)}>Show strokes</wa-dropdown-item>
        ${flat ? null : this.#qualities(quality.mode.value)}
      </wa-dropdown>
    `;
  }
}

customElements.define("esk-view-bar", EskViewBar);
