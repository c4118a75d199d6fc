import { css, html, nothing, svg, type TemplateResult } from "lit";
import { getStroke } from "perfect-freehand";
import type { Ground, Vec3 } from "../core/types.ts";
import type { GripVisual } from "../input/controller.ts";
import { SUBSTANCES } from "./paints.ts";
import { memberName } from "./people.ts";
import { cursorOf } from "./scene.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import { inkOn } from "./styles/colours.ts";
import { shared } from "./styles/shared.ts";

/** Handles of the selected stroke and the names at other people's cursors, over the picture. Takes no pointer. */
export class EskOverlay extends SignalElement {
  static override properties = { stage: { attribute: false } };
  static override styles = [
    shared,
    css`
      :host {
        position: absolute;
        inset: 0;
        overflow: hidden;
        pointer-events: none;
      }
      svg {
        position: absolute;
        inset: 0;
        width: 100%;
        height: 100%;
      }
      .rim {
        fill: rgb(255 255 255 / 7%);
        stroke-width: 2;
        stroke-linejoin: round;
      }
      .rim.under {
        fill: none;
        stroke: rgb(12 18 24 / 55%);
        stroke-width: 4;
      }
      .rim.less {
        stroke-dasharray: 7 6;
      }
      .ink {
        opacity: 0.55;
      }
      .halo {
        fill: rgb(12 18 24 / 28%);
      }
      .dot {
        fill: #fff;
        stroke: #1b2631;
        stroke-width: 1.5;
      }
      .handle.crest .dot,
      .handle.move .dot,
      .handle.grid-lift .dot,
      .handle.grid-move .dot {
        fill: #ffd9c7;
      }
      .handle.active .dot {
        fill: #f46a45;
        stroke: #fff;
      }
      .pen {
        fill: none;
        stroke-linecap: round;
        stroke-width: 2;
        stroke: #fff;
      }
      .pen.under {
        stroke-width: 5;
        stroke: rgb(12 18 24 / 60%);
      }
      .point {
        fill: #fff;
        stroke: #1b2631;
        stroke-width: 1.5;
      }
      .glyph {
        fill: none;
        stroke: #1b2631;
        stroke-width: 1.5;
        stroke-linecap: round;
        stroke-linejoin: round;
      }
      .tip {
        fill: #fff;
        font: 600 11px var(--wa-font-family-body);
        text-anchor: middle;
        paint-order: stroke;
        stroke: rgb(12 18 24 / 75%);
        stroke-width: 3px;
        stroke-linejoin: round;
      }
      .name {
        position: absolute;
        top: 0;
        left: 0;
        padding: 2px 7px;
        border-radius: 3px 9px 9px 9px;
        font: 600 0.6875rem/1.4 var(--wa-font-family-body);
        white-space: nowrap;
        will-change: transform;
      }
    `,
  ];

  declare stage: Stage;

  /** A world point in CSS pixels of the window, or null when it is out of view. */
  #at(position: Vec3): { x: number; y: number } | null {
    const p = this.stage.camera.project(position);
    if (!p.visible) return null;
    return { x: p.x / this.#ratio, y: p.y / this.#ratio };
  }

