import { msg } from "@lit/localize";
import { css, html, type TemplateResult } from "lit";
import {
  centreOf,
  extentOf,
  fitted,
  type GridPlace,
  type GridShape,
  pinned,
  respaced,
  rounded,
  turned,
} from "../../core/lattice.ts";
import { MAX_GRID_SPACING_M, MAX_VERTICAL_SCALE, MIN_GRID_SPACING_M } from "../../generated/contract.ts";
import "../controls/number-field.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { shared } from "../styles/shared.ts";

/** Where a grid lies, in numbers. Fires `place` with the new place. */
export class EskPlacementForm extends SignalElement {
  static override properties = {
    shape: { attribute: false },
    place: { attribute: false },
    sizeM: { type: Number },
    disabled: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 10px;
      }
      .two {
        display: grid;
        grid-template-columns: 1fr 1fr;
        gap: 8px 10px;
      }
      .row {
        display: flex;
        flex-wrap: wrap;
        gap: 6px;
      }
      .row .btn {
        flex: 1;
        font-size: 0.8125rem;
      }
    `,
  ];

  declare shape: GridShape;
  declare place: GridPlace;
  declare sizeM: number;
  declare disabled: boolean;

  constructor() {
    super();
    this.sizeM = 4096;
    this.disabled = false;
  }

  #emit(place: GridPlace): void {
    this.dispatchEvent(new CustomEvent<GridPlace>("place", { detail: rounded(place) }));
  }

  #centre(axis: 0 | 1, value: number): void {
    const [x, y] = centreOf(this.shape, this.place);
    this.#emit(pinned(this.place, ...this.#middle, axis === 0 ? [value, y] : [x, value]));
  }

  get #middle(): [number, number] {
    return [(this.shape.cols - 1) / 2, (this.shape.rows - 1) / 2];
  }

  #space(axis: 0 | 1, value: number): void {
    const [sx, sy] = this.place.spacing_m;
    // Equal spacings are one number and change together; unequal ones change by themselves.
    const next: [number, number] = sx === sy && axis === 0 ? [value, value] : axis === 0 ? [value, sy] : [sx, value];
    this.#emit(respaced(this.place, next, ...this.#middle));
  }

  #widen(value: number): void {
    const [wide] = extentOf(this.shape, this.place);
    const [sx, sy] = this.place.spacing_m;
    const k = value / wide;
    this.#emit(respaced(this.place, [k * sx, k * sy], ...this.#middle));
  }

  protected override render(): TemplateResult {
    const { shape, place, sizeM, disabled } = this;
    const [x, y] = centreOf(shape, place);
    const [wide] = extentOf(shape, place);
    const [sx, sy] = place.spacing_m;
    const far = 8 * sizeM;
    const field = (
      label: string,
      unit: string,
      value: number,
      bounds: readonly [number, number],
      digits: number,
      set: (v: number) => void,
    ): TemplateResult => html`<esk-number
      label=${label}
      unit=${unit}
      .value=${value}
      min=${bounds[0]}
      max=${bounds[1]}
      digits=${digits}
      ?disabled=${disabled}
      @number=${(e: CustomEvent<number>) => set(e.detail)}
    ></esk-number>`;
    const steps = [MIN_GRID_SPACING_M, MAX_GRID_SPACING_M] as const;
    return html`
      <div class="two">
        ${field(msg("Middle, east"), "m", x, [-far, far], 1, (v) => this.#centre(0, v))}
        ${field(msg("Middle, north"), "m", y, [-far, far], 1, (v) => this.#centre(1, v))}
        ${field(msg("Width"), "m", wide, [steps[0], steps[1] * shape.cols], 1, (v) => this.#widen(v))}
        ${field(msg("Turned"), "°", place.rotation_deg, [-360, 360], 2, (v) => this.#emit(turned(shape, place, v)))}
        ${
          sx === sy
            ? field(msg("Spacing"), "m", sx, steps, 3, (v) => this.#space(0, v))
            : html`${field(msg("Spacing, along"), "m", sx, steps, 3, (v) => this.#space(0, v))}
              ${field(msg("Spacing, across"), "m", sy, steps, 3, (v) => this.#space(1, v))}`
        }
        ${field(msg("Heights"), "×", place.scale, [-MAX_VERTICAL_SCALE, MAX_VERTICAL_SCALE], 4, (v) => this.#emit({ ...place, scale: v }))}
        ${field(msg("Lift"), "m", place.lift_m, [-far, far], 1, (v) => this.#emit({ ...place, lift_m: v }))}
      </div>
      <div class="row">
        <button class="btn outline" ?disabled=${disabled} @click=${() => this.#emit(fitted(shape, place, sizeM))}>${msg("Fit to the terrain")}</button>
        <button class="btn outline" ?disabled=${disabled} @click=${() => this.#emit(turned(shape, place, 0))}>${msg("North up")}</button>
      </div>
    `;
  }
}

customElements.define("esk-placement-form", EskPlacementForm);
