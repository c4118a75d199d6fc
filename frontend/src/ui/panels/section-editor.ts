import { msg } from "@lit/localize";
import { css, html, LitElement, svg, type TemplateResult } from "lit";
import {
  drag,
  type Frame,
  fitFrame,
  type Knob,
  type KnobId,
  knobs,
  nudge,
  outline,
  type Section,
  type SectionLimits,
} from "../../app/view/cross-section.ts";
import { metres } from "../../app/words/words.ts";
import { shared } from "../styles/shared.ts";

const WIDTH = 268;
const HEIGHT = 124;

/** The draggable cross-section. Fires `section` while a knob moves and `settle` when it is let go. */
export class EskSection extends LitElement {
  static override properties = {
    section: { attribute: false },
    limits: { attribute: false },
    linked: { type: Boolean },
    disabled: { type: Boolean },
    frame: { state: true },
    active: { state: true },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: block;
      }
      svg {
        display: block;
        width: 100%;
        height: auto;
        border-radius: 10px;
        background: var(--esk-hover);
        touch-action: none;
        overflow: visible;
      }
      .ground {
        stroke: var(--esk-line-strong);
        stroke-dasharray: 3 3;
      }
      .land {
        fill: var(--land, var(--esk-mountain));
        fill-opacity: 0.2;
      }
      .firm,
      .free {
        fill: none;
        stroke: var(--land, var(--esk-mountain));
        stroke-width: 2;
        stroke-linejoin: round;
        stroke-linecap: round;
      }
      .free {
        stroke-width: 1.5;
        stroke-dasharray: 1 4;
      }
      .knob {
        cursor: grab;
        outline: none;
      }
      .knob .hit {
        fill: transparent;
      }
      .knob .dot {
        fill: var(--esk-panel-solid);
        stroke: var(--esk-text);
        stroke-width: 1.75;
      }
      .knob:hover .dot,
      .knob.active .dot {
        fill: var(--esk-accent);
        stroke: var(--esk-accent);
      }
      .knob .more {
        fill: none;
        stroke: var(--esk-text);
        stroke-width: 1.5;
        stroke-linecap: round;
        stroke-linejoin: round;
        pointer-events: none;
      }
      .knob:focus-visible .dot {
        stroke: var(--esk-focus);
        stroke-width: 3;
      }
      :host([disabled]) .knob {
        display: none;
      }
      text {
        fill: var(--esk-text);
        font: 600 10.5px var(--wa-font-family-body);
        text-anchor: middle;
        paint-order: stroke;
        stroke: var(--esk-panel-solid);
        stroke-width: 3px;
        pointer-events: none;
      }
    `,
  ];

  declare section: Section;
  declare limits: SectionLimits;
  declare linked: boolean;
  declare disabled: boolean;
  /** The frame is kept still during a drag, else the picture would run away under the pointer. */
  declare frame: Frame | null;
  declare active: KnobId | null;

  constructor() {
    super();
    this.section = { left: null, right: null, plateauRadiusM: 0, reliefM: 1 };
    this.limits = { maxExtentM: 2048, maxPlateauM: 1024 };
    this.linked = true;
    this.disabled = false;
    this.frame = null;
    this.active = null;
  }

  #emit(type: "section" | "settle", section: Section): void {
    this.dispatchEvent(new CustomEvent(type, { detail: section }));
  }

  #down(event: PointerEvent, id: KnobId): void {
    if (this.disabled) return;
    event.preventDefault();
    const target = event.currentTarget as SVGElement;
    target.setPointerCapture(event.pointerId);
    target.focus();
    this.frame = fitFrame(this.section, WIDTH, HEIGHT);
    this.active = id;
  }

  #move(event: PointerEvent): void {
    if (!this.active || !this.frame) return;
    const box = this.renderRoot.querySelector("svg")!.getBoundingClientRect();
    const at = {
      x: ((event.clientX - box.left) / box.width) * WIDTH,
      y: ((event.clientY - box.top) / box.height) * HEIGHT,
    };
    this.section = drag(this.section, this.frame, this.active, at, this.linked, this.limits);
    this.#emit("section", this.section);
  }

  #up(): void {
    if (!this.active) return;
    this.active = null;
    this.frame = null;
    this.#emit("settle", this.section);
  }

  #key(event: KeyboardEvent, id: KnobId): void {
    const steps = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 5, PageDown: -5 }[event.key];
    if (steps === undefined || this.disabled) return;
    event.preventDefault();
    event.stopPropagation();
    this.section = nudge(this.section, fitFrame(this.section, WIDTH, HEIGHT), id, steps, this.linked, this.limits);
    this.#emit("section", this.section);
    this.#emit("settle", this.section);
  }

  #knob(knob: Knob, frame: Frame): TemplateResult {
    const text = knob.unit === "m" ? metres(knob.value) : `${Math.round(knob.value)}°`;
    const y = knob.y > frame.height - 22 || knob.id === "plateau" ? knob.y - 12 : knob.y + 20;
    return svg`
      <g
        class="knob ${this.active === knob.id ? "active" : ""}"
        role="slider"
        tabindex=${this.disabled ? -1 : 0}
        aria-label=${knob.label}
        aria-valuenow=${Math.round(knob.value)}
        aria-valuetext=${text}
        @pointerdown=${(e: PointerEvent) => this.#down(e, knob.id)}
        @pointermove=${this.#move}
        @pointerup=${this.#up}
        @pointercancel=${this.#up}
        @keydown=${(e: KeyboardEvent) => this.#key(e, knob.id)}
      >
        <circle class="hit" cx=${knob.x} cy=${knob.y} r="13"></circle>
        <circle class="dot" cx=${knob.x} cy=${knob.y} r="5.5"></circle>
        ${knob.beyond ? svg`<path class="more" d=${chevron(knob.x, knob.y, Math.sign(knob.x - frame.centreX))}></path>` : null}
        ${this.active === knob.id || knob.beyond ? svg`<text x=${Math.min(Math.max(knob.x, 24), frame.width - 24)} y=${y}>${text}</text>` : null}
      </g>
    ` as unknown as TemplateResult;
  }

  protected override render(): TemplateResult {
    const frame = this.frame ?? fitFrame(this.section, WIDTH, HEIGHT);
    const paths = outline(this.section, frame);
    return html`
      <svg viewBox="0 0 ${WIDTH} ${HEIGHT}" role="group" aria-label=${msg("Cross-section, seen along the stroke")}>
        ${svg`<line class="ground" x1="0" x2=${WIDTH} y1=${frame.baseY} y2=${frame.baseY}></line>
        <path class="land" d=${paths.land}></path>
        <path class="firm" d=${paths.firm}></path>
        <path class="free" d=${paths.free}></path>`}
        ${knobs(this.section, frame).map((k) => this.#knob(k, frame))}
      </svg>
    `;
  }
}

/** An arrow head beside a knob that stands for a value outside the picture. */
function chevron(x: number, y: number, dir: number): string {
  return `M${x + dir * 8.5} ${y - 3.5} l${dir * 3.5} 3.5 l${dir * -3.5} 3.5`;
}

customElements.define("esk-section", EskSection);
