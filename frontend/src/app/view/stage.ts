/** Where the terrain is seen and touched: tiles, camera, input, renderer and the loop that draws frames. */

import { computed, effect, type ReadonlySignal, signal } from "@preact/signals-core";
import { Camera } from "../../core/camera/camera.ts";
import type { Land } from "../../core/camera/state.ts";
import { isGround } from "../../core/streams.ts";
import type {
  ChannelGrid,
  CursorVisual,
  DecodedFrame,
  FootprintVisual,
  FrameStats,
  Ground,
  Scene,
  StrokeVisual,
  Vec3,
} from "../../core/types.ts";
import type { Doc } from "../../doc/document.ts";
import { strokeInfluence } from "../../doc/influence.ts";
import { spanOf } from "../../doc/layers.ts";
import { type Meeting, meetings } from "../../doc/meetings.ts";
import type { MemberPresence } from "../../generated/contract.ts";
import { MAX_REFINED_TILES, TILE_SAMPLES } from "../../generated/contract.ts";
import { InputController } from "../../input/controller.ts";
import { type ToolDefaults, toolDefaults } from "../../input/defaults.ts";
import { ChannelStore } from "../../tiles/detail/channels.ts";
import { ShownTerrain } from "../../tiles/shownterrain.ts";
import { TileStore } from "../../tiles/store.ts";
import { keepImports, keptImports } from "../device/kept-imports.ts";
import { keepViews, keptViews } from "../device/kept-views.ts";
import { QualityChoice, TAU_PX } from "../device/quality-choice.ts";
import { largeLetters, ViewChoices } from "../device/view-choices.ts";
import { Groundwork } from "../layers/groundwork.ts";
import { riverLines } from "../layers/river-lines.ts";
import { ShownRivers } from "../layers/shown-rivers.ts";
import { StillGround } from "../layers/still-ground.ts";
import { TaskView } from "../lesson/task/task-view.ts";
import type { OpenTerrain } from "../open-terrain.ts";
import { gridTransport } from "../server/grid-transport.ts";
import { Arrival } from "./eye/arrival.ts";
import { coveredEdges } from "./eye/covered.ts";
import { Following } from "./eye/following.ts";
import { landOf } from "./eye/land.ts";
import { FrameLoop } from "./frame-loop.ts";
import { FreshTiles } from "./fresh-tiles.ts";
import { Graphics } from "./graphics.ts";
import { Instruments } from "./instruments/instruments.ts";
import { QuietStrokes } from "./quiet-strokes.ts";
import { deepFocus } from "./regions.ts";
import { cursorVisuals, strokeVisuals } from "./scene.ts";
import { otherDrops } from "./water/others.ts";
import { WaterTool } from "./water/water-tool.ts";

export interface StageOptions {
  readonly session: OpenTerrain;
  readonly sizeM: number;
  /** Finest level that is solved everywhere. */
  readonly levels: number;
  /** Finest level to which tiles are refined where somebody looks. */
  readonly finest: number;
  /** The element that fills the window: holds the canvas, takes the pointer and the keys. */
  readonly viewport: HTMLElement;
}

/** How long a view at home takes to go along when the inspector opens. */
const COVER_MS = 260;

