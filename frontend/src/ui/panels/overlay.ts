import { msg, str } from "@lit/localize";
import type { ReadonlySignal } from "@preact/signals-core";
import { css, html, nothing, svg, type TemplateResult } from "lit";
import { getStroke } from "perfect-freehand";
import { memberName } from "../../app/device/names.ts";
import { inkOn } from "../../app/view/colours.ts";
import type { People } from "../../app/view/scene.ts";
import { cursorOf, holders } from "../../app/view/scene.ts";
import { kindWord } from "../../app/words/kind-word.ts";
import { paintName, SUBSTANCES } from "../../app/words/paints.ts";
import { penWords } from "../../app/words/pen-words.ts";
import type { Camera } from "../../core/camera/camera.ts";
import type { Ground, Vec3 } from "../../core/types.ts";
import type { Doc } from "../../doc/document.ts";
import type { Meeting } from "../../doc/meetings.ts";
import type { Paint } from "../../generated/contract.ts";
import type { AnyHandle, InputController } from "../../input/controller.ts";
import type { KeyPen } from "../../input/keys/keypen.ts";
import { brushPattern } from "../controls/brush-look.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** How far above the pen its words stand, CSS pixels, and how near the top of the window they may come. */
const WORDS_ABOVE_PX = 64;
const WORDS_TOP_PX = 66;

/** The things in my hand: handles, the line under the pen, the pen of the arrow keys. */
type Hand = Pick<InputController, "handles" | "ink" | "drawing" | "selection" | "tool"> & {
  readonly keyPen: Pick<KeyPen, "visual">;
};

