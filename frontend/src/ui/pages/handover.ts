/**
 * The values and functions that the page of a terrain hands to its bars, panels and dialogs: each gets what it shows
 * and what it may do.
 */

import { msg } from "@lit/localize";
import { computed, type ReadonlySignal } from "@preact/signals-core";
import { html, nothing, type TemplateResult } from "lit";
import type { Identity } from "../../app/device/storage.ts";
import type { Stage } from "../../app/view/stage.ts";
import type { Ground, QualityMode, Scene } from "../../core/types.ts";
import type { PageCommand } from "../bars/top-bar.ts";
import "../bars/people.ts";
import "../bars/history-view-bar.ts";
import "../bars/lesson-bar.ts";
import "../bars/status-line.ts";
import "../bars/tool-rail.ts";
import "../bars/top-bar.ts";
import "../bars/view-bar.ts";
import { aboutDialog } from "../dialogs/about-dialog.ts";
import { deleteDialog } from "../dialogs/delete-dialog.ts";
import "../dialogs/export-dialog.ts";
import "../dialogs/help-dialog.ts";
import "../dialogs/profile-dialog.ts";
import "../dialogs/share-dialog.ts";
import "../panels/history-panel.ts";
import "../panels/layers-panel.ts";
import "../panels/legend.ts";
import "../lesson/lesson-panel.ts";
import "../measuring/measure-panel.ts";
import "../panels/overlay.ts";
import "../panels/stroke-panel.ts";
import "../panels/terrain-panel.ts";
import "../water/water-panel.ts";
import "../task/task-chip.ts";
import "../task/task-panel.ts";

export type PanelTab = "stroke" | "ground" | "terrain" | "history" | "task" | "lesson";
export type DialogId = "share" | "profile" | "help" | "about" | "export" | "delete";

/** Handles, cursors and the brush, over the picture. */
export function overlay({ camera, input, cursor, defaults, shown, meets, session, marked }: Stage): TemplateResult {
  return html`<esk-overlay
    .camera=${camera}
    .input=${input}
    .cursor=${cursor}
    .paint=${defaults.paint}
    .ground=${shown.ground}
    .doc=${session.doc.doc}
    .meets=${meets}
    .people=${session.people}
    .canEdit=${session.canEdit}
    .marked=${marked}
  ></esk-overlay>`;
}

export function topBar(stage: Stage, panelOpen: boolean, command: (command: PageCommand) => void): TemplateResult {
  const { session, input, following } = stage;
  return html`<esk-top-bar
    .doc=${session.doc.doc}
    .status=${session.status}
    .canEdit=${session.canEdit}
    .lesson=${session.lesson.state}
    .myRole=${session.role}
    .actions=${input.actions}
    .panelOpen=${panelOpen}
    @command=${(e: CustomEvent<PageCommand>) => command(e.detail)}
    @retitle=${(e: CustomEvent<string>) => session.setTerrain({ title: e.detail })}
  >
    <esk-people
      slot="people"
      .client=${session.client}
      .me=${session.me}
      .members=${session.members}
      .people=${session.people}
      .following=${following}
      @follow=${(e: CustomEvent<string>) => stage.follow(e.detail)}
      @profile=${() => command("profile")}
    ></esk-people>
  </esk-top-bar>`;
}

export function toolRail({ input, session }: Stage): TemplateResult {
  return html`<esk-tools
    class="panel"
    .tool=${input.tool}
    .fingerDraws=${input.fingerDraws}
    .canUndo=${session.doc.canUndo}
    .canRedo=${session.doc.canRedo}
    .canEdit=${session.canEdit}
    .actions=${input.actions}
  ></esk-tools>`;
}

/** The legend, the progress of the ground, and the ways to look at it. */
export function foot(stage: Stage, openTask: () => void): TemplateResult {
  const { camera, channels, cursor, graphics, input, levels, quality, quietStrokes, session } = stage;
  return html`<esk-task-chip class="panel" .view=${stage.task} .score=${session.score} @open=${openTask}></esk-task-chip>
  <div class="foot">
    <div class="notes">
      <esk-legend
        class="panel"
        .overlay=${stage.overlay}
        .channels=${channels}
        .ground=${stage.shown}
        .cursor=${cursor}
        .doc=${session.doc.doc}
        .selection=${input.selection}
        .choices=${stage.view}
        .automaticM=${stage.contourM}
        .task=${stage.task}
      ></esk-legend>
      <esk-status-line
        class="panel"
        .cursor=${cursor}
        .doc=${session.doc.doc}
        .camera=${camera}
        .baseBuilding=${session.baseBuilding}
        .progress=${session.progress}
        .levels=${levels}
        .graphics=${graphics}
      ></esk-status-line>
    </div>
    <esk-view-bar
      class="panel"
      .view=${camera.state}
      .overlay=${stage.overlay}
      .showStrokes=${stage.showStrokes}
      .quiet=${quietStrokes.quiet}
      .quality=${quality.mode}
      .coarsenedPx=${stage.coarsenedPx}
      .renderer=${graphics.info}
      .measuring=${input.ruler.kind}
      .choices=${stage.view}
      .actions=${input.actions}
      @overlay=${(e: CustomEvent<Scene["overlay"]>) => stage.setOverlay(e.detail)}
      @strokes=${() => stage.toggleStrokes()}
      @quality=${(e: CustomEvent<QualityMode>) => quality.choose(e.detail)}
    ></esk-view-bar>
  </div>`;
}

