/** The WebGPU renderer: one frame from a scene (DESIGN 9). */

import type { FrameStats, Scene, SceneRenderer } from "../core/types.ts";
import { Selection } from "../tiles/selection.ts";
import { Atlas, NEW_TILES_PER_FRAME, type Resident } from "./atlas.ts";
import { BackgroundPass } from "./background.ts";
import type { Gpu } from "./device.ts";
import { FrameBindings, sunDirection } from "./frame.ts";
import { GhostPass } from "./ghostplane.ts";
import { createNoiseTexture } from "./noise.ts";
import { PatchPasses } from "./patches.ts";
import type { PassContext } from "./pipeline.ts";
import { type Quality, QualityControl } from "./quality.ts";
import { RibbonPass } from "./ribbons.ts";
import { SkyTables } from "./sky.ts";
import { Target } from "./target.ts";
import { NormalsPass, SunPass } from "./tilecompute.ts";

/** Tiles whose light is marched in one frame. */
const SUN_TILES = { hardware: 256, software: 8 } as const;
const FRAMES_IN_FLIGHT = { hardware: 2, software: 1 } as const;

interface Passes {
  readonly sky: SkyTables;
  readonly frame: FrameBindings;
  readonly target: Target;
  readonly normals: NormalsPass;
  readonly sun: SunPass;
  readonly background: BackgroundPass;
  readonly patches: PatchPasses;
  readonly ribbons: RibbonPass;
  readonly ghost: GhostPass;
}

/** The tiles of one store on the device. */
interface World {
  readonly tiles: Scene["tiles"];
  readonly atlas: Atlas;
  readonly selection: Selection;
}

export class GpuRenderer implements SceneRenderer {
  readonly kind = "webgpu";
  readonly description: string;
  readonly lost: Promise<string>;
  private readonly quality: QualityControl;
  private world: World | null = null;
  private last: Scene | null = null;
  private lastStamp = -1;
  private lastQuality: Quality | null = null;
  private sunKey = "";
  private inFlight = 0;
  private destroyed = false;
  private stats: FrameStats = { patches: 0, triangles: 0, selectMs: 0, cpuMs: 0, uploads: 0, busy: false };

