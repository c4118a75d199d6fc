/** The WebGPU renderer: one frame from a scene (DESIGN 9). */

import type { FrameStats, Scene, SceneRenderer, Vec3 } from "../core/types.ts";
import { finestLevel } from "../tiles/detail/detail.ts";
import { expectation } from "../tiles/detail/synthetic.ts";
import { LakeWatch } from "../tiles/lakes/lakewatch.ts";
import { type Cut, Selection } from "../tiles/patches/selection.ts";
import { Atlas, type Changes, MAX_SLOTS, type Resident, SOFTWARE_SLOTS } from "./atlas/atlas.ts";
import { Fit } from "./atlas/fit.ts";
import { LightQueue } from "./atlas/lightqueue.ts";
import { TakeLightPass } from "./atlas/takelight.ts";
import { SunPass } from "./atlas/tilecompute.ts";
import { TileFill } from "./atlas/tilefill.ts";
import type { Gpu } from "./device.ts";
import { FrameBindings, sunDirection } from "./frame.ts";
import { contourInterval } from "./looks.ts";
import { BackgroundPass } from "./passes/background.ts";
import { DropPass } from "./passes/drops.ts";
import { GhostPass } from "./passes/ghostplane.ts";
import { guardOf } from "./passes/guard.ts";
import { HiddenPatches } from "./passes/hidden.ts";
import { LabelPass } from "./passes/labels.ts";
import { INDEX_COUNT, PatchPasses } from "./passes/patches.ts";
import { Picture } from "./passes/picture.ts";
import type { PassContext } from "./passes/pipeline.ts";
import { PlacingPass } from "./passes/placing.ts";
import { RibbonPass } from "./passes/ribbons.ts";
import { SkyTables } from "./passes/sky.ts";
import { createStonesTexture } from "./passes/stones.ts";
import { type Quality, QualityControl } from "./quality.ts";
import { samePicture } from "./scenediff.ts";
import { SurfaceParts } from "./surface.ts";
import { createNoiseTexture } from "./synthesis/noise.ts";
import { Target } from "./target.ts";

/** Tiles whose light is marched in one frame: while the picture moves, and at rest. */
const LIGHT_TILES = { hardware: { moving: 128, rest: 256 }, software: { moving: 2, rest: 6 } } as const;
/** Tiles that may enter in one frame. */
const NEW_TILES = { hardware: 64, software: 16 } as const;
/** On a software adapter a picture at rest is drawn anew this often while tiles and light still come in, or less often: */
const REDRAW_MS = 900;
/** so many times as long as it took to draw. */
const REDRAW_FRAMES = 4;
/** A refined tile turns from its parent's surface to its own in this time. */
const ENTRANCE_MS = 350;
const FRAMES_IN_FLIGHT = { hardware: 2, software: 1 } as const;

interface Passes {
  readonly sky: SkyTables;
  readonly frame: FrameBindings;
  readonly target: Target;
  readonly fill: TileFill;
  readonly sun: SunPass;
  readonly taking: TakeLightPass;
  readonly background: BackgroundPass;
  readonly patches: PatchPasses;
  readonly ribbons: RibbonPass;
  readonly drops: DropPass;
  readonly ghost: GhostPass;
  readonly placing: PlacingPass;
  readonly labels: LabelPass;
  readonly hidden: HiddenPatches | null;
}

/** The tiles of one store on the device. */
interface World {
  readonly tiles: Scene["tiles"];
  readonly atlas: Atlas;
  readonly light: LightQueue;
  readonly selection: Selection;
  /** Tells whether the atlas has slots for the view: where it lacks them, the bound becomes coarser. */
  readonly fit: Fit;
  /** Tiles that the last cut rested on and lacked. */
  needed: number;
}

