import { effect, signal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { aboutDialog } from "./about-dialog.ts";
import { ApiError, api } from "./api.ts";
import "./drop-zone.ts";
import "./export-dialog.ts";
import { VIEW_ONLY } from "./groundwork.ts";
import "./help-dialog.ts";
import "./history-panel.ts";
import "./icon-library.ts";
import { DRAWN, DRAWN_ON, hintWords } from "./hints.ts";
import { icon } from "./icons.ts";
import "./layers-panel.ts";
import "./laying-bar.ts";
import "./legend.ts";
import "./overlay.ts";
import "./past-bar.ts";
import { makeRoom } from "./make-room.ts";
import { importingWords } from "./others.ts";
import { pageActions } from "./page-actions.ts";
import { memberName } from "./people.ts";
import "./profile-dialog.ts";
import { deepFocus, nextRegion } from "./regions.ts";
import { TerrainSession } from "./session.ts";
import "./share-dialog.ts";
import { SignalElement } from "./signal-element.ts";
import type { Stage } from "./stage.ts";
import "./status-line.ts";
import { setFlag } from "./storage.ts";
import "./stroke-panel.ts";
import { shared } from "./styles/shared.ts";
import { terrainPageStyles } from "./styles/terrain-page.ts";
import "./terrain-panel.ts";
import { installTestHook } from "./test-hook.ts";
import "./toasts.ts";
import "./tool-rail.ts";
import "./top-bar.ts";
import type { PageCommand } from "./top-bar.ts";
import "./view-bar.ts";

type PanelTab = "stroke" | "ground" | "terrain" | "history";
type DialogId = "share" | "profile" | "help" | "about" | "export";

const TABS = [
  { value: "stroke", label: "Stroke" },
  { value: "ground", label: "Ground", title: "Real ground: layers of elevation" },
  { value: "terrain", label: "Terrain" },
  { value: "history", label: "History", title: "What everybody did, and the terrain as it was" },
];

const WIDE = "(min-width: 1000px)";
const NARROW = "(max-width: 720px)";

/** `/t/{id}`: the picture over the whole window, and calm chrome that floats on it. */
export class EskTerrain extends SignalElement {
  static override styles = [shared, terrainPageStyles];
  terrain = "";
  secret = "";
  readonly #session = signal<TerrainSession | null>(null);
  readonly #panel = signal<PanelTab | null>(null);
  readonly #dialog = signal<DialogId | null>(null);
  /** Set while the panel is open only because a stroke was selected. */
  #openedBySelection = false;
  #stops: (() => void)[] = [];

  protected override firstUpdated(): void {
    if (!this.secret) return;
    const viewport = this.renderRoot.querySelector<HTMLElement>(".viewport");
    if (!viewport) throw new Error("The page has no viewport.");
    const session = new TerrainSession(this.terrain, this.secret, viewport);
    this.#session.value = session;
    this.#stops = [
      effect(() => {
        const stage = session.stage.value;
        if (!stage) return;
        pageActions(stage.input.actions, stage, {
          panel: () => this.#togglePanel(),
          help: () => this.#show("help"),
          share: () => this.#show("share"),
          export: () => this.#show("export"),
          layers: () => this.#toggle("ground"),
          history: () => this.#toggle("history"),
          toLand: () => {
            // Hands on a mouse have not moved the focus: nothing jumps for them.
            if (deepFocus()?.matches(":focus-visible")) this.#focusLand();
          },
          toNow: () => stage.session.lapse.leave(),
          addGround: () => this.#browse(),
          region: (back) => this.renderRoot instanceof ShadowRoot && nextRegion(this.renderRoot, back),
        });
      }),
      effect(() => {
        const input = session.stage.value?.input;
        const picked = input?.tool.value === "select";
        this.#followSelection(input?.selection.value ?? null, picked);
        if (input?.selection.value && picked) requestAnimationFrame(() => this.#makeRoom());
      }),
      effect(() => {
        const strokes = session.doc.doc.value?.strokes.size ?? 0;
        if (strokes > 0) setFlag(session.store, DRAWN);
        // An ink that draws no new stroke changes one.
        const input = session.stage.value?.input;
        const redraws = input !== undefined && input.ink.value !== null && input.drawing.value === null;
        if (strokes > 1 || redraws) setFlag(session.store, DRAWN_ON);
      }),
      effect(() => {
        // The sheet would hide the ground on which the grid is laid, or the past.
        const laid = session.stage.value?.input.laying.value ?? null;
        if ((laid !== null || session.past.active.value) && window.matchMedia(NARROW).matches) this.#panel.value = null;
      }),
      effect(() => {
        this.toggleAttribute("sheet", this.#panel.value !== null);
      }),
      effect(() => {
        if ((session.stage.value?.groundwork.asking.value ?? 0) > 0) this.#panel.value = "ground";
      }),
      installTestHook(session),
    ];
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    for (const stop of this.#stops) stop();
    this.#session.value?.dispose();
  }

  /** On a wide window the inspector comes with a selection in the select tool and goes with it; drawing does not call it. */
  #followSelection(selection: string | null, picked: boolean): void {
    if (selection !== null && picked && this.#panel.peek() === null && window.matchMedia(WIDE).matches) {
      this.#panel.value = "stroke";
      this.#openedBySelection = true;
    } else if (selection === null && this.#openedBySelection) {
      this.#panel.value = null;
      this.#openedBySelection = false;
    }
  }

  /** Handles of a stroke that has just been selected come out from under the inspector. */
  #makeRoom(): void {
    const stage = this.#session.peek()?.stage.peek();
    const side = this.renderRoot.querySelector("aside.side")?.getBoundingClientRect();
    if (!stage || !side || !window.matchMedia(WIDE).matches || stage.input.inputMode.peek() !== "idle") return;
    const ratio = stage.camera.state.peek().width / Math.max(1, this.clientWidth);
    makeRoom(stage.camera, stage.input.handles.peek(), (p) => stage.toWindow(p), side, ratio);
  }

  #togglePanel(): void {
    this.#openedBySelection = false;
    this.#panel.value = this.#panel.peek() === null ? "stroke" : null;
  }

  #toggle(tab: PanelTab): void {
    this.#openedBySelection = false;
    this.#panel.value = this.#panel.peek() === tab ? null : tab;
  }

  /** Asks for files with the system's own dialog: the way in for touch and keyboard. */
  #browse(): void {
    const stage = this.#session.peek()?.stage.peek();
    if (stage && !stage.session.canEdit.peek()) stage.session.toasts.show(VIEW_ONLY, "warn");
    else this.renderRoot.querySelector<HTMLInputElement>("#grids")?.click();
  }

  #bring(stage: Stage, files: Iterable<File>): void {
    stage.groundwork.add(files);
    if (!stage.session.canEdit.peek()) return;
    this.#openedBySelection = false;
    this.#panel.value = "ground";
  }

  #show(dialog: DialogId): void {
    this.#dialog.value = dialog;
  }

  #command(event: CustomEvent<PageCommand>): void {
    const command = event.detail;
    if (command === "panel") this.#togglePanel();
    else if (command === "download") void this.#download();
    else if (command === "add-ground") this.#browse();
    else if (command === "layers") this.#toggle("ground");
    else if (command === "history") this.#toggle("history");
    else this.#show(command);
  }

  async #download(): Promise<void> {
    const session = this.#session.value;
    if (!session) return;
    try {
      const url = URL.createObjectURL(await api.archive(session.id, session.secret));
      const title = session.doc.doc.value?.settings.title ?? "terrain";
      const name =
        title
          .replace(/[^\p{L}\p{N}]+/gu, "-")
          .replace(/^-|-$/g, "")
          .toLowerCase() || "terrain";
      Object.assign(document.createElement("a"), { href: url, download: `${name}.esker` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10_000);
    } catch (error) {
      session.toasts.show(error instanceof ApiError ? error.message : "The download failed. Try again.", "warn");
    }
  }

  protected override render(): TemplateResult {
    const session = this.#session.value;
    const stage = session?.stage.value ?? null;
    return html`
      <div
        class="viewport"
        tabindex="0"
        role="application"
        aria-label="Terrain. Enter draws with the arrow keys, question mark lists all keys."
      ></div>
      ${stage ? this.#chrome(stage) : this.#veil(session)}
      ${session ? html`<esk-toasts .toasts=${session.toasts}></esk-toasts>` : nothing}
    `;
  }

  #veil(session: TerrainSession | null): TemplateResult {
    const closed = !this.secret || session?.connection.state.value === "closed";
    const reason = this.secret
      ? (session?.connection.reason.value ?? "The connection was closed.")
      : "This link is incomplete: the part after # is missing. Ask for the whole link.";
    const waiting =
      session?.connection.state.value === "reconnecting" ? session.connection.reason.value : "Opening the terrain…";
    return html`
      <div class="veil" role="status">
        <img src="/favicon.svg" alt="" width="52" height="52" class=${closed ? "" : "breathing"} />
        ${
          closed
            ? html`<h1>This terrain cannot be opened.</h1>
                <p>${reason}</p>
                <a class="btn outline" href="/">Go to the start page</a>`
            : html`<p>${waiting}</p>`
        }
      </div>
    `;
  }

  #chrome(stage: Stage): TemplateResult {
    return html`
      <esk-overlay .stage=${stage}></esk-overlay>
      <esk-top-bar .stage=${stage} .panelOpen=${this.#panel.value !== null} @command=${this.#command}></esk-top-bar>
      <esk-tools class="panel" .stage=${stage}></esk-tools>
      <div class="foot">
        <div class="notes">
          <esk-legend class="panel" .stage=${stage}></esk-legend>
          <esk-status-line class="panel" .stage=${stage}></esk-status-line>
        </div>
        <esk-view-bar class="panel" .stage=${stage}></esk-view-bar>
      </div>
      ${this.#hint(stage)} ${this.#keyPen(stage)} ${this.#following(stage)} ${this.#closedBar(stage)} ${this.#graphics(stage)} ${this.#notice(stage)}
      ${this.#importing(stage)}
      <esk-laying-bar
        .stage=${stage}
        ?beside=${this.#panel.value === "ground"}
        @numbers=${() => {
          this.#panel.value = "ground";
        }}
      ></esk-laying-bar>
      <esk-past-bar .stage=${stage} ?beside=${this.#panel.value !== null}></esk-past-bar>
      ${this.#panel.value === null ? nothing : this.#side(stage, this.#panel.value)} ${this.#ways(stage)}
      <esk-share .stage=${stage} .open=${this.#dialog.value === "share"} @close=${this.#closeDialog}></esk-share>
      <esk-profile .stage=${stage} .open=${this.#dialog.value === "profile"} @close=${this.#closeDialog}></esk-profile>
      <esk-export .stage=${stage} .open=${this.#dialog.value === "export"} @close=${this.#closeDialog}></esk-export>
      <esk-help .stage=${stage} .open=${this.#dialog.value === "help"} @close=${this.#closeDialog}></esk-help>
      ${aboutDialog(stage, this.#dialog.value === "about", this.#closeDialog)}
    `;
  }

  readonly #closeDialog = (): void => {
    if (this.#dialog.peek() === null) return;
    this.#dialog.value = null;
    // Keys belong to the terrain again.
    this.#focusLand();
  };

  #focusLand(): void {
    this.renderRoot.querySelector<HTMLElement>(".viewport")?.focus({ preventScroll: true });
  }

  #side(stage: Stage, tab: PanelTab): TemplateResult {
    return html`
      <aside class="side panel" aria-label="Inspector">
        <header>
          <esk-segmented
            label="Inspector"
            .segments=${TABS}
            .value=${tab}
            @pick=${(e: CustomEvent<PanelTab>) => {
              this.#openedBySelection = false;
              this.#panel.value = e.detail;
            }}
          ></esk-segmented>
          <button class="icon-btn small" aria-label="Close the inspector" @click=${() => this.#togglePanel()}>${icon("xmark")}</button>
        </header>
        <div class="scroll">
          ${this.#tab(stage, tab)}
        </div>
      </aside>
    `;
  }

  #tab(stage: Stage, tab: PanelTab): TemplateResult {
    if (tab === "stroke") return html`<esk-stroke-panel .stage=${stage}></esk-stroke-panel>`;
    if (tab === "history") return html`<esk-history-panel .stage=${stage}></esk-history-panel>`;
    if (tab === "terrain") return html`<esk-terrain-panel .stage=${stage}></esk-terrain-panel>`;
    return html`<esk-layers-panel .stage=${stage} @browse=${() => this.#browse()}></esk-layers-panel>`;
  }

  /** How elevation files come in: dropped anywhere, or chosen. */
  #ways(stage: Stage): TemplateResult {
    const edit = stage.session.canEdit.value;
    return html`
      <esk-drop-zone
        lead=${edit ? "Drop it: real ground" : "You can look here, not change"}
        detail=${edit ? "GeoTIFF, HGT, Esri ASCII, IMG, DTED, 16-bit PNG, RAW, NPY. Everybody here sees it appear." : VIEW_ONLY}
        @files=${(e: CustomEvent<File[]>) => this.#bring(stage, e.detail)}
      ></esk-drop-zone>
      <input
        id="grids"
        class="visually-hidden"
        type="file"
        multiple
        tabindex="-1"
        aria-hidden="true"
        @change=${(e: Event) => {
          const field = e.target as HTMLInputElement;
          this.#bring(stage, [...(field.files ?? [])]);
          field.value = "";
        }}
      />
    `;
  }

  /** What others bring in, while the panel that lists it is shut. */
  #importing(stage: Stage): TemplateResult | typeof nothing {
    const others = stage.groundwork.others.list.value;
    if (others.length === 0 || this.#panel.value === "ground") return nothing;
    return html`<div class="importing panel" role="status">
      ${icon("upload")}<span>${importingWords(others.at(-1)!)}</span>
    </div>`;
  }

  #hint(stage: Stage): TemplateResult | typeof nothing {
    const words = hintWords(stage, this.#panel.value === "ground" || stage.groundwork.imports.jobs.value.length > 0);
    return words === null ? nothing : html`<div class="hint panel">${icon("sketch")}<span>${words}</span></div>`;
  }

  /** What the pen of the arrow keys awaits: read aloud, and shown while the pen is. */
  #keyPen(stage: Stage): TemplateResult {
    const { visual, words } = stage.input.keyPen;
    return html`<div class=${visual.value === null ? "visually-hidden" : "hint panel"} role="status" aria-live="polite">
      ${visual.value === null ? nothing : icon("sketch")}<span>${words.value}</span>
    </div>`;
  }

  #following(stage: Stage): TemplateResult | typeof nothing {
    const leader = stage.session.members.value.find((m) => m.client === stage.following.value);
    if (!leader) return nothing;
    return html`<div class="hint panel" style="border-color:${leader.colour}">
      ${icon("eye")}<span>Following ${memberName(leader)}. Move the view to stop.</span>
    </div>`;
  }

  /** The connection ended for good while the terrain is open: says why and what to do. */
  #closedBar(stage: Stage): TemplateResult | typeof nothing {
    const { connection, status } = stage.session;
    if (connection.state.value !== "closed") return nothing;
    return html`<div class="closed panel" role="alert">
      ${icon("warning")}<span>${status.value.detail}</span>
      <button class="btn outline" @click=${() => window.location.reload()}>Reload</button>
    </div>`;
  }

  /** The graphics device went away: what the page does about it, and a way back from the map. */
  #graphics(stage: Stage): TemplateResult | typeof nothing {
    const { graphics, session } = stage;
    const notice = graphics.notice.value;
    if (notice === null || session.connection.state.value === "closed") return nothing;
    return html`<div class="closed notice panel" role="status">
      ${icon("info")}<span>${notice.text}</span>
      ${notice.retry ? html`<button class="btn outline" @click=${() => graphics.retry()}>Try the 3D view again</button>` : nothing}
      <button class="icon-btn small" aria-label="Dismiss" @click=${() => graphics.dismiss()}>${icon("xmark")}</button>
    </div>`;
  }

  /** What the server said about its solver: another device, a lower level. Stands until it is read. */
  #notice(stage: Stage): TemplateResult | typeof nothing {
    const { connection, notice } = stage.session;
    if (notice.value === null || connection.state.value === "closed") return nothing;
    // One at a time: they share a place.
    if (stage.graphics.notice.value !== null) return nothing;
    return html`<div class="closed notice panel" role="status">
      ${icon("info")}<span>${notice.value}</span>
      <button class="icon-btn small" aria-label="Dismiss" @click=${() => stage.session.dismissNotice()}>${icon("xmark")}</button>
    </div>`;
  }
}

customElements.define("esk-terrain", EskTerrain);

/** The page of one terrain, to be put into the document. */
export function openTerrain(id: string, secret: string): HTMLElement {
  const page = document.createElement("esk-terrain") as EskTerrain;
  page.terrain = id;
  page.secret = secret;
  return page;
}
