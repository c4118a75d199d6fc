import { msg, str } from "@lit/localize";
import { html, nothing, type TemplateResult } from "lit";
import type { Paint, Stroke, StrokeFields } from "../../generated/contract.ts";
import type { DrawToolId } from "../../input/defaults.ts";
import type { DetailChange } from "./detail-form.ts";
import "./detail-form.ts";
import { icon } from "../controls/icons.ts";
import type { YieldChange } from "./meeting-form.ts";
import "./meeting-form.ts";
import { type CourseFact, courseFacts } from "../../app/words/course-words.ts";
import { kindWord } from "../../app/words/kind-word.ts";
import { courseStyle } from "../../input/defaults.ts";
import type { CourseStyle } from "../../input/sketch/courseline.ts";
import { restyled } from "../../input/tools/coursedrag.ts";
import type { CourseChange } from "./course-form.ts";
import "./course-form.ts";
import type { PaintChange } from "./paint-form.ts";
import "./paint-form.ts";
import { reliefOf, shapeOf } from "../../app/view/scene.ts";
import { SUBSTANCES } from "../../app/words/paints.ts";
import type { SectionChange } from "./section-form.ts";
import "./section-form.ts";
import type { ReadonlySignal, Signal } from "@preact/signals-core";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import type { Ground } from "../../core/types.ts";
import type { Doc } from "../../doc/document.ts";
import type { Meeting } from "../../doc/meetings.ts";
import type { ToolDefaults } from "../../input/defaults.ts";
import type { Action, ToolId } from "../../input/keys/action.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { panelStyles } from "../styles/panel.ts";
import { shared } from "../styles/shared.ts";

const LISTED = 200;
const PAINT_BY_MOUSE = msg("Draw on the ground to paint. Alt, or the other end of a pen, does the opposite.");
const PAINT_BY_HAND = msg(
  "Draw on the ground to paint. Remove takes it away again, and so does the other end of a pen.",
);

const COURSE_LEADS = {
  river: msg("Draw along the ground. The bed runs down from its higher end and never rises."),
  road: msg("Draw along the ground. The road cuts and fills so that it is nowhere steeper than this."),
  ridge: msg("Draw along the ground, in 3D or on the map. It rises along the line."),
} as const;

/** The measures of a drawn course. */
function styleOf({ course, left, right, plateau_radius_m }: Stroke): CourseStyle {
  const { use, grade, depth_m } = course!;
  const bankM = Math.max(left?.extent_m ?? 0, right?.extent_m ?? 0);
  return { use, grade, depthM: depth_m, widthM: 2 * plateau_radius_m, bankM };
}

/** The dot before a stroke's name. */
function swatch(stroke: Stroke): TemplateResult {
  if (stroke.paint !== null)
    return html`<span class="swatch paint" style=${`background:${SUBSTANCES[stroke.paint.channel].colour}`}></span>`;
  if (stroke.course !== null) return html`<span class="swatch ${stroke.course.use}"></span>`;
  const tone = stroke.kind === "level" ? "plateau" : shapeOf(stroke).sinks ? "crevice" : "mountain";
  return html`<span class="swatch ${tone}"></span>`;
}

/** The inspector: the selected stroke, else what the drawing tool will make, else the list of strokes. */
export class EskStrokePanel extends SignalElement {
  static override properties = {
    doc: { attribute: false },
    selection: { attribute: false },
    tool: { attribute: false },
    canEdit: { attribute: false },
    defaults: { attribute: false },
    meets: { attribute: false },
    ground: { attribute: false },
    sizeM: { attribute: false },
    actions: { attribute: false },
    edits: { attribute: false },
    filter: { state: true },
  };
  static override styles = [shared, panelStyles];