export class Stage {
  readonly session: OpenTerrain;
  readonly sizeM: number;
  readonly levels: number;
  readonly finest: number;
  readonly camera: Camera;
  readonly tiles: TileStore;
  readonly channels: ChannelStore;
  /** The ground as it is drawn: solved heights with synthesised detail. */
  readonly shown: ShownTerrain;
  readonly input: InputController;
  readonly groundwork: Groundwork;
  readonly instruments: Instruments;
  readonly water: WaterTool;
  /** A place on a section that somebody points at, on the ground. */
  readonly marked: ReadonlySignal<Vec3 | null>;
  /** The task of the terrain, and how far the ground is from it. */
  readonly task: TaskView;
  readonly defaults: ToolDefaults;
  readonly loop: FrameLoop;
  readonly overlay = signal<Scene["overlay"]>("none");
  readonly showStrokes = signal(true);
  /** Height between the contours that are drawn, metres. */
  readonly contourM = computed(() => this.view.contourM || (this.stats.value?.contourM ?? 0));
  readonly quietStrokes = new QuietStrokes();
  readonly cursor = signal<Vec3 | null>(null);
  readonly graphics: Graphics;
  readonly quality: QualityChoice;
  /** How this device shows terrains. */
  readonly view: ViewChoices;
  readonly following: ReadonlySignal<string | null>;
  readonly stats = signal<FrameStats | null>(null);
  /** Screen-error bound of the picture, pixels, where this device has no room for the chosen one. */
  readonly coarsenedPx = computed(() => this.stats.value?.coarsenedPx ?? null);
  /** Strokes that cross the selected one, in the select tool. */
  readonly meets: ReadonlySignal<readonly Meeting[]> = computed(() => {
    const doc = this.session.doc.doc.value;
    const stroke = doc?.strokes.get(this.input.selection.value ?? "");
    return doc && stroke && this.input.tool.value === "select" ? meetings(stroke, doc.strokes.values()) : [];
  });
  readonly #viewport: HTMLElement;
  readonly #strokes: ReadonlySignal<readonly StrokeVisual[]>;
  readonly #rivers: ReadonlySignal<readonly FootprintVisual[]>;
  readonly #shownRivers: ShownRivers;
  readonly #cursors: ReadonlySignal<readonly CursorVisual[]>;
  /** Where the selected stroke is felt, while that overlay is shown. */
  readonly #influence: ReadonlySignal<ChannelGrid | null>;
  readonly #calm = window.matchMedia("(prefers-reduced-motion: reduce)");
  readonly #stops: (() => void)[] = [];
  /** The ground that the eye may not dip under. */
  readonly #floor: Ground;
  #fresh: FreshTiles | null = null;
  readonly #still: StillGround;
  readonly #follows: Following;
  readonly #arrival: Arrival;
  #disposed = false;
  /** Finds what floats on the picture. */
  #find: ((selector: string) => Element | null) | null = null;

