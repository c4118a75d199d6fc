import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, type TemplateResult } from "lit";
import type { Graphics } from "../../app/view/graphics.ts";
import { height, metres, roundBelow } from "../../app/words/words.ts";
import type { Camera } from "../../core/camera/camera.ts";
import { fixed } from "../../core/language.ts";
import { lonLatOf, lonLatWords } from "../../core/lonlat.ts";
import type { Vec3 } from "../../core/types.ts";
import type { Doc } from "../../doc/document.ts";
import type { Progress } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

const BAR_PX = 96;
const NARROW_BAR_PX = 52;

const tiles = (n: number): string => (n === 1 ? msg("1 tile") : msg(str`${n} tiles`));

/** How far the solver is, in words for the tooltip. */
export function progressText(progress: Progress | null, levels: number): string {
  if (!progress) return msg(str`Waiting for the ground: ${levels + 1} levels of detail`);
  if (progress.settled && progress.refining > 0)
    return msg(str`Refining ${tiles(progress.refining)} where somebody looks closely`);
  if (progress.settled) return msg(str`Settled: all ${levels + 1} levels of detail are final`);
  return msg(str`Settling: level ${progress.level} of ${progress.of}`);
}

/** Height under the cursor, scale, levels of detail, and what draws the picture. */
export class EskStatusLine extends SignalElement {
  static override properties = {
    cursor: { attribute: false },
    doc: { attribute: false },
    camera: { attribute: false },
    baseBuilding: { attribute: false },
    progress: { attribute: false },
    levels: { attribute: false },
    graphics: { attribute: false },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: flex;
        align-items: center;
        gap: 14px;
        height: 32px;
        padding: 0 12px;
        font-size: 0.75rem;
        font-variant-numeric: tabular-nums;
        color: var(--esk-quiet);
        white-space: nowrap;
      }
      .height {
        min-width: 4.6em;
        color: var(--esk-text);
        font-weight: 550;
      }
      .place {
        min-width: 8.4em;
      }
      .scale {
        display: inline-flex;
        align-items: center;
        gap: 7px;
      }
      .bar {
        height: 5px;
        border: 1.5px solid currentColor;
        border-top: 0;
      }
      .levels {
        display: inline-flex;
        align-items: center;
        gap: 3px;
      }
      .dot {
        width: 6px;
        height: 6px;
        border-radius: 50%;
        background: var(--esk-line-strong);
        transition: background-color 160ms;
      }
      .dot.done {
        background: var(--esk-accent);
      }
      .settled .dot.done {
        background: var(--esk-ok);
      }
      .building {
        color: var(--esk-accent-text);
      }
      .refining {
        margin-left: 4px;
      }
      .levels .icon {
        width: 13px;
        height: 13px;
        margin-left: 2px;
        color: var(--esk-ok);
      }
      .renderer {
        overflow: hidden;
        text-overflow: ellipsis;
        max-width: 220px;
      }
      @media (max-width: 720px) {
        :host {
          gap: 9px;
          height: 28px;
          padding: 0 9px;
          font-size: 0.6875rem;
        }
      }
      /* In German the buttons of the view leave no more than this. */
      @media (max-width: 900px) {
        .place,
        .renderer {
          display: none;
        }
      }
      @media (max-width: 460px) {
        .height,
        .building ~ .levels {
          display: none;
        }
      }
      /* Room for the buttons of the view, which fingers need large. */
      @media (max-width: 430px) {
        .scale {
          display: none;
        }
      }
    `,
  ];

  /** The ground under the cursor. */
  declare cursor: ReadonlySignal<Vec3 | null>;
  declare doc: ReadonlySignal<Doc | null>;
  declare camera: Pick<Camera, "state" | "metresPerPixelAt">;
  /** The server makes the ground of the elevation layers, and it takes long. */
  declare baseBuilding: ReadonlySignal<boolean>;
  declare progress: ReadonlySignal<Progress | null>;
  /** Finest level that is solved everywhere. */
  declare levels: number;
  declare graphics: Pick<Graphics, "info" | "reason">;

  protected override render(): TemplateResult {
    const { graphics } = this;
    const point = this.cursor.value;
    return html`
      <span class="height" title=${msg("Height of the ground under the cursor")}>${point ? height(point[2]) : "–"}</span>
      ${this.#place(point)}
      ${this.baseBuilding.value ? html`<span class="building" role="status">${msg("Laying the real ground…")}</span>` : nothing}
      ${this.#scale()} ${this.#levels(this.progress.value, this.levels)}
      <span class="renderer" title=${graphics.reason.value ?? ""}>${graphics.info.value?.description ?? nothing}</span>
    `;
  }

  /** Where the cursor is: on Earth where the terrain lies there, else metres from its south-western corner. */
  #place(point: Vec3 | null): TemplateResult | typeof nothing {
    const settings = this.doc.value?.settings;
    if (!point || !settings) return nothing;
    const [x, y] = point;
    const metric = msg(str`${fixed(x)} E, ${fixed(y)} N m`);
    const words = settings.place ? lonLatWords(lonLatOf(settings.place, settings.size_m, x, y)) : metric;
    return html`<span class="place" title=${msg(str`Under the cursor: ${metric} from the south-western corner`)}>${words}</span>`;
  }

  #scale(): TemplateResult | typeof nothing {
    const { camera } = this;
    const state = camera.state.value;
    const cssPixel = camera.metresPerPixelAt(state.target) * Math.min(window.devicePixelRatio, 2);
    const length = roundBelow((window.innerWidth < 480 ? NARROW_BAR_PX : BAR_PX) * cssPixel);
    if (length === 0) return nothing;
    return html`<span class="scale" title=${msg("Scale at the centre of the view")}>
      <span class="bar" style=${`width:${Math.round(length / cssPixel)}px`}></span>${metres(length)}
    </span>`;
  }

  #levels(progress: Progress | null, levels: number): TemplateResult {
    const settled = progress?.settled === true;
    const refining = progress?.refining ?? 0;
    const text = progressText(progress, levels);
    return html`<span class="levels ${settled ? "settled" : ""}" role="img" aria-label=${text} title=${text}>
      ${Array.from({ length: levels + 1 }, (_, i) => {
        const done = progress !== null && (settled || i <= progress.level);
        return html`<span class="dot ${done ? "done" : ""}"></span>`;
      })}
      ${settled && refining === 0 ? icon("check") : nothing}
      ${settled && refining > 0 ? html`<span class="refining">${msg(str`refining ${refining}`)}</span>` : nothing}
    </span>`;
  }
}

customElements.define("esk-status-line", EskStatusLine);