  declare doc: ReadonlySignal<Doc | null>;
  /** The chosen stroke; a click in the list chooses one. */
  declare selection: Signal<string | null>;
  declare tool: ReadonlySignal<ToolId>;
  declare canEdit: ReadonlySignal<boolean>;
  /** The values that new strokes get. The form of a drawing tool changes them. */
  declare defaults: ToolDefaults;
  /** Strokes that cross the chosen one. */
  declare meets: ReadonlySignal<readonly Meeting[]>;
  /** The solved ground now; null before it has come. */
  declare ground: () => Ground | null;
  declare sizeM: number;
  /** Actions that the buttons run. */
  declare actions: ReadonlyMap<string, Action>;
  declare edits: Pick<OpenTerrain, "newGesture" | "setStroke">;
  declare filter: string;
  #gesture: string | null = null;
  readonly #coarse = window.matchMedia("(pointer: coarse)");

  constructor() {
    super();
    this.filter = "";
  }

  protected override render(): TemplateResult {
    const canEdit = this.canEdit.value;
    const doc = this.doc.value;
    const stroke = doc?.strokes.get(this.selection.value ?? "");
    const tool = this.tool.value;
    const beside = tool === "paint" && stroke?.paint === null && canEdit;
    if (stroke && !beside) return this.#selected(stroke);
    if (tool === "paint" && canEdit) return this.#brush();
    if (tool === "course" && canEdit) return this.#nextCourse();
    if (tool !== "select" && tool !== "paint" && tool !== "course" && canEdit) return this.#defaults(tool);
    return this.#list([...(doc?.strokes.values() ?? [])]);
  }

  #set(stroke: Stroke, fields: StrokeFields, settled: boolean): void {
    this.#gesture ??= this.edits.newGesture();
    this.edits.setStroke(stroke.id, fields, this.#gesture);
    if (settled) this.#gesture = null;
  }

