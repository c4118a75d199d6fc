import { msg } from "@lit/localize";
import { css, html, LitElement, nothing, type TemplateResult } from "lit";
import { COURSE_WORDS } from "../../app/words/kind-word.ts";
import type { Course } from "../../generated/contract.ts";
import type { CourseStyle } from "../../input/sketch/courseline.ts";
import "../controls/range-field.ts";
import "../controls/segmented.ts";
import { shared } from "../styles/shared.ts";

/** The event `change` carries the whole style, and whether the gesture is over. */
export interface CourseChange {
  readonly style: CourseStyle;
  readonly settled: boolean;
}

/** Words that say of what a measure is, for people who hear a field away from its heading. */
const OF = { river: msg("of the river"), road: msg("of the road"), ridge: msg("of the ridge") } as const;

const USES = (Object.entries(COURSE_WORDS) as [Course["use"], string][]).map(([value, label]) => ({ value, label }));

/** A river, a road or a ridge: its use, how wide it is, its banks, how deep it lies and how steep it may be. Fires `change`. */
export class EskCourseForm extends LitElement {
  static override properties = {
    value: { attribute: false },
    facts: { attribute: false },
    sizeM: { type: Number },
    disabled: { type: Boolean },
  };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        gap: 12px;
      }
      dl {
        display: grid;
        grid-template-columns: 1fr auto;
        gap: 4px 12px;
        margin: 0;
        font-size: 0.8125rem;
        font-variant-numeric: tabular-nums;
      }
      dt {
        color: var(--esk-quiet);
      }
      dd {
        margin: 0;
      }
      .over {
        color: var(--esk-danger);
        font-weight: 600;
      }
    `,
  ];

  declare value: CourseStyle;
  /** What is known of a drawn one: name, text, and whether it is more than was asked for. */
  declare facts: readonly { readonly name: string; readonly text: string; readonly over: boolean }[];
  declare sizeM: number;
  declare disabled: boolean;

  constructor() {
    super();
    this.value = { use: "river", widthM: 12, bankM: 80, depthM: 8, grade: 0.08 };
    this.facts = [];
    this.sizeM = 4096;
    this.disabled = false;
  }

  #emit(fields: Partial<CourseStyle>, settled: boolean): void {
    this.value = { ...this.value, ...fields };
    this.dispatchEvent(new CustomEvent<CourseChange>("change", { detail: { style: this.value, settled } }));
  }

  protected override render(): TemplateResult {
    const { use, grade } = this.value;
    const size = this.sizeM;
    return html`
      <esk-segmented
        label=${msg("River, road or ridge")}
        .segments=${USES}
        .value=${use}
        ?disabled=${this.disabled}
        @pick=${(e: CustomEvent<Course["use"]>) => this.#emit({ use: e.detail }, true)}
      ></esk-segmented>
      ${this.#metres(msg("Width"), "widthM", size / 4096, size / 32)}
      ${use === "road" ? this.#grade(grade) : this.#metres(use === "ridge" ? msg("Height") : msg("Depth"), "depthM", 0, size / 16)}
      ${this.#metres(msg("Banks"), "bankM", 0, size / 8)}
      ${
        this.facts.length === 0
          ? nothing
          : html`<dl>
              ${this.facts.map(
                (f) => html`<dt>${f.name}</dt>
                  <dd class=${f.over ? "over" : ""}>${f.text}</dd>`,
              )}
            </dl>`
      }
    `;
  }

  #metres(label: string, name: "widthM" | "bankM" | "depthM", min: number, max: number): TemplateResult {
    const set = (e: CustomEvent<number>, settled: boolean): void => this.#emit({ [name]: e.detail }, settled);
    return html`<esk-range
      label=${label}
      of=${OF[this.value.use]}
      unit="m"
      min=${min}
      max=${max}
      step=${max / 512}
      .value=${this.value[name]}
      ?disabled=${this.disabled}
      @value=${(e: CustomEvent<number>) => set(e, false)}
      @settle=${(e: CustomEvent<number>) => set(e, true)}
    ></esk-range>`;
  }

  #grade(grade: number): TemplateResult {
    const set = (e: CustomEvent<number>, settled: boolean): void => this.#emit({ grade: e.detail / 100 }, settled);
    return html`<esk-range
      label=${msg("Steepest grade")}
      of=${OF.road}
      unit="%"
      min="1"
      max="40"
      step="0.5"
      .value=${Math.round(1000 * grade) / 10}
      ?disabled=${this.disabled}
      @value=${(e: CustomEvent<number>) => set(e, false)}
      @settle=${(e: CustomEvent<number>) => set(e, true)}
    ></esk-range>`;
  }
}

customElements.define("esk-course-form", EskCourseForm);