  private constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly gpu: Gpu,
    private readonly passes: Passes,
  ) {
    this.description = gpu.description;
    this.quality = new QualityControl(gpu.software);
    this.lost = gpu.device.lost.then((info) => (this.destroyed ? "closed" : info.message || info.reason));
  }

  static async create(canvas: HTMLCanvasElement, gpu: Gpu): Promise<GpuRenderer> {
    const { device, format } = gpu;
    const samples = gpu.software ? 1 : 4;
    const sky = await SkyTables.create(device);
    const frame = new FrameBindings(device, sky, createNoiseTexture(device), gpu.software ? 1 : 8);
    const context: PassContext = { device, frameLayout: frame.layout, format, samples, detail: gpu.software ? 1 : 2 };
    const [target, normals, sun, background, patches, ribbons, ghost] = await Promise.all([
      Target.create(device, format, samples),
      NormalsPass.create(device),
      SunPass.create(device),
      BackgroundPass.create(context),
      PatchPasses.create(context),
      RibbonPass.create(context),
      GhostPass.create(context),
    ]);
    return new GpuRenderer(canvas, gpu, { sky, frame, target, normals, sun, background, patches, ribbons, ghost });
  }

  render(scene: Scene): FrameStats {
    if (this.destroyed) return this.stats;
    const limit = this.gpu.software ? FRAMES_IN_FLIGHT.software : FRAMES_IN_FLIGHT.hardware;
    // The device is behind: what would be drawn now is drawn when it has caught up.
    if (this.inFlight >= limit) return this.report({ busy: true, uploads: 0 });
    const began = performance.now();
    const world = this.worldOf(scene);
    const moved = this.changed(scene);
    const quality = this.quality.next(began, moved);
    const waves = scene.settings.sea_level_m !== null && !this.gpu.software;
    if (!moved && !this.stats.busy && !waves && sameQuality(quality, this.lastQuality)) {
      return this.report({ busy: this.quality.pending, uploads: 0 });
    }
    this.remember(scene, quality);
    this.draw(scene, world, quality, began);
    if (waves || this.quality.pending) this.report({ busy: true });
    return this.stats;
  }

  destroy(): void {
    if (this.destroyed) return;
    this.destroyed = true;
    this.world?.atlas.destroy();
    for (const part of Object.values(this.passes)) if ("destroy" in part) part.destroy();
    this.gpu.device.destroy();
  }

  private report(change: Partial<FrameStats>): FrameStats {
    this.stats = { ...this.stats, ...change };
    return this.stats;
  }

  private worldOf(scene: Scene): World {
    if (this.world?.tiles === scene.tiles) return this.world;
    this.world?.atlas.destroy();
    const selection = new Selection(scene.tiles.levels);
    const atlas = new Atlas(this.gpu.device, scene.tiles.levels, (level, x, y, usable) =>
      selection.tree.setUsable(level, x, y, usable),
    );
    this.passes.frame.attach(atlas);
    this.passes.normals.attach(atlas);
    this.passes.sun.attach(atlas);
    this.sunKey = "";
    this.world = { tiles: scene.tiles, atlas, selection };
    return this.world;
  }

  private changed(scene: Scene): boolean {
    const before = this.last;
    if (before === null || scene.tiles.stamp !== this.lastStamp) return true;
    const fields = [
      "camera",
      "tiles",
      "settings",
      "strokes",
      "ghost",
      "cursors",
      "tauPx",
      "overlay",
      "showStrokes",
    ] as const;
    return fields.some((field) => {
      if (field === "cursors" && before.cursors.length === 0 && scene.cursors.length === 0) return false;
      return before[field] !== scene[field];
    });
  }

  private remember(scene: Scene, quality: Quality): void {
    this.last = scene;
    this.lastStamp = scene.tiles.stamp;
    this.lastQuality = quality;
  }

  private draw(scene: Scene, world: World, quality: Quality, began: number): void {
    const { camera } = scene;
    const { device, context } = this.gpu;
    if (this.canvas.width !== camera.width) this.canvas.width = camera.width;
    if (this.canvas.height !== camera.height) this.canvas.height = camera.height;
    const width = Math.max(1, Math.round(camera.width * quality.scale));
    const height = Math.max(1, Math.round(camera.height * quality.scale));

    const changed = world.atlas.refresh(scene.tiles);
    const selecting = performance.now();
    const { cut, entered } = this.choose(scene, world, quality);
    const selectMs = performance.now() - selecting;

    const encoder = device.createCommandEncoder({ label: "frame" });
    const pendingSun = this.compute(encoder, scene, world, changed, entered, cut.maxHeight);
    this.passes.frame.update(scene, { width, height, low: cut.minHeight, high: cut.maxHeight });
    this.passes.patches.update(cut);
    this.passes.ribbons.update(scene.showStrokes ? scene.strokes : [], scene.ghost, quality.scale * pixelRatio());
    this.passes.ghost.update(scene.ghost);
    this.encode(encoder, scene, context.getCurrentTexture(), width, height);
    device.queue.submit([encoder.finish()]);
    this.measure();
    this.stats = {
      patches: cut.count,
      triangles: this.passes.patches.triangles,
      selectMs,
      cpuMs: performance.now() - began,
      uploads: changed.length + entered.length,
      busy: pendingSun || cut.requests.length > 0,
    };
  }

  /** Selects, lets requested tiles in and selects again, so that coarse levels arrive together in the first frame. */
  private choose(
    scene: Scene,
    world: World,
    quality: Quality,
  ): { cut: ReturnType<Selection["select"]>; entered: Resident[] } {
    const entered: Resident[] = [];
    const tau = scene.tauPx * quality.tauFactor;
    for (;;) {
      const cut = world.selection.select(scene.tiles, scene.camera, tau, world.atlas, quality.scale);
      const more = world.atlas.admit(cut.requests, NEW_TILES_PER_FRAME - entered.length);
      if (more.length === 0) return { cut, entered };
      entered.push(...more);
    }
  }

  /** Gradients at once; light within the budget. Returns true when light is still due somewhere. */
  private compute(
    encoder: GPUCommandEncoder,
    scene: Scene,
    world: World,
    changed: readonly Resident[],
    entered: readonly Resident[],
    high: number,
  ): boolean {
    const { settings } = scene;
    const sun = sunDirection(settings.sun_azimuth_deg, settings.sun_elevation_deg);
    const sizeM = scene.tiles.sizeM;
    this.passes.sky.bake(this.gpu.device, encoder, sun);
    world.atlas.flushPages();
    this.passes.normals.run(encoder, sizeM, [...new Set([...changed, ...entered])]);
    const sunKey = sun.join();
    const all = changed.length > 0 || sunKey !== this.sunKey;
    this.sunKey = sunKey;
    if (all) for (const resident of world.atlas.residents()) resident.sunStale = true;
    else staleNeighbours(world.atlas, entered);
    const budget = this.gpu.software ? SUN_TILES.software : SUN_TILES.hardware;
    const due = [...world.atlas.residents()].filter(
      (r) => r.sunStale && (world.atlas.isCurrent(r) || entered.includes(r)),
    );
    // A tile that has just entered has no light at all yet: it never waits.
    const fresh = new Set(entered);
    const rank = (r: Resident): number => (fresh.has(r) ? -1 : r.level);
    due.sort((a, b) => rank(a) - rank(b));
    const jobs = due.slice(0, Math.max(budget, entered.length));
    for (const job of jobs) job.sunStale = false;
    this.passes.sun.run(encoder, sizeM, world.atlas.levels, high, sun, jobs);
    return due.length > jobs.length;
  }

  private encode(encoder: GPUCommandEncoder, scene: Scene, canvas: GPUTexture, width: number, height: number): void {
    const { target, frame, background, patches, ribbons, ghost } = this.passes;
    const pass = encoder.beginRenderPass(target.begin(canvas, width, height));
    pass.setBindGroup(0, frame.bindGroup);
    patches.drawGround(pass);
    patches.drawWalls(pass);
    background.draw(pass);
    if (scene.settings.sea_level_m !== null) patches.drawSea(pass);
    ghost.draw(pass);
    ribbons.draw(pass);
    pass.end();
    target.finish(encoder, canvas);
  }

  private measure(): void {
    const submitted = performance.now();
    this.inFlight += 1;
    this.gpu.device.queue.onSubmittedWorkDone().then(
      () => {
        this.inFlight -= 1;
        this.quality.measured(performance.now() - submitted);
      },
      () => {
        this.inFlight -= 1;
      },
    );
  }
}

/** A new tile changes what the light of its neighbours of the same level was marched on. */
function staleNeighbours(atlas: Atlas, entered: readonly Resident[]): void {
  if (entered.length === 0) return;
  for (const resident of atlas.residents()) {
    resident.sunStale ||= entered.some(
      (e) => e.level === resident.level && Math.abs(e.x - resident.x) <= 1 && Math.abs(e.y - resident.y) <= 1,
    );
  }
}

function sameQuality(a: Quality, b: Quality | null): boolean {
  return b !== null && a.scale === b.scale && a.tauFactor === b.tauFactor;
}

function pixelRatio(): number {
  return globalThis.devicePixelRatio || 1;
}