  #selected(stroke: Stroke): TemplateResult {
    const { edits } = this;
    const disabled = !this.canEdit.value || stroke.locked;
    return html`
      <div class="title">
        ${swatch(stroke)}
        <input
          class="field name"
          aria-label=${msg("Name of the stroke")}
          maxlength="80"
          placeholder=${kindWord(stroke)}
          .value=${stroke.label}
          ?disabled=${disabled}
          @change=${(e: Event) => edits.setStroke(stroke.id, { label: (e.target as HTMLInputElement).value.trim() })}
          @keydown=${blurOnEnter}
        />
      </div>
      ${this.#buttons(stroke, disabled)}
      ${stroke.locked ? html`<p class="note">${icon("lock")} ${msg("Locked. Unlock it to change it.")}</p>` : nothing}
      ${
        stroke.paint !== null
          ? this.#paint(stroke, stroke.paint, disabled)
          : stroke.course !== null
            ? this.#course(stroke, disabled)
            : this.#section(stroke, disabled)
      }
      ${stroke.author ? html`<p class="quiet small">${msg(str`Drawn by ${stroke.author}`)}</p>` : nothing}
    `;
  }

  #paint(stroke: Stroke, paint: Paint, disabled: boolean): TemplateResult {
    return html`<esk-paint-form
      .paint=${paint}
      .sizeM=${this.sizeM}
      ?disabled=${disabled}
      @change=${(e: CustomEvent<PaintChange>) => this.#set(stroke, { paint: e.detail.paint }, e.detail.settled)}
    ></esk-paint-form>`;
  }

  /** The form for the paint of the brush. */
  #brush(): TemplateResult {
    const { defaults, sizeM } = this;
    return html`
      <p class="lead">${this.#coarse.matches ? PAINT_BY_HAND : PAINT_BY_MOUSE}</p>
      <esk-paint-form
        .paint=${defaults.paint.value}
        .sizeM=${sizeM}
        @change=${(e: CustomEvent<PaintChange>) => {
          defaults.paint.value = e.detail.paint;
        }}
      ></esk-paint-form>
    `;
  }

  /** The form of a river, a road or a ridge. */
  #course(stroke: Stroke, disabled: boolean): TemplateResult {
    const change = (e: CustomEvent<CourseChange>): void =>
      this.#set(stroke, restyled(stroke, e.detail.style), e.detail.settled);
    return this.#courseForm(styleOf(stroke), courseFacts(stroke, this.ground()), disabled, change);
  }

  /** The form for the next river, road or ridge; another use begins with its own measures. */
  #nextCourse(): TemplateResult {
    const { course } = this.defaults;
    const change = ({ detail: { style } }: CustomEvent<CourseChange>): void => {
      course.value = style.use === course.value.use ? style : courseStyle(style.use, this.sizeM);
    };
    return html`<p class="lead">${COURSE_LEADS[course.value.use]}</p>
      ${this.#courseForm(course.value, [], false, change)}`;
  }

  #courseForm(
    value: CourseStyle,
    facts: readonly CourseFact[],
    disabled: boolean,
    change: (e: CustomEvent<CourseChange>) => void,
  ): TemplateResult {
    return html`<esk-course-form
      .value=${value}
      .facts=${facts}
      .sizeM=${this.sizeM}
      ?disabled=${disabled}
      @change=${change}
    ></esk-course-form>`;
  }

  #section(stroke: Stroke, disabled: boolean): TemplateResult {
    const { sizeM } = this;
    const up = !shapeOf(stroke).sinks;
    return html`
      <esk-section-form
        style=${stroke.kind === "level" ? "--land: var(--esk-plateau)" : ""}
        .fields=${{ left: stroke.left, right: stroke.right, plateau_radius_m: stroke.plateau_radius_m }}
        .reliefM=${stroke.kind === "level" ? this.#levelRelief(stroke) : reliefOf(stroke)}
        .sizeM=${sizeM}
        .sense=${up ? "up" : "down"}
        ?disabled=${disabled}
        @change=${(e: CustomEvent<SectionChange>) => this.#set(stroke, e.detail.fields, e.detail.settled)}
      ></esk-section-form>
      <esk-detail-form
        .fields=${{ amplitude_m: stroke.amplitude_m, roughness: stroke.roughness }}
        .sizeM=${sizeM}
        ?disabled=${disabled}
        @change=${(e: CustomEvent<DetailChange>) => this.#set(stroke, e.detail.fields, e.detail.settled)}
      ></esk-detail-form>
      ${this.#meetings(stroke, disabled)}
    `;
  }

  /** The strokes that cross this one, and which of them gives way. */
  #meetings(stroke: Stroke, disabled: boolean): TemplateResult {
    const { edits, meets } = this;
    const strokes = this.doc.value?.strokes;
    const rows = meets.value.flatMap(({ other, mine, theirs }) => {
      const met = strokes?.get(other);
      if (!met) return [];
      return [
        { id: other, name: met.label || kindWord(met), mine, theirs, yields: met.yields === 1, locked: met.locked },
      ];
    });
    return html`<esk-meeting-form
      .yields=${stroke.yields}
      .rows=${rows}
      ?disabled=${disabled}
      ?editable=${this.canEdit.value}
      @select=${(e: CustomEvent<string>) => this.#select(e.detail)}
      @change=${({ detail }: CustomEvent<YieldChange>) => {
        if (detail.id === null) this.#set(stroke, { yields: detail.yields }, detail.settled);
        else edits.setStroke(detail.id, { yields: detail.yields });
      }}
    ></esk-meeting-form>`;
  }

  /** A plateau's own height over zero, bounded so that the picture stays readable. */
  #levelRelief(stroke: Stroke): number {
    const relief = stroke.first[2];
    return Math.abs(relief) < this.sizeM / 200 ? this.sizeM / 40 : relief;
  }

  #buttons(stroke: Stroke, disabled: boolean): TemplateResult {
    const { edits, actions } = this;
    const edit = this.canEdit.value;
    return html`
      <div class="row" role="toolbar" aria-label=${msg("Stroke")}>
        ${iconButton("frame", msg("Look at it"), true, false, () => actions.get("frame-selection")?.run())}
        ${iconButton("copy", msg("Duplicate"), edit, false, () => actions.get("duplicate")?.run())}
        ${
          stroke.paint !== null
            ? nothing
            : iconButton("swap", msg("Swap left and right"), !disabled, false, () =>
                edits.setStroke(stroke.id, { left: stroke.right, right: stroke.left }),
              )
        }
        ${iconButton(
          stroke.hidden ? "eye-slash" : "eye",
          stroke.hidden ? msg("Show") : msg("Hide"),
          !disabled,
          stroke.hidden,
          () => edits.setStroke(stroke.id, { hidden: !stroke.hidden }),
        )}
        ${iconButton(
          stroke.locked ? "lock" : "unlock",
          stroke.locked ? msg("Unlock") : msg("Lock"),
          edit,
          stroke.locked,
          () => edits.setStroke(stroke.id, { locked: !stroke.locked }),
        )}
        ${iconButton("trash", msg("Delete"), !disabled, false, () => actions.get("delete")?.run())}
      </div>
    `;
  }

  #defaults(tool: DrawToolId): TemplateResult {
    const { defaults, sizeM } = this;
    const style = defaults[tool];
    const { left, right, plateau_radius_m, amplitude_m, roughness } = style.value;
    const change = (e: CustomEvent<SectionChange | DetailChange>): void => {
      style.value = { ...style.value, ...e.detail.fields };
    };
    const down = tool === "crevice";
    return html`
      <p class="lead">${tool === "plateau" ? msg("New plateaux get this cross-section.") : tool === "crevice" ? msg("New crevices get this cross-section.") : msg("New mountains get this cross-section.")}</p>
      <esk-section-form
        style=${tool === "plateau" ? "--land: var(--esk-plateau)" : ""}
        .fields=${{ left, right, plateau_radius_m }}
        .reliefM=${(down ? -1 : 1) * sizeM * 0.05}
        .sizeM=${sizeM}
        .sense=${down ? "down" : "up"}
        @change=${change}
      ></esk-section-form>
      <esk-detail-form .fields=${{ amplitude_m, roughness }} .sizeM=${sizeM} @change=${change}></esk-detail-form>
    `;
  }

  #list(strokes: Stroke[]): TemplateResult {
    if (strokes.length === 0) {
      return html`<div class="empty">${icon("sketch")}<p>${msg("No strokes yet. Pick a tool and draw a line across the land.")}</p></div>`;
    }
    const wanted = this.filter.trim().toLowerCase();
    const found = strokes.filter((s) => `${s.label} ${kindWord(s)} ${s.author}`.toLowerCase().includes(wanted));
    return html`
      <p class="lead">${strokes.length === 1 ? msg("One stroke makes this terrain. Select one to shape it.") : msg(str`${strokes.length} strokes make this terrain. Select one to shape it.`)}</p>
      ${
        strokes.length > 8
          ? html`<input class="field" type="search" placeholder=${msg("Find a stroke")} aria-label=${msg("Find a stroke")} .value=${this.filter}
              @input=${(e: Event) => {
                this.filter = (e.target as HTMLInputElement).value;
              }} @keydown=${(e: Event) => e.stopPropagation()} />`
          : nothing
      }
      <ul class="strokes">
        ${found
          .slice(-LISTED)
          .reverse()
          .map((s) => this.#item(s))}
      </ul>
      ${found.length > LISTED ? html`<p class="quiet small">${msg(str`The newest ${LISTED} are listed. Search to find others.`)}</p>` : nothing}
    `;
  }

  #item(stroke: Stroke): TemplateResult {
    return html`
      <li>
        <button class="btn item" @click=${() => this.#select(stroke.id)}>
          ${swatch(stroke)}
          <span class="label">${stroke.label || kindWord(stroke)}</span>
          ${stroke.hidden ? icon("eye-slash") : nothing} ${stroke.locked ? icon("lock") : nothing}
        </button>
      </li>
    `;
  }

  #select(id: string): void {
    this.selection.value = id;
    this.actions.get("frame-selection")?.run();
  }
}

function iconButton(name: string, label: string, enabled: boolean, pressed: boolean, run: () => void): TemplateResult {
  return html`<button
    class="icon-btn small"
    aria-label=${label}
    title=${label}
    aria-pressed=${pressed ? "true" : nothing}
    ?disabled=${!enabled}
    @click=${run}
  >
    ${icon(name)}
  </button>`;
}

/** Enter in a text field means: done. Keys stay in the field. */
export function blurOnEnter(event: KeyboardEvent): void {
  event.stopPropagation();
  if (event.key === "Enter" || event.key === "Escape") (event.target as HTMLElement).blur();
}

customElements.define("esk-stroke-panel", EskStrokePanel);