export class GpuRenderer implements SceneRenderer {
  readonly kind = "webgpu";
  readonly description: string;
  readonly software: boolean;
  readonly lost: Promise<string>;
  /** Ground finer than what is held is made where somebody looks. Measurements against a grid end with the grid. */
  endless = true;
  /** Draws what a frame has prepared; says whether hidden patches are looked for. */
  readonly picture: Picture;
  readonly #quality: QualityControl;
  #world: World | null = null;
  #last: Scene | null = null;
  #lastStamp = -1;
  #lastChannels = -1;
  /** Refined tiles fade in: not on the CPU, and not for people who asked for less motion. */
  #fades = false;
  #fadedAt = 0;
  /** Share of an entrance that passes with this frame. */
  #entrance = 1;
  #lastQuality: Quality | null = null;
  readonly #lakes = new LakeWatch();
  readonly #surface: SurfaceParts;
  /** Highest ground of the last cut, metres. */
  #high = 0;
  /** Held tiles were asked for that are not in the atlas yet. */
  #tilesDue = false;
  /** On a software adapter: all tiles and light of the picture at rest are there. */
  #ready = false;
  /** Batches of light marched, and those that the last picture shows. */
  #lightMarched = 0;
  #lightDrawn = 0;
  #drawnAt = Number.NEGATIVE_INFINITY;
  /** How long the device took for the last picture. */
  #frameMs = 0;
  #inFlight = 0;
  #destroyed = false;
  #stats: FrameStats = { patches: 0, triangles: 0, selectMs: 0, cpuMs: 0, uploads: 0, busy: false };

  readonly #canvas: HTMLCanvasElement;
  readonly #gpu: Gpu;
  readonly #passes: Passes;