  constructor({ session, sizeM, levels, finest, viewport }: StageOptions) {
    this.session = session;
    this.sizeM = sizeM;
    this.levels = levels;
    this.finest = finest;
    this.#viewport = viewport;
    this.camera = new Camera(sizeM);
    this.camera.calm = this.#calm.matches;
    this.camera.landNow = () => this.#land();
    this.#follows = new Following({
      session,
      camera: this.camera,
      calm: () => this.#calm.matches,
      redraw: () => this.loop.invalidate(),
    });
    this.following = this.#follows.client;
    this.#arrival = new Arrival(session);
    this.tiles = new TileStore(sizeM, finest, levels);
    this.channels = new ChannelStore(sizeM);
    this.shown = new ShownTerrain(this.tiles, this.channels, () => {
      const doc = session.doc.doc.peek();
      return doc && { ...doc.settings, ground: spanOf(doc.layers.values()) };
    });
    this.#floor = {
      ...this.shown.ground,
      heightAt: (x, y) => this.shown.floorUnder(x, y, this.camera.state.peek().eye[2]),
    };
    this.defaults = toolDefaults(sizeM);
    this.loop = new FrameLoop((dt, time) => this.#draw(dt, time));
    this.quality = new QualityChoice(session.store);
    this.view = new ViewChoices(session.store);
    this.camera.exaggerate(this.view.exaggeration);
    this.graphics = new Graphics({
      viewport,
      camera: this.camera,
      say: (text) => session.toasts.show(text),
      onOpened: () => this.loop.invalidate(),
    });
    this.input = new InputController({
      canvas: viewport,
      camera: this.camera,
      doc: session.doc,
      ground: () => {
        // Handles lie on the ground and follow it.
        this.tiles.revision.value;
        return this.shown.ground;
      },
      freeze: () => this.shown.freeze(),
      clientId: session.client,
      canEdit: () => session.canEdit.value,
      defaults: this.defaults,
      onCursor: (point) => {
        this.cursor.value = point;
      },
      onMessage: (text, refused) => {
        if (refused === undefined) session.toasts.show(text);
        else session.refused({ code: refused.code, message: text }, refused.op);
      },
      author: () => session.me.value.name,
    });
    this.task = new TaskView({
      doc: session.doc.doc,
      tiles: this.tiles,
      overlay: this.overlay,
      conducts: () => session.lesson.state.value.conducts,
    });
    this.instruments = new Instruments(this.input.ruler, this.tiles, this.task.asked);
    this.#still = new StillGround(this.tiles.revision, () => this.shown.freeze());
    this.water = new WaterTool({
      sizeM,
      ruler: this.input.ruler,
      ground: () => {
        this.tiles.revision.value;
        this.channels.revision.value;
        session.doc.doc.value;
        return this.shown.field();
      },
      shown: () => this.#still.ground.value ?? this.shown.freeze(),
      seaM: () => session.doc.doc.value?.settings.sea_level_m ?? null,
      others: () => otherDrops(session.people.value),
      calm: () => this.#calm.matches,
    });
    this.marked = computed(() => this.water.marked.value ?? this.instruments.marked.value);
    this.groundwork = new Groundwork({
      sizeM,
      doc: session.doc,
      camera: this.camera,
      placing: this.input.placing,
      canEdit: () => session.canEdit.value,
      ground: () => {
        this.tiles.revision.value;
        return this.shown.freeze();
      },
      transport: gridTransport(session),
      calm: () => this.input.tool.value !== "select",
      kept: keptImports(session.id),
      keep: (kept) => keepImports(session.id, kept),
      say: (text, tone) => session.toasts.show(text, tone),
      progress: session.progress,
      author: () => session.me.value.name,
    });
    this.#strokes = computed(() => this.#visuals());
    this.#rivers = computed(() => {
      const settings = session.doc.doc.value?.settings;
      const set = session.rivers.value;
      if (!settings?.rivers || set === null || this.graphics.info.value?.kind !== "map") return [];
      const ground = this.#still.ground.value;
      return ground === null ? [] : riverLines(set, settings.wetness, ground);
    });
    this.#shownRivers = new ShownRivers(sizeM);
    this.#cursors = computed(() => cursorVisuals(session.people.value));
    this.#influence = computed(() => {
      if (this.overlay.value !== "influence") return null;
      const doc = session.doc.doc.value;
      const stroke = doc?.strokes.get(this.input.selection.value ?? "");
      return doc && stroke ? strokeInfluence(stroke, doc.settings.reach_m, sizeM) : null;
    });
  }

  #visuals(): StrokeVisual[] {
    const doc = this.session.doc.doc.value;
    const { selection, hovered, drawing, tool } = this.input;
    const marks = {
      tool: tool.value === "select" || tool.value === "paint" ? tool.value : ("draw" as const),
      selection: selection.value,
      hovered: hovered.value,
      drawing: drawing.value,
      quiet: this.quietStrokes.quiet.value,
      clear: !this.view.quietLines,
    };
    // Lines of paint lie on the ground and move with it.
    if (hasPaint(doc)) this.tiles.revision.value;
    return doc ? strokeVisuals(doc, marks, this.session.people.value, this.shown.freeze()) : [];
  }

  /** Finds a renderer and starts drawing. */
  async start(): Promise<void> {
    this.camera.loadViews(keptViews(this.session.store, this.session.id));
    this.#watch();
    const empty = (this.session.doc.doc.value?.strokes.size ?? 0) === 0;
    this.input.tool.value = empty && this.session.canEdit.value ? "mountain" : "select";
    if (!empty) this.quietStrokes.begin(this.input);
    this.camera.home(0);
    await this.graphics.open();
    if (this.#disposed) return;
    this.loop.start();
  }

  /**
   * Shows a frame. False when the page now holds more tiles than the server may have sent: the two no longer agree on what
   * is held, and only a new connection helps.
   */
  apply(frame: DecodedFrame): boolean {
    if (!isGround(frame.channel)) this.channels.apply(frame);
    else if (this.#fresh) this.#fresh.apply(frame);
    else this.tiles.apply(frame);
    const most = Math.max(this.tiles.size, this.tiles.baseSize);
    return most <= (4 ** (this.levels + 1) - 1) / 3 + 2 * MAX_REFINED_TILES;
  }

  /** The server starts anew after a reconnect and sends every tile again: the old ground stays until the new is here. */
  restart(): void {
    this.channels.restart();
    this.#fresh?.stop();
    this.#fresh = new FreshTiles(this.tiles, () => {
      this.#fresh = null;
      this.channels.renewed();
    });
  }

  /** Where a world point is in the window: CSS pixels. */
  toWindow(point: Vec3): { x: number; y: number; visible: boolean } {
    const p = this.camera.project(point);
    const box = this.#viewport.getBoundingClientRect();
    const ratio = this.camera.state.peek().width / Math.max(1, box.width);
    return { x: box.left + p.x / ratio, y: box.top + p.y / ratio, visible: p.visible };
  }

  /** Follows a person's view until I move the camera myself; the same person again stops it. */
  follow(client: string | null): void {
    this.#follows.toggle(client);
  }

  /** New presences have come: the view goes along with the person that is followed. */
  followed(changed: readonly MemberPresence[]): void {
    this.#follows.moved(changed);
  }

  /** Says what floats on the picture, found by its selector. `follow`: a view that is still at home goes along. */
  cover(find: (selector: string) => Element | null, follow: boolean): void {
    this.#find = find;
    const box = (selector: string): DOMRect | null => find(selector)?.getBoundingClientRect() ?? null;
    const picture = this.#viewport.getBoundingClientRect();
    if (picture.width === 0) return;
    const chrome = {
      top: box("esk-top-bar"),
      tools: box("esk-tools"),
      foot: box("esk-measure") ?? box("esk-water") ?? box("esk-view-bar"),
      side: box("aside.side"),
    };
    const edges = coveredEdges(picture, chrome);
    const ratio = this.camera.state.peek().width / picture.width;
    const scaled = Object.fromEntries(Object.entries(edges).map(([edge, px]) => [edge, px * ratio]));
    this.camera.inset({ ...edges, ...scaled }, follow, this.loop.frames > 0 ? COVER_MS : 0);
    this.loop.invalidate();
  }

  /** Shows all strokes, or none; those that are still quiet are shown. */
  toggleStrokes(): void {
    this.showStrokes.value = this.quietStrokes.quiet.value || !this.showStrokes.value;
    this.quietStrokes.end();
  }

  setOverlay(overlay: Scene["overlay"]): void {
    this.overlay.value = overlay;
  }

  dispose(): void {
    this.#disposed = true;
    this.#fresh?.stop();
    this.loop.stop();
    for (const stop of this.#stops) stop();
    this.#still.stop();
    this.quietStrokes.stop();
    this.groundwork.dispose();
    this.instruments.dispose();
    this.water.dispose();
    this.task.dispose();
    this.input.dispose();
    this.graphics.dispose();
  }

  /** Redraws on every change that a frame shows, and tells the server where I look. */
  #watch(): void {
    const { session, input } = this;
    // Drawing prevents the default of the pointer, so a field that had the keys would keep them.
    const takeKeys = (): void => {
      const active = deepFocus();
      if (active instanceof HTMLElement && active !== document.body) active.blur();
    };
    this.#viewport.addEventListener("pointerdown", takeKeys);
    this.#stops.push(() => this.#viewport.removeEventListener("pointerdown", takeKeys));
    this.#stops.push(...this.#follows.watch(this.#viewport));
    this.#stops.push(
      effect(() => {
        this.camera.state.value;
        session.viewChanged();
        session.presenceChanged();
        this.loop.invalidate();
      }),
      effect(() => this.camera.exaggerate(this.view.exaggeration)),
      effect(() => largeLetters(this.view.projector)),
      () => largeLetters(false),
      effect(() => keepViews(session.store, session.id, this.camera.views.value)),
      effect(() => {
        this.cursor.value;
        input.drawing.value;
        input.held.value;
        input.tool.value;
        this.water.place.value;
        session.presenceChanged();
      }),
      effect(() => {
        this.tiles.revision.value;
        this.channels.revision.value;
        session.doc.doc.value;
        this.#strokes.value;
        this.#cursors.value;
        input.ghost.value;
        this.groundwork.footprints.value;
        this.#rivers.value;
        session.rivers.value;
        this.instruments.lines.value;
        this.water.lines.value;
        this.water.floodVisual.value;
        this.water.shower.raining.value;
        this.task.lines.value;
        this.task.difference.value;
        this.groundwork.visual.value;
        this.overlay.value;
        this.quality.mode.value;
        this.view.choices.value;
        this.showStrokes.value;
        this.loop.invalidate();
      }),
    );
    this.#stops.push(
      effect(() => {
        this.tiles.revision.value;
        const isDrawing = this.input.drawing.value !== null;
        this.#arrival.follow(this.#land(), isDrawing, (land) => this.camera.stand(land));
      }),
    );
    this.#watchSize();
  }

  /** How the land lies now; null before it has come. */
  #land(): Land | null {
    const heights = this.tiles.tile(0, 0, 0)?.heights;
    return heights === undefined ? null : landOf(heights, TILE_SAMPLES, this.sizeM);
  }

  #watchSize(): void {
    const resize = (): void => {
      const canvas = this.#viewport.querySelector("canvas");
      const ratio = Math.min(window.devicePixelRatio, 2);
      const width = Math.max(1, Math.round(this.#viewport.clientWidth * ratio));
      const height = Math.max(1, Math.round(this.#viewport.clientHeight * ratio));
      if (canvas && (canvas.width !== width || canvas.height !== height)) Object.assign(canvas, { width, height });
      this.camera.resize(width, height);
      if (this.#find !== null) this.cover(this.#find, true);
      this.loop.invalidate();
    };
    const observer = new ResizeObserver(resize);
    observer.observe(this.#viewport);
    this.#stops.push(() => observer.disconnect());
    resize();
  }

  #draw(dtS: number, timeS: number): boolean {
    const moving = this.camera.update(dtS, this.#floor);
    const doc = this.session.doc.doc.value;
    const { renderer } = this.graphics;
    const quality = this.quality.mode.peek();
    if (!renderer || !doc) return moving;
    const drops = this.water.drops(dtS);
    const rivers = this.#shownRivers.map(
      doc.settings.rivers ? this.session.rivers.value : null,
      doc.settings.wetness,
      this.#calm.matches ? Number.POSITIVE_INFINITY : timeS,
    );
    const stats = renderer.render({
      camera: this.camera.state.value,
      tiles: this.tiles,
      channels: this.channels,
      settings: doc.settings,
      ground: spanOf(doc.layers.values()),
      strokes: this.#strokes.value,
      ghost: this.input.ghost.value,
      cursors: this.#cursors.value,
      footprints: [
        ...this.#rivers.value,
        ...this.groundwork.footprints.value,
        ...this.task.lines.value,
        ...this.instruments.lines.value,
        ...this.water.lines.value,
      ],
      placing: this.groundwork.visual.value,
      tauPx: TAU_PX[quality],
      quality,
      surface: this.view.surface,
      time: this.#calm.matches ? 0 : timeS,
      ...this.#overlaid(),
      drops,
      rivers: renderer.kind === "map" ? null : rivers,
      flood: this.water.floodVisual.value,
      showStrokes: this.showStrokes.value,
      contourM: this.view.contourM,
      lineScale: this.view.lineScale,
    });
    this.stats.value = stats;
    return moving || stats.busy || this.#shownRivers.fading || (drops !== null && !this.#calm.matches);
  }

  /** The overlay; a watershed lies where no other does. */
  #overlaid(): Pick<Scene, "overlay" | "influence"> {
    const shed = this.water.tint.value;
    if (shed !== null && this.overlay.value === "none") return { overlay: "watershed", influence: shed };
    // Without a target there is nothing to differ from.
    if (this.task.differs) {
      const off = this.task.difference.value;
      return { overlay: off === null ? "none" : "difference", influence: off };
    }
    return { overlay: this.overlay.value, influence: this.#influence.value };
  }
}

function hasPaint(doc: Doc | null): boolean {
  for (const stroke of doc?.strokes.values() ?? []) if (stroke.paint !== null) return true;
  return false;
}
