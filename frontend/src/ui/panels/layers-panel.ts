import { msg, str } from "@lit/localize";
import { html, nothing, type TemplateResult } from "lit";
import { repeat } from "lit/directives/repeat.js";
import { type Layer, MAX_LAYERS } from "../../generated/contract.ts";
import { icon } from "../controls/icons.ts";
import "./import-card.ts";
import { isOver } from "../../app/layers/imports.ts";
import { keyText } from "../../app/words/keys.ts";
import "./layer-form.ts";
import type { ReadonlySignal } from "@preact/signals-core";
import type { Groundwork } from "../../app/layers/groundwork.ts";
import { layerColour, layerName, orderedLayers, reorderOps } from "../../app/layers/layers.ts";
import { importingWords } from "../../app/layers/others.ts";
import type { OpenTerrain } from "../../app/open-terrain.ts";
import type { KeyedAction } from "../../app/words/keys.ts";
import type { Doc } from "../../doc/document.ts";
import type { Placing } from "../../input/tools/placement.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { layersPanelStyles } from "../styles/layers-panel.ts";
import { panelStyles } from "../styles/panel.ts";
import { shared } from "../styles/shared.ts";

interface Drag {
  readonly id: string;
  readonly pointerId: number;
  /** Where it would go. */
  to: number;
}

/** Real ground: files under way, and the layers in the order in which they are believed. Fires `browse`. */
export class EskLayersPanel extends SignalElement {
  static override properties = {
    doc: { attribute: false },
    groundwork: { attribute: false },
    placing: { attribute: false },
    sizeM: { attribute: false },
    canEdit: { attribute: false },
    actions: { attribute: false },
    edits: { attribute: false },
    drag: { state: true },
  };
  static override styles = [shared, panelStyles, layersPanelStyles];

  declare doc: ReadonlySignal<Doc | null>;
  declare groundwork: Groundwork;
  /** The grid in hand. */
  declare placing: ReadonlySignal<Placing | null>;
  declare sizeM: number;
  declare canEdit: ReadonlySignal<boolean>;
  declare actions: ReadonlyMap<string, KeyedAction>;
  declare edits: Pick<OpenTerrain, "newGesture" | "submit">;
  declare drag: Drag | null;

  constructor() {
    super();
    this.drag = null;
  }

  protected override render(): TemplateResult {
    const { groundwork } = this;
    const layers = orderedLayers(this.doc.value?.layers.values() ?? []);
    const jobs = groundwork.imports.jobs.value;
    const others = groundwork.others.list.value;
    return html`
      ${this.#adding(layers.length)}
      ${repeat(
        // Imports under way come before those that are over.
        [...jobs].sort((a, b) => Number(isOver(a.phase)) - Number(isOver(b.phase))),
        (j) => j.key,
        (j) =>
          html`<esk-import-card .job=${j} .groundwork=${groundwork} .placing=${this.placing} .sizeM=${this.sizeM}></esk-import-card>`,
      )}
      ${others.map((m) => html`<p class="note" role="status">${icon("upload")}<span>${importingWords(m)}</span></p>`)}
      ${layers.length === 0 ? (jobs.length + others.length === 0 ? this.#empty() : nothing) : this.#list(layers)}
    `;
  }

