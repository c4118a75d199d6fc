/** Where the terrain is seen and touched: tiles, camera, input, renderer and the loop that draws frames. */

import { computed, effect, type ReadonlySignal, signal } from "@preact/signals-core";
import { Camera } from "../../core/camera/camera.ts";
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
import { strokeInfluence } from "../../doc/influence.ts";
import { spanOf } from "../../doc/layers.ts";
import { type Meeting, meetings } from "../../doc/meetings.ts";
import type { MemberPresence } from "../../generated/contract.ts";
import { MAX_REFINED_TILES } from "../../generated/contract.ts";
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
import { Following } from "./eye/following.ts";
import { landOfTiles } from "./eye/land.ts";
import { PictureBox } from "./eye/picture-box.ts";
import { FrameLoop } from "./frame-loop.ts";
import { FreshTiles } from "./fresh-tiles.ts";
import { Graphics } from "./graphics.ts";
import { Instruments } from "./instruments/instruments.ts";
import { QuietStrokes } from "./quiet-strokes.ts";
import { takesKeys } from "./regions.ts";
import { cursorVisuals, hasPaint, strokeVisuals } from "./scene.ts";
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
  /** Where the picture lies in the window. */
  readonly box: PictureBox;
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

  constructor({ session, sizeM, levels, finest, viewport }: StageOptions) {
    this.session = session;
    this.sizeM = sizeM;
    this.levels = levels;
    this.finest = finest;
    this.#viewport = viewport;
    this.camera = new Camera(sizeM);
    this.camera.calm = this.#calm.matches;
    this.camera.landNow = () => landOfTiles(this.tiles);
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
    this.box = new PictureBox({
      viewport,
      camera: this.camera,
      isDrawn: () => this.loop.frames > 0,
      redraw: () => this.loop.invalidate(),
    });
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
      return riverLines(set, settings.wetness, sizeM);
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
    // Lines of paint lie on the ground and move with it. Others do not ask for the ground: it is not made for them.
    const painted = hasPaint(doc);
    if (painted) this.tiles.revision.value;
    const ground = painted ? this.shown.freeze() : this.shown.ground;
    return doc ? strokeVisuals(doc, marks, this.session.people.value, ground) : [];
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

  /** Follows a person's view until I move the camera myself; the same person again stops it. */
  follow(client: string | null): void {
    this.#follows.toggle(client);
  }

  /** New presences have come: the view goes along with the person that is followed. */
  followed(changed: readonly MemberPresence[]): void {
    this.#follows.moved(changed);
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
    this.#stops.push(takesKeys(this.#viewport), ...this.#follows.watch(this.#viewport));
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
        this.#arrival.follow(
          () => landOfTiles(this.tiles),
          isDrawing,
          (land) => this.camera.stand(land),
        );
      }),
    );
    this.#stops.push(this.box.watch());
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