const grounds = new WeakMap<Stage, () => Ground | null>();

/** The solved ground, anew with its tiles. */
function groundOf(stage: Stage): () => Ground | null {
  const known = grounds.get(stage);
  if (known !== undefined) return known;
  const made = (): Ground | null => {
    stage.tiles.revision.value;
    return stage.tiles.size > 0 ? stage.tiles.freeze() : null;
  };
  grounds.set(stage, made);
  return made;
}

const headings = new WeakMap<Stage, ReadonlySignal<string>>();

function headingOf(stage: Stage): ReadonlySignal<string> {
  const known = headings.get(stage) ?? computed(() => stage.session.doc.doc.value?.settings.title ?? "");
  headings.set(stage, known);
  return known;
}

/** What is measured, while something is. */
export function measurePanel(stage: Stage, beside: boolean): TemplateResult | typeof nothing {
  const kind = stage.input.ruler.kind.value;
  if (kind === null) return nothing;
  if (kind === "water") return waterPanel(stage, beside);
  return html`<esk-measure
    class="panel"
    role="region"
    aria-label=${msg("Measuring")}
    .instruments=${stage.instruments}
    .sizeM=${stage.sizeM}
    .heading=${headingOf(stage)}
    .historyClock=${stage.session.historyView.shown}
    ?beside=${beside}
  ></esk-measure>`;
}

function waterPanel(stage: Stage, beside: boolean): TemplateResult {
  const { session, sizeM, tiles, water } = stage;
  return html`<esk-water
    class="panel"
    role="region"
    aria-label=${msg("Water")}
    .water=${water}
    .doc=${session.doc.doc}
    .canEdit=${session.canEdit}
    .tiles=${tiles}
    .edits=${session}
    .sizeM=${sizeM}
    ?beside=${beside}
  ></esk-water>`;
}

export function historyViewBar({ session }: Stage, beside: boolean): TemplateResult {
  return html`<esk-history-view-bar
    .historyView=${session.historyView}
    .timeLapse=${session.timeLapse}
    .history=${session.history}
    .newest=${session.newest}
    .mayEdit=${session.mayEdit}
    .client=${session.client}
    ?beside=${beside}
  ></esk-history-view-bar>`;
}

export function lessonBar({ session }: Stage): TemplateResult | typeof nothing {
  if (session.connection.state.value === "closed") return nothing;
  return html`<esk-lesson-bar .lesson=${session.lesson} .mayEdit=${session.mayEdit} .client=${session.client}></esk-lesson-bar>`;
}

/** One tab of the inspector. */
export function inspector(stage: Stage, tab: PanelTab, browse: () => void): TemplateResult {
  const { session, input, sizeM } = stage;
  const { doc } = session.doc;
  if (tab === "stroke")
    return html`<esk-stroke-panel
      .doc=${doc}
      .selection=${input.selection}
      .tool=${input.tool}
      .canEdit=${session.canEdit}
      .defaults=${stage.defaults}
      .meets=${stage.meets}
      .ground=${groundOf(stage)}
      .sizeM=${sizeM}
      .actions=${input.actions}
      .edits=${session}
    ></esk-stroke-panel>`;
  if (tab === "history")
    return html`<esk-history-panel
      .history=${session.history}
      .historyView=${session.historyView}
      .timeLapse=${session.timeLapse}
      .newest=${session.newest}
      .members=${session.members}
      .client=${session.client}
    ></esk-history-panel>`;
  if (tab === "task")
    return html`<esk-task-panel
      .view=${stage.task}
      .score=${session.score}
      .lesson=${session.lesson.state}
      .ruler=${input.ruler}
      .tiles=${stage.tiles}
      .edits=${session}
    ></esk-task-panel>`;
  if (tab === "lesson")
    return html`<esk-lesson-panel
      .lesson=${session.lesson}
      .members=${session.members}
      .myRole=${session.role}
      .client=${session.client}
    ></esk-lesson-panel>`;
  if (tab === "terrain")
    return html`<esk-terrain-panel
      .doc=${doc}
      .canEdit=${session.canEdit}
      .tiles=${stage.tiles}
      .edits=${session}
    ></esk-terrain-panel>`;
  return html`<esk-layers-panel
    .doc=${doc}
    .groundwork=${stage.groundwork}
    .placing=${input.placing}
    .sizeM=${sizeM}
    .canEdit=${session.canEdit}
    .actions=${input.actions}
    .edits=${session}
    @browse=${browse}
  ></esk-layers-panel>`;
}

export function dialogs(stage: Stage, open: DialogId | null, close: () => void): TemplateResult {
  const { session, input, sizeM } = stage;
  return html`
    <esk-share .terrain=${session} .open=${open === "share"} @close=${close}></esk-share>
    <esk-profile
      .me=${session.me}
      .client=${session.client}
      .open=${open === "profile"}
      @rename=${(e: CustomEvent<Identity>) => session.rename(e.detail)}
      @close=${close}
    ></esk-profile>
    <esk-export .terrain=${session} .sizeM=${sizeM} .open=${open === "export"} @close=${close}></esk-export>
    <esk-help .actions=${input.actions} .open=${open === "help"} @close=${close}></esk-help>
    ${aboutDialog(stage, open === "about", close)} ${deleteDialog(session, open === "delete", close)}
  `;
}