  #adding(layers: number): TemplateResult {
    if (!this.canEdit.value)
      return html`<p class="lead">${msg("This link lets you look at the layers, not change them.")}</p>`;
    if (layers >= MAX_LAYERS)
      return html`<p class="lead">${msg(str`A terrain holds ${MAX_LAYERS} layers. Delete one to bring in another.`)}</p>`;
    return html`<button
      class="btn primary add"
      title=${keyText(msg("Add real ground"), this.actions.get("add-ground"))}
      @click=${() => this.dispatchEvent(new CustomEvent("browse"))}
    >
      ${icon("plus")} ${msg("Add real ground…")}
    </button>`;
  }

  #empty(): TemplateResult {
    return html`<div class="empty">
      ${icon("landscape")}
      <p>${msg("No real ground yet. Drop a file with heights anywhere on this page: GeoTIFF, HGT, Esri ASCII, IMG, DTED, 16-bit PNG, RAW or NPY.")}</p>
      <p>${msg("Sketch on it as on any land. A finer grid, or one turned by any angle, melts into what lies there.")}</p>
    </div>`;
  }

  #list(layers: readonly Layer[]): TemplateResult {
    return html`
      ${layers.length > 1 ? html`<p class="lead">${msg("Where layers disagree, the upper one is believed.")}</p>` : nothing}
      <ol class="layers" aria-label=${msg("Layers, the most believed first")}>
        ${repeat(
          layers,
          (l) => l.id,
          (l, i) => this.#item(l, i, layers),
        )}
      </ol>
    `;
  }

  #item(layer: Layer, index: number, layers: readonly Layer[]): TemplateResult {
    const { groundwork, edits } = this;
    const open = groundwork.selected.value === layer.id;
    const edit = this.canEdit.value;
    const name = layerName(layer);
    const hover = (id: string | null) => () => {
      groundwork.hovered.value = id;
    };
    const target = this.drag !== null && this.drag.id !== layer.id && this.drag.to === index;
    return html`
      <li
        class="layer ${open ? "open" : ""} ${layer.hidden ? "hidden-layer" : ""} ${target ? "target" : ""}"
        data-dragged=${this.drag?.id === layer.id ? "true" : nothing}
        @pointerenter=${hover(layer.id)}
        @pointerleave=${hover(null)}
      >
        <div class="head">
          ${edit && layers.length > 1 ? this.#order(layer, index, layers, name) : nothing}
          <button
            class="btn item"
            aria-expanded=${open}
            @click=${() => {
              groundwork.selected.value = open ? null : layer.id;
            }}
          >
            <span class="swatch" style=${`background:${layerColour(layer.id)}`}></span>
            <span class="label">${name}</span>
          </button>
          ${this.#icon(
            layer.hidden ? "eye-slash" : "eye",
            layer.hidden ? msg(str`Show ${name}`) : msg(str`Hide ${name}`),
            edit,
            () => edits.submit({ type: "layer.set", layer: layer.id, fields: { hidden: !layer.hidden } }),
          )}
          ${this.#icon("trash", msg(str`Delete ${name}`), edit, () => edits.submit({ type: "layer.delete", layer: layer.id }))}
        </div>
        ${
          open
            ? html`<esk-layer-form
              .layer=${layer}
              .groundwork=${groundwork}
              .placing=${this.placing}
              .sizeM=${this.sizeM}
              .canEdit=${this.canEdit}
              .edits=${edits}
            ></esk-layer-form>`
            : nothing
        }
      </li>
    `;
  }

  #icon(name: string, label: string, enabled: boolean, run: () => void): TemplateResult {
    return html`<button class="icon-btn small" aria-label=${label} title=${label} ?disabled=${!enabled} @click=${run}>
      ${icon(name)}
    </button>`;
  }

  #order(layer: Layer, index: number, layers: readonly Layer[], name: string): TemplateResult {
    const label = msg(str`Order of ${name}: place ${index + 1} of ${layers.length}. Drag, or use the arrow keys`);
    return html`<button
      class="order"
      aria-label=${label}
      title=${msg("Drag to change the order")}
      @keydown=${(e: KeyboardEvent) => this.#key(e, layer.id, index, layers)}
      @pointerdown=${(e: PointerEvent) => this.#grab(e, layer.id, index)}
      @pointermove=${(e: PointerEvent) => this.#pull(e)}
      @pointerup=${(e: PointerEvent) => this.#drop(e, layers)}
      @pointercancel=${() => {
        this.drag = null;
      }}
    >
      ${icon("grip")}
    </button>`;
  }

  #key(event: KeyboardEvent, id: string, index: number, layers: readonly Layer[]): void {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    this.#reorder(layers, id, index + step);
    const button = event.currentTarget as HTMLElement;
    void this.updateComplete.then(() => button.focus());
  }

  #grab(event: PointerEvent, id: string, index: number): void {
    (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
    this.drag = { id, pointerId: event.pointerId, to: index };
  }

  #pull(event: PointerEvent): void {
    if (this.drag?.pointerId !== event.pointerId) return;
    const heads = [...this.renderRoot.querySelectorAll<HTMLElement>(".layer .head")];
    const at = heads.findIndex((head) => event.clientY < head.getBoundingClientRect().bottom);
    this.drag = { ...this.drag, to: at < 0 ? heads.length - 1 : at };
  }

  #drop(event: PointerEvent, layers: readonly Layer[]): void {
    if (this.drag?.pointerId !== event.pointerId) return;
    const { id, to } = this.drag;
    this.drag = null;
    this.#reorder(layers, id, to);
  }

  #reorder(layers: readonly Layer[], id: string, to: number): void {
    const ops = reorderOps(layers, id, to);
    if (ops.length > 0) this.edits.submit({ type: "group", ops });
  }
}

customElements.define("esk-layers-panel", EskLayersPanel);