  private constructor(canvas: HTMLCanvasElement, gpu: Gpu, passes: Passes, context: PassContext) {
    this.#canvas = canvas;
    this.#gpu = gpu;
    this.#passes = passes;
    this.description = gpu.description;
    this.software = gpu.software;
    this.#quality = new QualityControl(gpu.software);
    this.#surface = new SurfaceParts(context, passes.frame, gpu.software);
    this.picture = new Picture(passes, passes.hidden);
    this.lost = gpu.device.lost.then((info) => (this.#destroyed ? "closed" : info.message || info.reason));
  }

  static async create(canvas: HTMLCanvasElement, gpu: Gpu): Promise<GpuRenderer> {
    const { device, format } = gpu;
    const samples = gpu.software ? 1 : 4;
    const sky = await SkyTables.create(device);
    const frame = new FrameBindings(
      device,
      sky,
      createNoiseTexture(device),
      createStonesTexture(device, gpu.software),
      gpu.software,
      await guardOf(device, gpu.software),
    );
    const context: PassContext = {
      device,
      frameLayout: frame.layout,
      format,
      samples,
      detail: gpu.software ? "plain" : "rich",
    };
    const [target, fill, sun, taking, background, patches, ribbons, drops, ghost, placing, labels, hidden] =
      await Promise.all([
        Target.create(device, format, samples, gpu.core),
        TileFill.create(device),
        SunPass.create(device, gpu.software),
        TakeLightPass.create(device),
        BackgroundPass.create(context),
        PatchPasses.create(context),
        RibbonPass.create(context),
        DropPass.create(context),
        GhostPass.create(context),
        PlacingPass.create(context),
        LabelPass.create(context),
        // Devices of the compatibility mode cannot read depth in a shader.
        gpu.core ? HiddenPatches.create(device, frame.view, samples, INDEX_COUNT) : null,
      ]);
    const compute = { fill, sun, taking };
    const drawn = { background, patches, ribbons, drops, ghost, placing, labels, hidden };
    return new GpuRenderer(canvas, gpu, { sky, frame, target, ...compute, ...drawn }, context);
  }

  render(scene: Scene): FrameStats {
    if (this.#destroyed) return this.#stats;
    const { software } = this.#gpu;
    const limit = software ? FRAMES_IN_FLIGHT.software : FRAMES_IN_FLIGHT.hardware;
    // The device is behind: what would be drawn now is drawn when it has caught up.
    if (this.#inFlight >= limit) return this.#report({ busy: true, uploads: 0 });
    const began = performance.now();
    const world = this.#worldOf(scene);
    const told = this.#passes.fill.tell(world.selection.tree);
    const moved = this.#changed(scene);
    this.#quality.mode = scene.quality ?? "automatic";
    // Time stands at zero for people who asked for less motion; the CPU draws too few frames for any.
    const smooth = !this.#gpu.software && scene.time !== 0;
    const filled = this.#lakes.update(scene.tiles, scene.settings, began, smooth, scene.flood);
    if (moved || filled) this.#ready = false;
    const quality = this.#quality.next(began, moved || (software && !this.#ready));
    if (
      software &&
      !moved &&
      !this.#ready &&
      began - this.#drawnAt < Math.max(REDRAW_MS, REDRAW_FRAMES * this.#frameMs)
    ) {
      // On the CPU a picture costs more than the upload and light of many tiles: get them ready, then draw.
      this.#prepareOnly(scene, world);
      this.#ready = !this.#tilesDue && !world.light.pending && !this.#passes.fill.pending && !this.#lakes.busy;
      return this.#report({ busy: true });
    }
    const fading = this.#advanceFades(scene, world, began);
    const waves = (scene.settings.sea_level_m !== null || this.#lakes.lakes !== null) && smooth;
    const due =
      fading ||
      filled ||
      told ||
      this.#tilesDue ||
      this.#surface.due ||
      this.#lightDrawn !== this.#lightMarched ||
      !sameQuality(quality, this.#lastQuality);
    if (!moved && !waves && !due && !world.light.pending)
      return this.#report({ busy: this.#quality.pending || this.#passes.fill.pending || this.#lakes.busy, uploads: 0 });
    this.#remember(scene, quality);
    this.#draw(scene, world, quality, { began, moved });
    const coming = this.#tilesDue || this.#surface.due || world.light.pending || this.#passes.fill.pending;
    const busy = waves || fading || this.#quality.pending || coming || this.#lakes.busy;
    return this.#report({ busy });
  }

  destroy(): void {
    if (this.#destroyed) return;
    this.#destroyed = true;
    this.#world?.atlas.destroy();
    this.#surface.destroy();
    for (const part of Object.values(this.#passes)) if (part !== null && "destroy" in part) part.destroy();
    this.#gpu.device.destroy();
  }

  #report(change: Partial<FrameStats>): FrameStats {
    this.#stats = { ...this.#stats, ...change };
    return this.#stats;
  }

  #worldOf(scene: Scene): World {
    if (this.#world?.tiles === scene.tiles) return this.#world;
    this.#world?.atlas.destroy();
    const { levels, solved, sizeM } = scene.tiles;
    const selection = new Selection(this.endless ? Math.max(levels, finestLevel(sizeM)) : levels);
    const enter = (level: number, x: number, y: number, usable: boolean): void =>
      selection.tree.setUsable(level, x, y, usable, this.#fades && level > solved);
    const atlas = new Atlas(this.#gpu.device, enter, this.#gpu.software ? SOFTWARE_SLOTS : MAX_SLOTS);
    this.#passes.frame.attach(atlas);
    this.#passes.fill.attach(atlas);
    this.#passes.sun.attach(atlas);
    this.#passes.taking.attach(atlas);
    const light = new LightQueue(this.#passes.sun, atlas, this.#gpu.software ? this.#passes.taking : null);
    this.#world = { tiles: scene.tiles, atlas, selection, light, fit: new Fit(), needed: 0 };
    return this.#world;
  }

  /** Lets new refined tiles come in; true while any is on its way. */
  #advanceFades(scene: Scene, world: World, now: number): boolean {
    const passed = now - this.#fadedAt;
    this.#fadedAt = now;
    this.#fades = !this.#gpu.software && scene.time !== 0;
    this.#entrance = this.#fades ? Math.min(passed, 50) / ENTRANCE_MS : 1;
    return world.selection.tree.advance(this.#entrance) || world.atlas.blending;
  }

  #changed(scene: Scene): boolean {
    if (this.#last === null || scene.channels.stamp !== this.#lastChannels) return true;
    return !samePicture(this.#last, this.#lastStamp, scene, scene.tiles.stamp);
  }

  #remember(scene: Scene, quality: Quality): void {
    this.#last = scene;
    this.#lastStamp = scene.tiles.stamp;
    this.#lastChannels = scene.channels.stamp;
    this.#lastQuality = quality;
  }

  #draw(scene: Scene, world: World, quality: Quality, how: { began: number; moved: boolean }): void {
    const { camera } = scene;
    const { device, context } = this.#gpu;
    if (this.#canvas.width !== camera.width) this.#canvas.width = camera.width;
    if (this.#canvas.height !== camera.height) this.#canvas.height = camera.height;
    const width = Math.max(1, Math.round(camera.width * quality.scale));
    const height = Math.max(1, Math.round(camera.height * quality.scale));

    const encoder = device.createCommandEncoder({ label: "frame" });
    const { cut, uploads, selectMs } = this.#prepare(encoder, scene, world, quality, how.moved);
    const { lakes, heights } = this.#lakes;
    // Sky, haze and exposure change with the ground: they would show another place while its shader is made.
    const { look } = this.#surface.dress(scene, this.#passes.patches);
    this.#passes.frame.update(scene, { width, height, low: cut.minHeight, high: cut.maxHeight, lakes, look });
    this.#passes.patches.update(cut, { sizeM: scene.tiles.sizeM, seaM: scene.settings.sea_level_m, lakes, heights });
    const unit = quality.scale * pixelRatio();
    const wide = unit * (scene.lineScale ?? 1);
    this.#passes.ribbons.update(scene.showStrokes ? scene.strokes : [], scene.ghost, wide, scene.footprints);
    this.#passes.drops.update(scene.drops ?? null);
    this.#passes.placing.update(scene.placing ?? null);
    this.#passes.ghost.update(scene.ghost);
    this.#passes.labels.update(scene, cut.maxHeight - cut.minHeight, unit, quality.scale);
    this.picture.instances = this.#surface.plant(encoder, scene, world.atlas, this.#passes.patches);
    const nodes = world.selection.tree.capacity * 16;
    this.picture.encode(encoder, scene, cut, nodes, { canvas: context.getCurrentTexture(), width, height });
    device.queue.submit([encoder.finish()]);
    this.#passes.fill.submitted();
    this.picture.submitted();
    this.#measure(true);
    this.#lightDrawn = this.#lightMarched;
    this.#drawnAt = Number.POSITIVE_INFINITY;
    this.#report({
      patches: cut.count,
      triangles: this.#passes.patches.triangles,
      selectMs,
      contourM: scene.contourM || contourInterval(cut.maxHeight - cut.minHeight),
      coarsenedPx: world.fit.factor > 1 ? scene.tauPx * world.fit.factor : null,
      cpuMs: performance.now() - how.began,
      uploads,
    });
  }

  /** Selects, lets requested tiles in and selects again, so that coarse levels arrive together in the first frame. */
  #choose(scene: Scene, world: World, quality: Quality, moved: boolean): { cut: Cut; entered: Resident[] } {
    const entered: Resident[] = [];
    const limit = NEW_TILES[this.#gpu.software ? "software" : "hardware"];
    const { atlas, fit } = world;
    fit.begin(moved, world.needed, atlas.capacity);
    for (;;) {
      const tau = scene.tauPx * quality.tauFactor * fit.factor;
      const cut = world.selection.select(scene.tiles, scene.camera, tau, atlas, quality.scale, this.#lakes.surfaces);
      world.needed = cut.tiles;
      if (fit.exceeded(cut.tiles, atlas.capacity)) continue;
      const more = atlas.admit(cut.requests, limit - entered.length);
      entered.push(...more);
      if (more.length > 0) continue;
      // Tiles that are only needed soon wait for a frame with room to spare; a renderer on the CPU never has any.
      const room = Math.min(limit - entered.length, atlas.capacity - cut.tiles);
      if (!this.#gpu.software && room > 0) entered.push(...atlas.admit(cut.early, room));
      return { cut, entered };
    }
  }

  /** Gradients at once; light within the budget. */
  #compute(
    encoder: GPUCommandEncoder,
    scene: Scene,
    world: World,
    what: { changes: Changes; entered: readonly Resident[]; moved: boolean },
  ): void {
    const sun = sunOf(scene);
    this.#passes.sky.bake(this.#gpu.device, encoder, sun);
    world.atlas.flushPages();
    this.#passes.fill.run(encoder, scene.tiles.sizeM, what.changes, what.entered);
    world.light.mark([...what.changes.remade, ...what.changes.moved], what.entered, sun);
    const budget = LIGHT_TILES[this.#gpu.software ? "software" : "hardware"];
    // While tiles still come in, on the CPU only their own light: their neighbours are due when all are there.
    const rest = this.#gpu.software && this.#tilesDue ? 0 : budget.rest;
    this.#march(encoder, scene, world, what.moved ? budget.moving : rest);
  }

  #march(encoder: GPUCommandEncoder, scene: Scene, world: World, budget: number): void {
    world.light.run(encoder, { sizeM: scene.tiles.sizeM, high: this.#high, sun: sunOf(scene) }, budget);
    this.#lightMarched += 1;
  }

  /** Takes over what all detail depends on. */
  #configure(scene: Scene, world: World): void {
    const { settings, channels, tiles } = scene;
    const { synthesis } = this.#passes.fill;
    const changed = synthesis.configure({
      sizeM: tiles.sizeM,
      seed: settings.seed,
      detail: settings.detail,
      erosion: settings,
      rule: settings.rule,
      look: settings.look,
      seaLevelM: settings.sea_level_m,
      place: settings.place,
      ground: scene.ground ?? null,
      solved: tiles.solved,
    });
    if (synthesis.setChannels(channels) || changed) {
      world.atlas.remakeAll();
      world.selection.tree.expect(expectation(tiles.sizeM, settings, channels));
    }
  }

  /** Brings atlas, cut and light up to date for a frame. */
  #prepare(
    encoder: GPUCommandEncoder,
    scene: Scene,
    world: World,
    quality: Quality,
    moved: boolean,
  ): { cut: Cut; uploads: number; selectMs: number } {
    this.#configure(scene, world);
    const changes = world.atlas.refresh(scene.tiles, this.#gpu.software, this.#entrance);
    for (const { level, x, y } of changes.remade) world.selection.tree.remade(level, x, y);
    for (const { level, x, y } of changes.moved) world.selection.tree.remade(level, x, y);
    const selecting = performance.now();
    const { cut, entered } = this.#choose(scene, world, quality, moved);
    const selectMs = performance.now() - selecting;
    this.#high = cut.top;
    // Slots that a finer cut of this frame held are free in the next.
    const lacking = cut.requests.length > 0 && (!world.atlas.full || cut.tiles <= world.atlas.capacity);
    this.#tilesDue = lacking || world.fit.eased;
    this.#compute(encoder, scene, world, { changes, entered, moved });
    return { cut, uploads: changes.remade.length + changes.moved.length + entered.length, selectMs };
  }

  /** All of a frame but the picture, for the picture at rest. */
  #prepareOnly(scene: Scene, world: World): void {
    const encoder = this.#gpu.device.createCommandEncoder({ label: "prepare" });
    const { uploads } = this.#prepare(encoder, scene, world, this.#quality.rest, false);
    this.#report({ uploads });
    this.#gpu.device.queue.submit([encoder.finish()]);
    this.#passes.fill.submitted();
    this.#measure(false);
  }

  /** Follows a submission to its end; `frame`: its time says how fast frames are. */
  #measure(frame: boolean): void {
    const submitted = performance.now();
    this.#inFlight += 1;
    this.#gpu.device.queue.onSubmittedWorkDone().then(
      () => {
        this.#inFlight -= 1;
        if (!frame) return;
        this.#drawnAt = performance.now();
        this.#frameMs = this.#drawnAt - submitted;
        this.#quality.measured(this.#frameMs);
      },
      () => {
        this.#inFlight -= 1;
      },
    );
  }
}

function sunOf(scene: Scene): Vec3 {
  return sunDirection(scene.settings.sun_azimuth_deg, scene.settings.sun_elevation_deg);
}

function sameQuality(a: Quality, b: Quality | null): boolean {
  return b !== null && a.scale === b.scale && a.tauFactor === b.tauFactor;
}

function pixelRatio(): number {
  return globalThis.devicePixelRatio || 1;
}
