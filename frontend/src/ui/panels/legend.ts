import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import type { ViewChoices } from "../../app/device/view-choices.ts";
import type { TaskView } from "../../app/lesson/task/task-view.ts";
import { SUBSTANCES } from "../../app/words/paints.ts";
import { metres } from "../../app/words/words.ts";
import { midSentence, significant } from "../../core/language.ts";
import type { PaintedOverlay, Scene, Vec3 } from "../../core/types.ts";
import type { Doc } from "../../doc/document.ts";
import { TOLERANCES_OFF } from "../../generated/contract.ts";
import type { ChannelStore } from "../../tiles/detail/channels.ts";
import { INDEX_EVERY } from "../../tiles/flat.ts";
import type { ShownTerrain } from "../../tiles/shownterrain.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** The words under the ends of a scale. */
export function amplitudeEnds(greatestM: number): [string, string] {
  return ["0", greatestM > 0 ? metres(greatestM) : msg("none yet")];
}

/** Overlays without a scale: the key that goes through them all should say which it has come to. */
const NAMED = {
  patches: msg("Levels of detail, a colour each"),
  watershed: msg("All ground that drains through the place"),
} as const;

/** The meaning of an overlay's colours. */
export class EskLegend extends SignalElement {
  static override properties = {
    overlay: { attribute: false },
    channels: { attribute: false },
    ground: { attribute: false },
    cursor: { attribute: false },
    doc: { attribute: false },
    selection: { attribute: false },
    choices: { attribute: false },
    automaticM: { attribute: false },
    task: { attribute: false },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 8px;
        width: 196px;
        padding: 10px 12px;
        font-size: 0.75rem;
        color: var(--esk-quiet);
      }
      :host([hidden]) {
        display: none;
      }
      .scale {
        display: grid;
        gap: 3px;
      }
      .name {
        color: var(--esk-text);
        font-weight: 550;
      }
      .bar {
        height: 8px;
        border-radius: 4px;
      }
      .ends {
        display: flex;
        justify-content: space-between;
        font-variant-numeric: tabular-nums;
      }
      /* The colours of slope_tint and detail_tint in overlay/overlay.wgsl, as they look on lit ground. */
      .slope {
        background: linear-gradient(
          to right,
          #6fa57c 0%,
          #6fa57c 8%,
          #e0d66f 38%,
          #dc7a4e 64%,
          #93405f 100%
        );
      }
      .roughness {
        background: linear-gradient(to right, #3d7da3, #a9a06c 50%, #b34a58);
      }
      .influence {
        background: linear-gradient(to right, #a7a7a7, #d6c183 45%, #d35a3c);
      }
      .difference {
        background: linear-gradient(to right, #2f6fc9, #b9b6ad 40%, #b9b6ad 60%, #d23f36);
      }
      .painted {
        background: linear-gradient(to right, #b37442, #8d8d8d 50%, #3595b3);
      }
      .amplitude {
        background: linear-gradient(to right, #8d8d8d, #a9a06c);
      }
    `,
  ];

  declare overlay: ReadonlySignal<Scene["overlay"]>;
  declare channels: ChannelStore;
  declare ground: Pick<ShownTerrain, "attributesAt">;
  declare cursor: ReadonlySignal<Vec3 | null>;
  declare doc: ReadonlySignal<Doc | null>;
  declare selection: ReadonlySignal<string | null>;
  declare choices: ViewChoices;
  /** Height between the contours that are drawn, metres; 0: none yet. */
  declare automaticM: ReadonlySignal<number>;

  /** The task whose difference is shown. */
  declare task: TaskView;

  protected override render(): TemplateResult | typeof nothing {
    const overlay = this.overlay.value;
    const times = this.choices.exaggeration;
    this.toggleAttribute("hidden", overlay === "none" && times === 1);
    const heights = times === 1 ? nothing : html`<div class="name">${msg(str`Heights drawn × ${times}`)}</div>`;
    return html`${overlay === "none" ? nothing : this.#overlay(overlay)}${heights}`;
  }

  #overlay(overlay: Exclude<Scene["overlay"], "none">): TemplateResult {
    if (overlay === "contours") return this.#contours();
    if (overlay === "patches" || overlay === "watershed") return html`<div class="name">${NAMED[overlay]}</div>`;
    if (overlay === "slope") return scale(msg("Steepness"), "slope", ["0°", "30°", "60°"]);
    if (overlay === "influence") return this.#influence();
    if (overlay === "difference") return this.#difference();
    this.channels.revision.value;
    if (overlay !== "detail") return this.#painted(overlay);
    const greatest = this.channels.amplitude.values.reduce((a, b) => Math.max(a, b), 0);
    return html`
      ${scale(msg("Roughness"), "roughness", [msg("smooth"), msg("rough")])} ${scale(msg("Amplitude"), "amplitude", amplitudeEnds(greatest))}
      ${this.#here()}
    `;
  }

  #contours(): TemplateResult {
    const every = this.automaticM.value;
    if (every === 0) return html`<div class="name">${msg("Contour lines")}</div>`;
    const words = (m: number): string => `${significant(m, 6)} m`;
    return html`<div>
      <div class="name">${msg(str`Contours every ${words(every)}`)}</div>
      <div>${msg(str`Each fifth stronger, with its height: every ${words(INDEX_EVERY * every)}`)}</div>
    </div>`;
  }

  /** How far red and blue reach, and how far the ground under the cursor is from what is asked. */
  #difference(): TemplateResult {
    const goal = this.task.task.value?.goal;
    const tolerance = goal && "tolerance_m" in goal ? goal.tolerance_m : 0;
    const most = metres(TOLERANCES_OFF * tolerance);
    const off = this.task.offAt(this.cursor.value);
    const words =
      off === null
        ? nothing
        : Math.abs(off) <= tolerance
          ? msg("as asked")
          : off > 0
            ? msg(str`${metres(off)} too high`)
            : msg(str`${metres(-off)} too low`);
    return html`${scale(msg("Against the task"), "difference", [`−${most}`, msg("as asked"), `+${most}`])}
      ${words === nothing ? nothing : html`<div class="ends"><span>${msg("Here")}</span><span>${words}</span></div>`}`;
  }

  #influence(): TemplateResult {
    const chosen = this.doc.value?.strokes.has(this.selection.value ?? "") === true;
    if (!chosen) return html`<div class="name">${msg("Select a stroke to see where it is felt.")}</div>`;
    return scale(msg("Felt from the selected stroke"), "influence", [msg("far"), msg("its flanks"), msg("its line")]);
  }

  /** Words for the paint of a channel under the cursor, and for how much of the channel there is in the end. */
  #painted(channel: PaintedOverlay): TemplateResult {
    const name = msg(str`Painted ${midSentence(SUBSTANCES[channel].title)}`);
    return html`${scale(name, "painted", [msg("less"), msg("as it grows"), msg("more")])} ${this.#share(channel)}`;
  }

