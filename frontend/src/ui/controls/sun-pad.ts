import { msg } from "@lit/localize";
import { css, html, LitElement, svg, type TemplateResult } from "lit";
import { type SunPosition, sunAt, sunOnDial, sunWords } from "../../app/view/sun.ts";
import { shared } from "../styles/shared.ts";

const R = 54;
const BOX = 2 * R + 28;

/** A dial on which the sun is dragged. Fires `sun` while it moves and `settle` when it is let go. */
export class EskSunPad extends LitElement {
  static override properties = {
    azimuthDeg: { attribute: false },
    elevationDeg: { attribute: false },
    disabled: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: block;
      }
      svg {
        display: block;
        width: min(100%, 168px);
        margin: 0 auto;
        touch-action: none;
        overflow: visible;
        border-radius: 50%;
        cursor: grab;
      }
      .sky {
        fill: var(--esk-hover);
        stroke: var(--esk-line-strong);
      }
      .ring {
        fill: none;
        stroke: var(--esk-line);
      }
      .sun {
        fill: #ffb224;
        stroke: #fff;
        stroke-width: 2;
      }
      .glow {
        fill: #ffb224;
        opacity: 0.25;
      }
      text {
        fill: var(--esk-quiet);
        font: 600 10px var(--wa-font-family-body);
        text-anchor: middle;
        dominant-baseline: central;
      }
      :host([disabled]) svg {
        cursor: default;
        opacity: 0.6;
      }
    `,
  ];

  declare azimuthDeg: number;
  declare elevationDeg: number;
  declare disabled: boolean;
  #dragging = false;

  constructor() {
    super();
    this.azimuthDeg = 115;
    this.elevationDeg = 24;
    this.disabled = false;
  }

  get #sun(): SunPosition {
    return { azimuthDeg: this.azimuthDeg, elevationDeg: this.elevationDeg };
  }

  #put(sun: SunPosition, settled: boolean): void {
    this.azimuthDeg = sun.azimuthDeg;
    this.elevationDeg = sun.elevationDeg;
    this.dispatchEvent(new CustomEvent(settled ? "settle" : "sun", { detail: sun }));
  }

  #point(event: PointerEvent): void {
    if (!this.#dragging) return;
    const box = (event.currentTarget as SVGElement).getBoundingClientRect();
    const scale = BOX / box.width;
    const x = (event.clientX - box.left) * scale - BOX / 2;
    const y = (event.clientY - box.top) * scale - BOX / 2;
    this.#put(sunAt(x, y, R, this.#sun), false);
  }

  #down(event: PointerEvent): void {
    if (this.disabled) return;
    this.#dragging = true;
    (event.currentTarget as SVGElement).setPointerCapture(event.pointerId);
    this.#point(event);
  }

  #up(): void {
    if (!this.#dragging) return;
    this.#dragging = false;
    this.#put(this.#sun, true);
  }

  #key(event: KeyboardEvent): void {
    const turn = { ArrowRight: 5, ArrowLeft: -5 }[event.key] ?? 0;
    const lift = { ArrowUp: 3, ArrowDown: -3 }[event.key] ?? 0;
    if ((turn === 0 && lift === 0) || this.disabled) return;
    event.preventDefault();
    event.stopPropagation();
    const azimuthDeg = (this.azimuthDeg + turn + 360) % 360;
    const elevationDeg = Math.min(Math.max(this.elevationDeg + lift, 0), 90);
    this.#put({ azimuthDeg, elevationDeg }, true);
  }

  protected override render(): TemplateResult {
    const at = sunOnDial(this.#sun, R);
    const c = BOX / 2;
    return html`
      <svg
        viewBox="0 0 ${BOX} ${BOX}"
        role="slider"
        tabindex=${this.disabled ? -1 : 0}
        aria-label=${msg("Sun: arrows left and right turn it, up and down raise it")}
        aria-valuemin="0"
        aria-valuemax="90"
        aria-valuenow=${Math.round(this.elevationDeg)}
        aria-valuetext=${sunWords(this.#sun)}
        aria-disabled=${this.disabled}
        @pointerdown=${this.#down}
        @pointermove=${this.#point}
        @pointerup=${this.#up}
        @pointercancel=${this.#up}
        @keydown=${this.#key}
      >
        ${svg`
          <circle class="sky" cx=${c} cy=${c} r=${R}></circle>
          <circle class="ring" cx=${c} cy=${c} r=${(R * 2) / 3}></circle>
          <circle class="ring" cx=${c} cy=${c} r=${R / 3}></circle>
          <text x=${c} y="6">N</text><text x=${BOX - 6} y=${c}>E</text>
          <text x=${c} y=${BOX - 6}>S</text><text x="6" y=${c}>W</text>
          <circle class="glow" cx=${c + at.x} cy=${c + at.y} r="13"></circle>
          <circle class="sun" cx=${c + at.x} cy=${c + at.y} r="7"></circle>
        `}
      </svg>
    `;
  }
}

customElements.define("esk-sun-pad", EskSunPad);