/** Handles of the selected stroke and the names at other people's cursors, over the picture. Takes no pointer. */
export class EskOverlay extends SignalElement {
  static override properties = {
    camera: { attribute: false },
    input: { attribute: false },
    cursor: { attribute: false },
    paint: { attribute: false },
    ground: { attribute: false },
    doc: { attribute: false },
    meets: { attribute: false },
    people: { attribute: false },
    canEdit: { attribute: false },
    marked: { attribute: false },
  };
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
        stroke-width: 2;
        stroke-linejoin: round;
      }
      .rim.under {
        fill: none;
        stroke: rgb(12 18 24 / 55%);
        stroke-width: 4;
      }
      .rim.less {
        fill: rgb(12 18 24 / 12%);
        stroke-dasharray: 7 6;
      }
      .pen-words {
        position: absolute;
        top: 0;
        left: 0;
        padding: 3px 9px;
        border-radius: 9px;
        background: rgb(12 18 24 / 78%);
        color: #fff;
        font: 600 0.75rem/1.4 var(--wa-font-family-body);
        font-variant-numeric: tabular-nums;
        white-space: nowrap;
      }
      .ink {
        opacity: 0.55;
      }
      .meeting {
        fill: none;
        stroke: #ffd166;
        stroke-width: 2;
        stroke-dasharray: 4 4;
      }
      .meeting.under {
        stroke: rgb(12 18 24 / 60%);
        stroke-width: 4;
        stroke-dasharray: none;
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
      .handle.ruler .dot {
        fill: #ffd166;
      }
      .marked .dot,
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

  declare camera: Pick<Camera, "state" | "project">;
  declare input: Hand;
  /** The ground under the cursor. */
  declare cursor: ReadonlySignal<Vec3 | null>;
  /** The paint of the brush. */
  declare paint: ReadonlySignal<Paint>;
  declare ground: Ground;
  declare doc: ReadonlySignal<Doc | null>;
  /** Strokes that cross the selected one. */
  declare meets: ReadonlySignal<readonly Meeting[]>;
  declare people: ReadonlySignal<People>;
  declare canEdit: ReadonlySignal<boolean>;
  /** The place on the ground that a pointer on the section marks. */
  declare marked: ReadonlySignal<Vec3 | null>;

  /** A world point in CSS pixels of the window, or null when it is out of view. */
  #at(position: Vec3): { x: number; y: number } | null {
    const p = this.camera.project(position);
    if (!p.visible) return null;
    return { x: p.x / this.#ratio, y: p.y / this.#ratio };
  }

  /** Device pixels of the picture for one CSS pixel. */
  get #ratio(): number {
    return this.camera.state.value.width / Math.max(1, this.clientWidth);
  }

  protected override render(): TemplateResult {
    this.camera.state.value;
    return html`
      <svg aria-hidden="true">
        ${this.#mark()} ${this.#brush()} ${this.#ink()} ${this.#meetings()} ${this.input.handles.value.map((h) => this.#handle(h))} ${this.#keyPen()}
      </svg>
      ${this.#penWords()} ${this.#cursors()} ${this.#holders()}
    `;
  }

  /** How high and how long the line under the pen is: above the pen, where a finger does not hide it. */
  #penWords(): TemplateResult | typeof nothing {
    const { input } = this;
    const pen = input.ink.value?.points.at(-1);
    if (!pen) return nothing;
    const stroke = this.doc.value?.strokes.get(input.drawing.value ?? input.selection.value ?? "");
    const words = stroke && penWords(stroke);
    if (!words) return nothing;
    const x = Math.max(110, Math.min(this.clientWidth - 110, pen.x / this.#ratio));
    const above = pen.y / this.#ratio - WORDS_ABOVE_PX;
    const y = above > WORDS_TOP_PX ? above : pen.y / this.#ratio + WORDS_ABOVE_PX / 2;
    return html`<span class="pen-words" style="transform:translate(calc(${x.toFixed(0)}px - 50%), ${y.toFixed(0)}px)">${words}</span>`;
  }

  /** The rim of the brush on the ground, filled with what it paints and named; dashed where it takes away. */
  #brush(): TemplateResult | typeof nothing {
    const { input, paint } = this;
    const at = this.cursor.value;
    if (input.tool.value !== "paint" || at === null || !this.canEdit.value) return nothing;
    const { channel, radius_m, value } = paint.value;
    const points = brushRim(at, radius_m, this.ground).map((p) => this.camera.project(p));
    if (points.some((p) => p.depth <= 0) && this.camera.state.value.mode !== "map") return nothing;
    const path = points.map((p) => `${(p.x / this.#ratio).toFixed(1)} ${(p.y / this.#ratio).toFixed(1)}`).join(" L");
    const top = points.reduce((best, p) => (p.y < best.y ? p : best));
    return svg`
      <defs>${brushPattern(channel)}</defs>
      <path class="rim under" d=${`M${path} Z`}></path>
      <path
        class="rim ${value < 0 ? "less" : ""}"
        fill=${value < 0 ? nothing : `url(#brush-${channel})`}
        stroke=${SUBSTANCES[channel].colour}
        d=${`M${path} Z`}
      ></path>
      ${input.ink.value === null ? svg`<text class="tip" x=${top.x / this.#ratio} y=${top.y / this.#ratio - 8}>${paintName(paint.value)}</text>` : nothing}
    ` as unknown as TemplateResult;
  }

  #mark(): TemplateResult | typeof nothing {
    const at = this.marked.value && this.#at(this.marked.value);
    if (!at) return nothing;
    return svg`<g class="marked" transform="translate(${at.x.toFixed(1)} ${at.y.toFixed(1)})">
      <circle class="halo" r="10"></circle><circle class="dot" r="5"></circle>
    </g>` as unknown as TemplateResult;
  }

  /** The line under the pen itself: it is there before the ground has answered. */
  #ink(): TemplateResult | typeof nothing {
    const ink = this.input.ink.value;
    if (!ink) return nothing;
    const ratio = this.#ratio;
    const line = [...ink.points, ...ink.predicted.map((p) => ({ ...p, pressure: ink.points.at(-1)?.pressure ?? 0.5 }))];
    const outline = getStroke(
      line.map((p) => [p.x / ratio, p.y / ratio, p.pressure]),
      { size: 4, thinning: 0.4, simulatePressure: false, streamline: 0.2 },
    );
    if (outline.length < 3) return nothing;
    const path = outline.map(([x, y]) => `${x!.toFixed(1)} ${y!.toFixed(1)}`).join(" L");
    return svg`<path class="ink" fill=${this.people.value.myColour} d=${`M${path} Z`}></path>` as unknown as TemplateResult;
  }

  /** The pen that the arrow keys move: a crosshair, and the points that are set. */
  #keyPen(): TemplateResult | typeof nothing {
    const pen = this.input.keyPen.visual.value;
    if (pen === null) return nothing;
    const [x, y] = pen.at.map((v) => v / this.#ratio);
    const cross = "M0-16V-5M0 5V16M-16 0H-5M5 0H16";
    return svg`
      ${pen.points.map(([px, py]) => svg`<circle class="point" r="4.5" cx=${px / this.#ratio} cy=${py / this.#ratio}></circle>`)}
      <g class="keypen" transform="translate(${x!.toFixed(1)} ${y!.toFixed(1)})">
        <path class="pen under" d=${cross}></path>
        <path class="pen" d=${cross}></path>
        <circle r="2" fill=${this.people.value.myColour}></circle>
      </g>
    ` as unknown as TemplateResult;
  }

  /** Where other strokes cross the selected one: between the heights that the two ask for. */
  #meetings(): (TemplateResult | typeof nothing)[] {
    const strokes = this.doc.value?.strokes;
    return this.meets.value.map(({ other, x, y, mine, theirs }) => {
      const [a, b] = [this.#at([x, y, mine]), this.#at([x, y, theirs])];
      const met = strokes?.get(other);
      if (!a || !b || !met) return nothing;
      return svg`
        <path class="meeting under" d=${`M${a.x} ${a.y}L${b.x} ${b.y}`}></path>
        <path class="meeting" d=${`M${a.x} ${a.y}L${b.x} ${b.y}`}></path>
        <text class="tip" x=${b.x} y=${b.y + (b.y > a.y ? 16 : -8)}>${met.label || kindWord(met)}</text>
      ` as unknown as TemplateResult;
    });
  }

  #handle(handle: AnyHandle): TemplateResult | typeof nothing {
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

  /**
   * People who have a stroke in hand: colour and name at its first handle, unless that person's pointer is there
   * already.
   */
  #holders(): TemplateResult[] {
    const strokes = this.doc.value?.strokes;
    return holders(this.people.value).flatMap(({ member, stroke }) => {
      const first = strokes?.get(stroke)?.first;
      const at = first && this.#at(first);
      if (!at) return [];
      const place = `transform:translate(${at.x + 9}px,${at.y - 24}px)`;
      return [
        html`<span class="name holds" style=${`background:${member.colour};color:${inkOn(member.colour)};${place}`}>${msg(str`${memberName(member)} holds this`)}</span>`,
      ];
    });
  }

  #cursors(): (TemplateResult | typeof nothing)[] {
    const people = this.people.value;
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

/** The directions of each handle, drawn on it: up and down, in and out, all ways. */
const GLYPHS: Readonly<Partial<Record<AnyHandle["kind"], unknown>>> = {
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