  #share(channel: PaintedOverlay): TemplateResult | typeof nothing {
    const at = this.cursor.value;
    const found = at && this.ground.attributesAt(at[0], at[1]);
    if (!at || !found) return nothing;
    const bias = Math.round(100 * this.channels.valueAt(channel, at[0], at[1]));
    const paint = html`<div class="ends"><span>${msg("Paint here")}</span><span>${signed(bias)} %</span></div>`;
    if (channel === "erosion") return paint;
    const share = Math.round(100 * found[channel === "wetness" ? "wet" : channel]);
    return html`<div>
      ${paint}
      <div class="ends"><span>${msg(str`${SUBSTANCES[channel].title} here`)}</span><span>${share} %</span></div>
    </div>`;
  }

  /** The two values under the cursor. */
  #here(): TemplateResult | typeof nothing {
    const at = this.cursor.value;
    if (!at) return nothing;
    const { channels } = this;
    const amplitude = metres(channels.amplitudeAt(at[0], at[1]));
    const roughness = Math.round(100 * channels.roughnessAt(at[0], at[1]));
    return html`<div class="ends"><span>${msg("Here")}</span><span>${msg(str`${amplitude}, ${roughness} % rough`)}</span></div>`;
  }
}

const signed = (v: number): string => (v > 0 ? `+${v}` : v < 0 ? `−${-v}` : "0");

function scale(name: string, kind: string, ends: readonly string[]): TemplateResult {
  return html`<div class="scale" role="img" aria-label=${`${name}: ${ends.join(` ${msg("to")} `)}`}>
    <span class="name">${name}</span>
    <span class="bar ${kind}"></span>
    <span class="ends">${ends.map((end) => html`<span>${end}</span>`)}</span>
  </div>`;
}

customElements.define("esk-legend", EskLegend);