  /** Device pixels of the picture for one CSS pixel. */
  get #ratio(): number {
    return this.stage.camera.state.value.width / Math.max(1, this.clientWidth);
  }

  protected override render(): TemplateResult {
    this.stage.camera.state.value;
    return html`
      <svg aria-hidden="true">
        ${this.#brush()} ${this.#ink()} ${this.stage.input.handles.value.map((h) => this.#handle(h))} ${this.#keyPen()}
      </svg>
      ${this.#cursors()}
    `;
  }

  /** The rim of the brush on the ground, dashed where it takes away. */
  #brush(): TemplateResult | typeof nothing {
    const { cursor, defaults, input, shown, session } = this.stage;
    const at = cursor.value;
    if (input.tool.value !== "paint" || at === null || !session.canEdit.value) return nothing;
    const { channel, radius_m, value } = defaults.paint.value;
    const points = brushRim(at, radius_m, shown.ground).map((p) => this.stage.camera.project(p));
    if (points.some((p) => p.depth <= 0) && this.stage.camera.state.value.mode !== "map") return nothing;
    const path = points.map((p) => `${(p.x / this.#ratio).toFixed(1)} ${(p.y / this.#ratio).toFixed(1)}`).join(" L");
    return svg`
      <path class="rim under" d=${`M${path} Z`}></path>
      <path class="rim ${value < 0 ? "less" : ""}" stroke=${SUBSTANCES[channel].colour} d=${`M${path} Z`}></path>
    ` as unknown as TemplateResult;
  }

  /** The line under the pen itself: it is there before the ground has answered. */
  #ink(): TemplateResult | typeof nothing {
    const ink = this.stage.input.ink.value;
    if (!ink) return nothing;
    const ratio = this.#ratio;
    const line = [...ink.points, ...ink.predicted.map((p) => ({ ...p, pressure: ink.points.at(-1)?.pressure ?? 0.5 }))];
    const outline = getStroke(
      line.map((p) => [p.x / ratio, p.y / ratio, p.pressure]),
      { size: 4, thinning: 0.4, simulatePressure: false, streamline: 0.2 },
    );
    if (outline.length < 3) return nothing;
    const path = outline.map(([x, y]) => `${x!.toFixed(1)} ${y!.toFixed(1)}`).join(" L");
    return svg`<path class="ink" fill=${this.stage.session.people.value.myColour} d=${`M${path} Z`}></path>` as unknown as TemplateResult;
  }

  /** The pen that the arrow keys move: a crosshair, and the points that are set. */
  #keyPen(): TemplateResult | typeof nothing {
    const pen = this.stage.input.keyPen.visual.value;
    if (pen === null) return nothing;
    const [x, y] = pen.at.map((v) => v / this.#ratio);
    const cross = "M0-16V-5M0 5V16M-16 0H-5M5 0H16";
    return svg`
      ${pen.points.map(([px, py]) => svg`<circle class="point" r="4.5" cx=${px / this.#ratio} cy=${py / this.#ratio}></circle>`)}
      <g class="keypen" transform="translate(${x!.toFixed(1)} ${y!.toFixed(1)})">
        <path class="pen under" d=${cross}></path>
        <path class="pen" d=${cross}></path>
        <circle r="2" fill=${this.stage.session.people.value.myColour}></circle>
      </g>
    ` as unknown as TemplateResult;
  }

  #handle(handle: GripVisual): TemplateResult | typeof nothing {
    const at = this.#at(handle.position);
    if (!at) return nothing;
    const radius = handle.active ? 8 : 6.5;
    return svg`
      <g class="handle ${handle.kind} ${handle.active ? "active" : ""}" transform="translate(${at.x.toFixed(1)} ${at.y.toFixed(1)})">
        <circle class="halo" r=${radius + 4}></circle>
        <circle class="dot" r=${radius}></circle>
        ${GLYPHS[handle.kind] ?? nothing}
        ${handle.active ? svg`<text class="tip" y="-16">${handle.label}</text>` : nothing}
      </g>
    ` as unknown as TemplateResult;
  }

  #cursors(): (TemplateResult | typeof nothing)[] {
    const people = this.stage.session.people.value;
    return people.members.map((member) => {
      const position = cursorOf(people, member.client);
      const at = position && this.#at(position);
      if (!at) return nothing;
      const style = `background:${member.colour};color:${inkOn(member.colour)};transform:translate(${at.x + 10}px,${at.y + 8}px)`;
      return html`<span class="name" style=${style}>${memberName(member)}</span>`;
    });
  }
}

const RIM_POINTS = 64;

/** Points on the ground all round a place, `radiusM` metres away on the map. */
export function brushRim([x, y]: Vec3, radiusM: number, ground: Ground): Vec3[] {
  return Array.from({ length: RIM_POINTS }, (_, k) => {
    const angle = (k / RIM_POINTS) * 2 * Math.PI;
    const [px, py] = [x + radiusM * Math.cos(angle), y + radiusM * Math.sin(angle)];
    return [px, py, ground.heightAt(px, py, radiusM / 8)];
  });
}

/** What each handle does, drawn on it: up and down, in and out, all ways. */
const GLYPHS: Readonly<Partial<Record<GripVisual["kind"], unknown>>> = {
  crest: svg`<path class="glyph" d="M0-3.5v7M-2-1.800 0-3.800 2-1.800M-2 1.800 0 3.800 2 1.800"></path>`,
  move: svg`<path class="glyph" d="M-3.500 0h7M0-3.500v7"></path>`,
  "grid-lift": svg`<path class="glyph" d="M0-3.5v7M-2-1.800 0-3.800 2-1.800M-2 1.800 0 3.800 2 1.800"></path>`,
  "grid-move": svg`<path class="glyph" d="M-3.500 0h7M0-3.500v7"></path>`,
  "grid-turn": svg`<path class="glyph" d="M3.200-1.200A3.400 3.400 0 1 0 3.300 1M3.600-3.600v2.600h-2.600"></path>`,
  radius: svg`<path class="glyph" d="M-3 0h6M-1.500-2-3.500 0l2 2M1.500-2l2 2-2 2"></path>`,
  left: svg`<path class="glyph" d="M-3 0h6M-1.500-2-3.500 0l2 2M1.500-2l2 2-2 2"></path>`,
  right: svg`<path class="glyph" d="M-3 0h6M-1.500-2-3.500 0l2 2M1.500-2l2 2-2 2"></path>`,
};

customElements.define("esk-overlay", EskOverlay);
