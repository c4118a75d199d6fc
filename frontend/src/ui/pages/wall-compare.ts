import { msg } from "@lit/localize";
import { effect } from "@preact/signals-core";
import { html, type TemplateResult } from "lit";
import { copyName } from "../../app/server/classes/copies.ts";
import type { WallConnection } from "../../app/server/classes/wall.ts";
import { drawCard } from "../../gpu/map/card.ts";
import { icon } from "../controls/icons.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";
import { compareStyles } from "./wall-styles.ts";

const PICTURE_PX = 640;
const MOST_ZOOM = 8;
const KEY_STEP = 60;

/** Two copies side by side, under one camera: what moves one moves the other. Fires `close`. */
export class EskWallCompare extends SignalElement {
  static override styles = [shared, compareStyles];
  static override properties = { wall: { attribute: false }, numbers: { attribute: false }, camera: { state: true } };

  declare wall: WallConnection;
  declare numbers: readonly number[];
  /** `x`, `y`: where the picture's middle lies, in pixels from the pane's middle; `zoom`: how much larger the picture is. */
  declare camera: { readonly x: number; readonly y: number; readonly zoom: number };

  readonly #pointers = new Map<number, { x: number; y: number }>();
  #stop: (() => void) | null = null;

  constructor() {
    super();
    this.numbers = [];
    this.camera = { x: 0, y: 0, zoom: 1 };
  }

  override connectedCallback(): void {
    super.connectedCallback();
    window.addEventListener("keydown", this.#key);
  }

  protected override firstUpdated(): void {
    const grounds = this.numbers.map((number) => this.wall.ground(number));
    const stops = grounds.map((ground, k) =>
      ground === undefined ? () => {} : effect(() => void (ground.revision.value >= 0 && this.#draw(k))),
    );
    this.#stop = () => {
      for (const stop of stops) stop();
    };
    this.renderRoot.querySelector<HTMLElement>(".pair")?.focus();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    window.removeEventListener("keydown", this.#key);
    this.#stop?.();
  }

  #draw(k: number): void {
    const number = this.numbers[k]!;
    const [ground, copy] = [this.wall.ground(number), this.wall.copies.peek().get(number)];
    const canvas = this.renderRoot.querySelectorAll("canvas")[k];
    if (ground && copy && canvas) drawCard(ground, copy.settings, canvas, PICTURE_PX);
  }

  #move(dx: number, dy: number): void {
    const { x, y, zoom } = this.camera;
    this.camera = { x: x + dx, y: y + dy, zoom };
  }

  /** Larger or smaller around a point of the pane it is in, measured from the pane's middle. */
  #zoom(factor: number, px = 0, py = 0): void {
    const { x, y, zoom } = this.camera;
    const next = Math.min(MOST_ZOOM, Math.max(1, zoom * factor));
    const f = next / zoom;
    this.camera = next === 1 ? { x: 0, y: 0, zoom: 1 } : { x: px + (x - px) * f, y: py + (y - py) * f, zoom: next };
  }

  #at(event: PointerEvent | WheelEvent): { x: number; y: number } {
    const panes = [...this.renderRoot.querySelectorAll("figure")].map((pane) => pane.getBoundingClientRect());
    const inside = (r: DOMRect): boolean =>
      event.clientX >= r.left && event.clientX <= r.right && event.clientY >= r.top && event.clientY <= r.bottom;
    const pane = panes.find(inside) ?? panes[0]!;
    return { x: event.clientX - (pane.left + pane.width / 2), y: event.clientY - (pane.top + pane.height / 2) };
  }

  readonly #wheel = (event: WheelEvent): void => {
    event.preventDefault();
    const { x, y } = this.#at(event);
    this.#zoom(Math.exp(-event.deltaY / 400), x, y);
  };

  readonly #down = (event: PointerEvent): void => {
    (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  };

  readonly #drag = (event: PointerEvent): void => {
    const was = this.#pointers.get(event.pointerId);
    if (was === undefined) return;
    const now = { x: event.clientX, y: event.clientY };
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const apart = (p: { x: number; y: number }): number => Math.hypot(p.x - other.x, p.y - other.y);
      if (apart(was) > 0) this.#zoom(apart(now) / apart(was));
    } else this.#move(now.x - was.x, now.y - was.y);
    this.#pointers.set(event.pointerId, now);
  };

  readonly #up = (event: PointerEvent): void => {
    this.#pointers.delete(event.pointerId);
  };

  readonly #key = (event: KeyboardEvent): void => {
    const moves: Readonly<Record<string, () => void>> = {
      Escape: () => this.#close(),
      "+": () => this.#zoom(1.25),
      "-": () => this.#zoom(0.8),
      ArrowLeft: () => this.#move(KEY_STEP, 0),
      ArrowRight: () => this.#move(-KEY_STEP, 0),
      ArrowUp: () => this.#move(0, KEY_STEP),
      ArrowDown: () => this.#move(0, -KEY_STEP),
    };
    const move = moves[event.key];
    if (move === undefined) return;
    event.preventDefault();
    move();
  };

  #close(): void {
    this.dispatchEvent(new CustomEvent("close"));
  }

  protected override render(): TemplateResult {
    const { x, y, zoom } = this.camera;
    const style = `transform: translate(${x}px, ${y}px) scale(${zoom}) translate(-50%, -50%)`;
    const copies = this.wall.copies.value;
    return html`
      <header>
        <p>${msg("Drag to move, wheel or pinch to come closer: both follow.")}</p>
        <button class="btn outline" @click=${() => this.#close()}>${icon("xmark")} ${msg("Back to the wall")}</button>
      </header>
      <div
        class="pair"
        tabindex="0"
        aria-label=${msg("Two copies side by side. Arrow keys move, plus and minus come closer, Escape closes.")}
        @wheel=${this.#wheel}
        @pointerdown=${this.#down}
        @pointermove=${this.#drag}
        @pointerup=${this.#up}
        @pointercancel=${this.#up}
      >
        ${this.numbers.map((number) => {
          const copy = copies.get(number);
          return html`<figure>
            <canvas style=${style}></canvas>
            <figcaption>${copy ? copyName(copy) : ""}</figcaption>
          </figure>`;
        })}
      </div>
    `;
  }
}

customElements.define("esk-wall-compare", EskWallCompare);
