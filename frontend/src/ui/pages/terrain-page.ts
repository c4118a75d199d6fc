import { msg, str } from "@lit/localize";
import { effect, signal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import { ApiError, api } from "../../app/server/api.ts";
import { bringBack } from "../dialogs/delete-dialog.ts";
import "../controls/drop-zone.ts";
import { VIEW_ONLY } from "../../app/layers/groundwork.ts";
import "../controls/icon-library.ts";
import { DRAWN, DRAWN_ON, DRAWN_ON_MAP, hintWords } from "../../app/words/hints.ts";
import { icon } from "../controls/icons.ts";
import "../bars/class-note.ts";
import "../bars/placing-bar.ts";
import { memberName } from "../../app/device/names.ts";
import { setFlag } from "../../app/device/storage.ts";
import { importingWords } from "../../app/layers/others.ts";
import { pageActions } from "../../app/page-actions.ts";
import { TerrainSession } from "../../app/session.ts";
import { installTestHook } from "../../app/test-hook.ts";
import { Room } from "../../app/view/make-room.ts";
import { deepFocus, nextRegion } from "../../app/view/regions.ts";
import type { Stage } from "../../app/view/stage.ts";
import { SignalElement } from "../controls/signal-element.ts";
import { sentenceStyles } from "../styles/sentences.ts";
import { shared } from "../styles/shared.ts";
import { terrainPageStyles } from "../styles/terrain-page.ts";
import "../controls/toasts.ts";
import type { PageCommand } from "../bars/top-bar.ts";
import {
  type DialogId,
  dialogs,
  foot,
  historyViewBar,
  inspector,
  lessonBar,
  measurePanel,
  overlay,
  type PanelTab,
  toolRail,
  topBar,
} from "./handover.ts";

const TABS = [
  { value: "stroke", label: msg("Stroke") },
  { value: "ground", label: msg("Ground"), title: msg("Real ground: layers of elevation") },
  { value: "terrain", label: msg("Terrain") },
  { value: "history", label: msg("History"), title: msg("What everybody did, and the terrain as it was") },
];
const TASK = { value: "task", label: msg("Task"), title: msg("What is asked, and how far one is") };
const LEADING = [
  ...TABS,
  TASK,
  { value: "lesson", label: msg("Lesson"), title: msg("Lead the lesson: hands off, look here, people") },
];

const WIDE = "(min-width: 1000px)";
const NARROW = "(max-width: 720px)";

/** A task is there for who leads, who may write one, and for all where there is one. */
function tabsOf({ session, task }: Stage): typeof TABS {
  if (session.lesson.state.value.conducts) return LEADING;
  return task.task.value === null ? TABS : [TASK, ...TABS];
}

/** Whether the inspector has more tabs than for a terrain without a lesson. */
const isWide = (stage: Stage): boolean => tabsOf(stage).length > TABS.length;

/** `/t/{id}`: the picture over the whole window, and calm chrome that floats on it. */
export class EskTerrain extends SignalElement {
  static override styles = [shared, terrainPageStyles, sentenceStyles];
  terrain = "";
  secret = "";
  readonly #session = signal<TerrainSession | null>(null);
  readonly #panel = signal<PanelTab | null>(null);
  readonly #dialog = signal<DialogId | null>(null);
  /** Set while the panel is open only because a stroke was selected. */
  #openedBySelection = false;
  #stops: (() => void)[] = [];
  #room: Room | null = null;

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
          toNow: () => stage.session.timeLapse.leave(),
          addGround: () => this.#browse(),
          region: (back) => this.renderRoot instanceof ShadowRoot && nextRegion(this.renderRoot, back),
        });
      }),
      effect(() => {
        const input = session.stage.value?.input;
        const picked = input?.tool.value === "select";
        this.#followSelection(input?.selection.value ?? null, picked);
        if (input?.selection.value && picked) requestAnimationFrame(() => this.#makeRoom());
        else this.#room?.giveBack();
      }),
      effect(() => {
        const strokes = session.doc.doc.value?.strokes.size ?? 0;
        if (strokes > 0) setFlag(session.store, DRAWN);
        // An ink that draws no new stroke changes one.
        const input = session.stage.value?.input;
        const redraws = input !== undefined && input.ink.value !== null && input.drawing.value === null;
        if (strokes > 1 || redraws) setFlag(session.store, DRAWN_ON);
        const onMap = session.stage.value?.camera.state.peek().mode === "map";
        if (onMap && input?.drawing.value) setFlag(session.store, DRAWN_ON_MAP);
      }),
      effect(() => {
        // The drawer would hide the ground on which the grid is laid, or the past.
        const laid = session.stage.value?.input.placing.value ?? null;
        if ((laid !== null || session.historyView.active.value) && window.matchMedia(NARROW).matches)
          this.#panel.value = null;
      }),
      effect(() => {
        const stage = session.stage.value;
        this.toggleAttribute("drawer", this.#panel.value !== null);
        this.toggleAttribute("leads", stage !== null && isWide(stage));
      }),
      effect(() => {
        if ((session.stage.value?.groundwork.asking.value ?? 0) > 0) this.#panel.value = "ground";
      }),
      effect(() => {
        this.#panel.value;
        session.stage.value?.input.ruler.kind.value;
        if (session.stage.value) setTimeout(() => this.#tellCovered(), 0);
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
    this.#room ??= new Room(stage.camera);
    this.#room.make(stage.input.handles.peek(), (p) => stage.box.toWindow(p), side, ratio);
  }

  /** Home is the whole land beside what covers the picture. An inspector that a selection opened does not move the view. */
  #tellCovered(): void {
    const stage = this.#session.peek()?.stage.peek();
    if (stage) stage.box.cover((selector) => this.renderRoot.querySelector(selector), !this.#openedBySelection);
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

  #command(command: PageCommand): void {
    if (command === "panel") this.#togglePanel();
    else if (command === "download") void this.#download();
    else if (command === "add-ground") this.#browse();
    else if (command === "layers") this.#toggle("ground");
    else if (command === "history" || command === "lesson") this.#toggle(command);
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
      session.toasts.show(error instanceof ApiError ? error.message : msg("The download failed. Try again."), "warn");
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
        aria-label=${msg("Terrain. Enter draws with the arrow keys, question mark lists all keys.")}
      ></div>
      ${stage ? this.#chrome(stage) : this.#veil(session)}
      ${session ? html`<esk-class-note .told=${session.inClass} .standing=${session.role} .state=${session.connection.state} .terrain=${session.id} .secret=${session.secret}></esk-class-note>` : nothing}
      ${session ? html`<esk-toasts .toasts=${session.toasts}></esk-toasts>` : nothing}
    `;
  }

  #veil(session: TerrainSession | null): TemplateResult {
    const closed = !this.secret || session?.connection.state.value === "closed";
    const reason = this.secret
      ? (session?.connection.reason.value ?? msg("The connection was closed."))
      : msg("This link is incomplete: the part after # is missing. Ask for the whole link.");
    const waiting =
      session?.connection.state.value === "reconnecting"
        ? session.connection.reason.value
        : msg("Opening the terrain…");
    return html`
      <div class="veil" role="status">
        <img src="/favicon.svg" alt="" width="52" height="52" class=${closed ? "" : "breathing"} />
        ${
          closed
            ? html`<h1>${msg("This terrain cannot be opened.")}</h1>
                <p>${reason}</p>
                ${session ? bringBack(session) : nothing}
                <a class="btn outline" href="/">${msg("Go to the start page")}</a>`
            : html`<p>${waiting}</p>`
        }
      </div>
    `;
  }

  #chrome(stage: Stage): TemplateResult {
    return html`
      ${overlay(stage)} ${topBar(stage, this.#panel.value !== null, (command) => this.#command(command))}
      ${toolRail(stage)} ${foot(stage, () => this.#toggle("task"))}
      ${this.#hint(stage)} ${this.#keyPen(stage)} ${this.#following(stage)} ${this.#closedBar(stage)} ${this.#offline(stage)} ${this.#graphics(stage)} ${this.#notice(stage)}
      ${this.#importing(stage)} ${lessonBar(stage)}
      <esk-placing-bar
        .placing=${stage.input.placing}
        ?beside=${this.#panel.value === "ground"}
        @numbers=${() => {
          this.#panel.value = "ground";
        }}
      ></esk-placing-bar>
      ${measurePanel(stage, this.#panel.value !== null)}
      ${historyViewBar(stage, this.#panel.value !== null)}
      ${this.#panel.value === null ? nothing : this.#side(stage, this.#panel.value)} ${this.#ways(stage)}
      ${dialogs(stage, this.#dialog.value, this.#closeDialog)}
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
      <aside class="side panel ${isWide(stage) ? "leads" : ""}" aria-label=${msg("Inspector")}>
        <header>
          <esk-segmented
            label=${msg("Inspector")}
            .segments=${tabsOf(stage)}
            .value=${tab}
            @pick=${(e: CustomEvent<PanelTab>) => {
              this.#openedBySelection = false;
              this.#panel.value = e.detail;
            }}
          ></esk-segmented>
          <button class="icon-btn small" aria-label=${msg("Close the inspector")} @click=${() => this.#togglePanel()}>${icon("xmark")}</button>
        </header>
        <div class="scroll">
          ${inspector(stage, tab, () => this.#browse())}
        </div>
      </aside>
    `;
  }

  /** How elevation files come in: dropped anywhere, or chosen. */
  #ways(stage: Stage): TemplateResult {
    const edit = stage.session.canEdit.value;
    return html`
      <esk-drop-zone
        lead=${edit ? msg("Drop it: real ground") : msg("You can look here, not change")}
        detail=${edit ? msg("GeoTIFF, HGT, Esri ASCII, IMG, DTED, 16-bit PNG, RAW, NPY. Everybody here sees it appear.") : VIEW_ONLY}
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

  /** Imports of other people, shown while the panel that lists them is shut. */
  #importing(stage: Stage): TemplateResult | typeof nothing {
    const { groundwork } = stage;
    const other = this.#panel.value === "ground" ? undefined : groundwork.others.list.value.at(-1);
    const words = groundwork.onItsWay ?? (other && importingWords(other));
    if (!words) return nothing;
    return html`<div class="importing panel" role="status">${icon("upload")}<span>${words}</span></div>`;
  }

  #hint(stage: Stage): TemplateResult | typeof nothing {
    const words = hintWords(stage, this.#panel.value === "ground" || stage.groundwork.imports.jobs.value.length > 0);
    return words === null ? nothing : html`<div class="hint panel">${icon("sketch")}<span>${words}</span></div>`;
  }

  /** The next step of the pen of the arrow keys: read aloud, and shown while the pen is. */
  #keyPen(stage: Stage): TemplateResult {
    const { visual, words } = stage.input.keyPen;
    return html`<div class=${visual.value === null ? "visually-hidden" : "hint panel"} role="status" aria-live="polite">
      ${visual.value === null ? nothing : icon("sketch")}<span>${words.value}</span>
    </div>`;
  }

  #following(stage: Stage): TemplateResult | typeof nothing {
    const leader = stage.session.members.value.find((m) => m.client === stage.following.value);
    if (!leader || stage.session.lesson.leader.value !== null) return nothing;
    return html`<div class="hint panel" style="border-color:${leader.colour}">
      ${icon("eye")}<span>${msg(str`Following ${memberName(leader)}. Move the view to stop.`)}</span>
    </div>`;
  }

  /** The connection ended for good while the terrain is open: says why and what to do. */
  #closedBar(stage: Stage): TemplateResult | typeof nothing {
    const { connection, status } = stage.session;
    if (connection.state.value !== "closed") return nothing;
    return html`<div class="closed panel" role="alert">
      ${icon("warning")}<span>${status.value.detail}</span>
      ${bringBack(stage.session)}
      <button class="btn outline" @click=${() => window.location.reload()}>${msg("Reload")}</button>
    </div>`;
  }

  /** No connection: in words at every width, with why the ground does not answer. */
  #offline(stage: Stage): TemplateResult | typeof nothing {
    const { connection, status } = stage.session;
    if (connection.state.value !== "reconnecting") return nothing;
    return html`<div class="closed notice offline panel" role="status">
      ${icon("cloud-off")}<span>${msg(html`<strong>${status.value.text}.</strong> The server makes the ground: it stays as it is until the connection is back.`)}</span>
    </div>`;
  }

  /** The graphics device went away: what the page does about it, and a way back from the map. */
  #graphics(stage: Stage): TemplateResult | typeof nothing {
    const { graphics, session } = stage;
    const notice = graphics.notice.value;
    if (notice === null || session.connection.state.value === "closed") return nothing;
    return html`<div class="closed notice panel" role="status">
      ${icon("info")}<span>${notice.text}</span>
      ${notice.retry ? html`<button class="btn outline" @click=${() => graphics.retry()}>${msg("Try the 3D view again")}</button>` : nothing}
      <button class="icon-btn small" aria-label=${msg("Dismiss")} @click=${() => graphics.dismiss()}>${icon("xmark")}</button>
    </div>`;
  }

  /** The server's sentence about its solver: another device, a lower level. It stands until it is read. */
  #notice(stage: Stage): TemplateResult | typeof nothing {
    const { connection, notice } = stage.session;
    if (notice.value === null || connection.state.value === "closed") return nothing;
    // Notices share one place, so one is shown at a time.
    if (stage.graphics.notice.value !== null) return nothing;
    return html`<div class="closed notice panel" role="status">
      ${icon("info")}<span>${notice.value}</span>
      <button class="icon-btn small" aria-label=${msg("Dismiss")} @click=${() => stage.session.dismissNotice()}>${icon("xmark")}</button>
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
