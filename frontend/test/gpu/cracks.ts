/**
 * The crack test: ground alone on a magenta clear, random trees and cameras. No magenta may show where ground must be.
 * The real selection, atlas and shaders draw; only the target is the test's own.
 */

import type { CameraState, FrameStats, Scene, TileView, Vec3 } from "../../src/core/types.ts";
import { Atlas } from "../../src/gpu/atlas.ts";
import { FrameBindings, sunDirection } from "../../src/gpu/frame.ts";
import { LightQueue } from "../../src/gpu/lightqueue.ts";
import { createNoiseTexture } from "../../src/gpu/noise.ts";
import { PatchPasses } from "../../src/gpu/patches.ts";
import type { PassContext } from "../../src/gpu/pipeline.ts";
import { SkyTables } from "../../src/gpu/sky.ts";
import { createStonesTexture } from "../../src/gpu/stones.ts";
import { TakeLightPass } from "../../src/gpu/takelight.ts";
import { DEPTH_FORMAT } from "../../src/gpu/target.ts";
import { SunPass } from "../../src/gpu/tilecompute.ts";
import { TileFill } from "../../src/gpu/tilefill.ts";
import { finestLevel } from "../../src/tiles/detail.ts";
import type { PatchTree } from "../../src/tiles/patchtree.ts";
import { RECORD_WORDS, recordLevel } from "../../src/tiles/records.ts";
import { type Cut, Selection } from "../../src/tiles/selection.ts";
import { expectation } from "../../src/tiles/synthetic.ts";
import {
  craggyField,
  FieldView,
  filteredField,
  lookAt,
  mapCamera,
  PLAIN_CHANNELS,
  random,
  SparseView,
} from "./world.ts";

const WIDTH = 256;
const HEIGHT = 192;
const FORMAT = "rgba16float" as const;
const SIZE = 4096;

export interface CrackReport {
  readonly views: number;
  readonly cracks: number;
  readonly nans: number;
  /** Ground pixels in all pictures: that there was something to crack. */
  readonly covered: number;
  readonly patches: number;
  readonly mixed: number;
  /** Finest level of any patch drawn. */
  readonly deepest: number;
  /** Views with a crack, for reproduction. */
  readonly failures: readonly string[];
}

interface Rig {
  readonly device: GPUDevice;
  readonly frame: FrameBindings;
  readonly patches: PatchPasses;
  readonly fill: TileFill;
  readonly sun: SunPass;
  readonly taking: TakeLightPass;
  readonly sky: SkyTables;
  readonly colour: GPUTexture;
  readonly depth: GPUTexture;
  readonly readback: GPUBuffer;
}

export async function makeRig(): Promise<Rig> {
  const adapter = await navigator.gpu.requestAdapter();
  if (adapter === null) throw new Error("no adapter");
  const device = await adapter.requestDevice();
  device.addEventListener("uncapturederror", (event) => {
    throw new Error(event.error.message);
  });
  const sky = await SkyTables.create(device);
  const frame = new FrameBindings(device, sky, createNoiseTexture(device), createStonesTexture(device, true), true);
  const context: PassContext = { device, frameLayout: frame.layout, format: FORMAT, samples: 1, detail: "plain" };
  const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC;
  return {
    device,
    frame,
    sky,
    patches: await PatchPasses.create(context),
    fill: await TileFill.create(device),
    taking: await TakeLightPass.create(device),
    sun: await SunPass.create(device, true),
    colour: device.createTexture({ size: [WIDTH, HEIGHT], format: FORMAT, usage }),
    depth: device.createTexture({
      size: [WIDTH, HEIGHT],
      format: DEPTH_FORMAT,
      usage: GPUTextureUsage.RENDER_ATTACHMENT,
    }),
    readback: device.createBuffer({
      size: WIDTH * HEIGHT * 8,
      usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ,
    }),
  };
}

export type Kind = "above" | "below" | "map" | "grazing";

function camera(kind: Kind, next: () => number, view: FieldView): CameraState {
  const x = 1000 + next() * 2096;
  const y = 1000 + next() * 2096;
  const ground = heightOf(view, x, y);
  const angle = next() * 2 * Math.PI;
  const along: Vec3 = [Math.cos(angle), Math.sin(angle), 0];
  if (kind === "map") return mapCamera([x, y, 0], 300 + next() * 1100, WIDTH, HEIGHT);
  if (kind === "above") {
    const up = 150 + next() * 500;
    return lookAt([x, y, ground + up], [x + along[0] * up * 0.4, y + along[1] * up * 0.4, ground], WIDTH, HEIGHT, 40);
  }
  if (kind === "below") {
    const down = 500 + next() * 500;
    return lookAt([x, y, ground - down], [x + along[0] * 90, y + along[1] * 90, ground], WIDTH, HEIGHT, 35);
  }
  return lookAt(
    [x, y, ground + 30 + next() * 120],
    [x + along[0] * 500, y + along[1] * 500, ground + 10 - next() * 120],
    WIDTH,
    HEIGHT,
    45,
    1,
  );
}

function heightOf(view: FieldView, x: number, y: number): number {
  const root = view.tile(0, 0, 0)!;
  return root.heights[Math.round((y / SIZE) * 64) * 65 + Math.round((x / SIZE) * 64)]!;
}

export function sceneOf(view: TileView, state: CameraState, look: Scene["settings"]["look"]): Scene {
  return {
    camera: state,
    tiles: view,
    channels: PLAIN_CHANNELS,
    settings: {
      size_m: view.sizeM,
      title: "",
      reach_m: null,
      border: "free",
      sea_level_m: null,
      lakes_m: null,
      seed: 1,
      look,
      detail: 1,
      rule: "landscape",
      sun_azimuth_deg: 115,
      sun_elevation_deg: 24,
      place: null,
    },
    strokes: [],
    ghost: null,
    cursors: [],
    tauPx: 1,
    time: 0,
    overlay: "none",
    showStrokes: false,
  };
}

interface World {
  readonly atlas: Atlas;
  readonly selection: Selection;
  readonly light: LightQueue;
}

/** An empty atlas and selection for a store; `fades`: refined tiles enter by and by. */
export function makeWorld(rig: Rig, view: TileView, fades = false): World {
  const selection = new Selection(finestLevel(view.sizeM));
  const atlas = new Atlas(rig.device, (l, x, y, usable) =>
    selection.tree.setUsable(l, x, y, usable, fades && l > view.solved),
  );
  for (const pass of [rig.frame, rig.fill, rig.sun, rig.taking]) pass.attach(atlas);
  return { atlas, selection, light: new LightQueue(rig.sun, atlas, rig.taking) };
}

interface Pace {
  /** Share of their time by which tiles go on that fade in; all of it. */
  readonly entrance?: () => number;
  /** Share by which ground goes on that blends over; all of it. */
  readonly share?: number;
  /** How often figures may come; once: not at all. */
  readonly rounds?: number;
}

/** Brings the atlas up to date for a view, as a frame does. Returns the cut and how many tiles were made. */
function prepare(rig: Rig, world: World, scene: Scene, tau: number, how: Pace): { cut: Cut; made: number } {
  const { tiles, settings, channels } = scene;
  const detail = { sizeM: tiles.sizeM, seed: settings.seed, detail: settings.detail, rule: settings.rule };
  const { synthesis } = rig.fill;
  const anew = synthesis.configure({ ...detail, look: settings.look, seaLevelM: null, solved: tiles.solved });
  if (synthesis.setChannels(channels) || anew) world.atlas.remakeAll();
  world.selection.tree.expect(expectation(tiles.sizeM, settings, channels));
  rig.fill.tell(world.selection.tree);
  const changes = world.atlas.refresh(tiles, false, how.share ?? 1);
  for (const { level, x, y } of [...changes.remade, ...changes.moved]) world.selection.tree.remade(level, x, y);
  const entered = [];
  let cut = world.selection.select(tiles, scene.camera, tau, world.atlas);
  for (let round = 0; ; round += 1) {
    const more = world.atlas.admit(cut.requests, 4096);
    // Refined tiles are let in one level after the other, each when its parent has entered.
    const entering = world.selection.tree.advance((how.entrance ?? (() => 1))());
    if (more.length === 0 && (!entering || round > 20)) break;
    entered.push(...more);
    cut = world.selection.select(tiles, scene.camera, tau, world.atlas);
  }
  const sun = sunDirection(115, 24);
  const encoder = rig.device.createCommandEncoder();
  rig.sky.bake(rig.device, encoder, sun);
  world.atlas.flushPages();
  rig.fill.run(encoder, tiles.sizeM, changes, entered);
  world.light.mark([...changes.remade, ...changes.moved], entered, sun);
  world.light.run(encoder, { sizeM: tiles.sizeM, high: cut.top, sun }, 4);
  rig.device.queue.submit([encoder.finish()]);
  rig.fill.submitted();
  return { cut, made: changes.remade.length + changes.moved.length + entered.length };
}

/** The same until the view asks for no more, `rounds` times at most: figures of what was made come in between. */
async function settle(rig: Rig, world: World, scene: Scene, tau: number, how: Pace = {}): Promise<Cut> {
  for (let round = 1; ; round += 1) {
    const { cut, made } = prepare(rig, world, scene, tau, how);
    if (made === 0 || round === (how.rounds ?? 1)) return cut;
    while (!rig.fill.tell(world.selection.tree)) await new Promise((done) => setTimeout(done, 2));
  }
}

/** One picture as half-float words, and what was drawn. */
interface Drawn {
  readonly words: Uint16Array;
  readonly stats: Pick<FrameStats, "patches">;
  readonly mixed: boolean;
  readonly deepest: number;
}

export async function picture(rig: Rig, world: World, scene: Scene, tau: number, how: Pace = {}): Promise<Drawn> {
  const cut = await settle(rig, world, scene, tau, how);
  const encoder = rig.device.createCommandEncoder();
  rig.frame.update(scene, { width: WIDTH, height: HEIGHT, low: cut.minHeight, high: cut.maxHeight });
  rig.patches.update(cut);
  while (!rig.patches.useLook(scene.settings.look)) await new Promise((done) => setTimeout(done, 10));
  const pass = encoder.beginRenderPass({
    colorAttachments: [{ view: rig.colour.createView(), clearValue: [1, 0, 1, 0], loadOp: "clear", storeOp: "store" }],
    depthStencilAttachment: {
      view: rig.depth.createView(),
      depthClearValue: 0,
      depthLoadOp: "clear",
      depthStoreOp: "discard",
    },
  });
  pass.setBindGroup(0, rig.frame.bindGroup);
  rig.patches.drawGround(pass);
  pass.end();
  encoder.copyTextureToBuffer({ texture: rig.colour }, { buffer: rig.readback, bytesPerRow: WIDTH * 8 }, [
    WIDTH,
    HEIGHT,
  ]);
  rig.device.queue.submit([encoder.finish()]);
  await rig.readback.mapAsync(GPUMapMode.READ);
  const words = new Uint16Array(rig.readback.getMappedRange().slice(0));
  rig.readback.unmap();
  const levels = new Set<number>();
  for (let i = 0; i < cut.count; i += 1) levels.add(recordLevel(cut.records, i));
  return { words, stats: { patches: cut.count }, mixed: levels.size > 1, deepest: Math.max(...levels) };
}

/** Pixels of the clear colour where ground must be, ground pixels, and NaNs. Alpha is 0 only where nothing was drawn. */
function count(words: Uint16Array, kind: Kind): { cracks: number; covered: number; nans: number } {
  let cracks = 0;
  let covered = 0;
  let nans = 0;
  for (let x = 0; x < WIDTH; x += 1) {
    let seen = kind !== "grazing";
    for (let y = 0; y < HEIGHT; y += 1) {
      const at = 4 * (y * WIDTH + x);
      if (words[at + 3] !== 0) {
        seen = true;
        covered += 1;
      } else if (seen) cracks += 1;
      for (let k = 0; k < 4; k += 1) if ((words[at + k]! & 0x7c00) === 0x7c00) nans += 1;
    }
  }
  return { cracks, covered, nans };
}

/** What all pictures of a test show together. */
export class Tally {
  private total = { cracks: 0, nans: 0, covered: 0, patches: 0, mixed: 0, deepest: 0 };
  private readonly failures: string[] = [];

  /** `blind`: the ground may have risen over the eye; then nothing is in sight, and nothing can crack. */
  add({ words, stats, mixed, deepest }: Drawn, kind: Kind, view: string, blind = false): void {
    const { total } = this;
    const found = count(words, kind);
    if (blind && found.covered === 0) return;
    total.cracks += found.cracks;
    total.covered += found.covered;
    total.nans += found.nans;
    total.patches += stats.patches;
    total.mixed += mixed ? 1 : 0;
    total.deepest = Math.max(total.deepest, deepest);
    if (found.cracks > 0) this.failures.push(`${view}: ${found.cracks}`);
  }

  report(views: number): CrackReport {
    return { views, ...this.total, failures: this.failures };
  }
}

/** Draws `views` random views of random trees, three to a terrain. `spoil` clears the edge bits, to see the test fail. */
export async function crackTest(seed: number, views: number, spoil = false): Promise<CrackReport> {
  const rig = await makeRig();
  const next = random(seed);
  const kinds: Kind[] = ["above", "grazing", "below", "map"];
  const looks = ["natural", "alpine", "desert", "paper"] as const;
  const tally = new Tally();
  for (let done = 0; done < views; ) {
    const holes = random(Math.floor(next() * 1e9));
    const gaps = new Set<string>();
    const view = new FieldView(SIZE, 4, filteredField(Math.floor(next() * 1e6), 60 + next() * 160), (level, x, y) => {
      // A tile without its parent is never held; some branches end early.
      const lost = level > 0 && (gaps.has(`${level - 1}/${x >> 1}/${y >> 1}`) || holes() < 0.06);
      if (lost) gaps.add(`${level}/${x}/${y}`);
      return !lost;
    });
    const world = makeWorld(rig, view);
    if (spoil) spoilRecords(world.selection);
    for (let k = 0; k < 4 && done < views; k += 1, done += 1) {
      const kind = kinds[k]!;
      const tau = 0.6 + 5 * next() ** 2;
      const scene = sceneOf(view, camera(kind, next, view), looks[done % 4]!);
      const drawn = await picture(rig, world, scene, tau);
      tally.add(drawn, kind, `view ${done} ${kind} tau ${tau.toFixed(2)}`);
    }
    world.atlas.destroy();
  }
  rig.device.destroy();
  return tally.report(views);
}

const LARGE = 65536;

/** A camera a few metres from the ground, with the near and far planes that the page has there. */
function closeCamera(kind: Kind, next: () => number, at: Vec3): CameraState {
  const angle = next() * 2 * Math.PI;
  const along: Vec3 = [Math.cos(angle), Math.sin(angle), 0];
  const [x, y, z] = at;
  const look = (eye: Vec3, target: Vec3, fov: number): CameraState =>
    lookAt(eye, target, WIDTH, HEIGHT, fov, 0.1, 400_000);
  if (kind === "map") return mapCamera([x, y, 0], 40 + next() * 300, WIDTH, HEIGHT);
  if (kind === "below") {
    const down = 150 + next() * 300;
    return look([x, y, z - down], [x + along[0] * 20, y + along[1] * 20, z], 35);
  }
  const up = 6 + next() * 30;
  if (kind === "above") return look([x, y, z + up], [x + along[0] * up * 0.4, y + along[1] * up * 0.4, z], 40);
  return look([x, y, z + up], [x + along[0] * 60, y + along[1] * 60, z + up - 5 - 20 * next()], 45);
}

/**
 * The crack test near the ground of the largest terrain: levels 4 to 10 held around a place only, with holes, some tiles
 * still on their way in.
 */
export async function deepCrackTest(seed: number, views: number): Promise<CrackReport> {
  const rig = await makeRig();
  const next = random(seed);
  const kinds: Kind[] = ["above", "grazing", "below", "map"];
  const tally = new Tally();
  for (let done = 0; done < views; ) {
    const view = new SparseView(LARGE, 10, 3, craggyField(Math.floor(next() * 1e6), LARGE));
    const x = LARGE * (0.2 + 0.6 * next());
    const y = LARGE * (0.2 + 0.6 * next());
    view.refineAround(x, y, () => 1 + Math.round(next()));
    view.lose(() => next() < 0.08);
    const world = makeWorld(rig, view, true);
    for (let k = 0; k < 4 && done < views; k += 1, done += 1) {
      const kind = kinds[k]!;
      const tau = 0.6 + 6 * next() ** 2;
      const scene = sceneOf(view, closeCamera(kind, next, [x, y, view.shownHeightAt(x, y)]), "natural");
      const drawn = await picture(rig, world, scene, tau, {
        entrance: () => 0.15 + 0.7 * next(),
      });
      tally.add(drawn, kind, `view ${done} ${kind} tau ${tau.toFixed(2)}`);
    }
    world.atlas.destroy();
  }
  rig.device.destroy();
  return tally.report(views);
}

/** Height of the drawn ground at a place, as the finest tile that is there tells it. */
function drawnHeight(tree: PatchTree, sizeM: number, x: number, y: number): number {
  let found = 0;
  for (let level = 0; level <= tree.levels; level += 1) {
    const w = sizeM / 2 ** level;
    const page = tree.find(level, Math.floor(x / w), Math.floor(y / w));
    if (page < 0 || tree.usable[page] === 0) break;
    const node = page * 16 + Math.floor((4 * (y % w)) / w) * 4 + Math.floor((4 * (x % w)) / w);
    found = 0.5 * (tree.min[node]! + tree.max[node]!);
  }
  return found;
}

/**
 * The crack test a metre from the ground, after an approach from above as people come: synthetic levels to the finest, beside
 * refined ones and places where those have just come or gone, the ground half way from the one to the other.
 */
export async function walkCrackTest(seed: number, views: number): Promise<CrackReport> {
  const rig = await makeRig();
  const next = random(seed);
  const tally = new Tally();
  for (let done = 0; done < views; ) {
    const view = new SparseView(LARGE, 10, 2, craggyField(Math.floor(next() * 1e6), LARGE));
    const [x, y] = [LARGE * (0.2 + 0.6 * next()), LARGE * (0.2 + 0.6 * next())];
    const world = makeWorld(rig, view);
    for (const up of [20_000, 1500, 120, 10]) {
      const z = drawnHeight(world.selection.tree, LARGE, x, y);
      const eye: Vec3 = [x, y - 0.2 * up, z + up];
      await settle(rig, world, sceneOf(view, lookAt(eye, [x, y, z], WIDTH, HEIGHT, 40, 0.1, 4e5), "natural"), 2, {
        rounds: 9,
      });
    }
    for (let k = 0; k < 4 && done < views; k += 1, done += 1) {
      const kind = k % 2 === 0 ? "above" : "map";
      const z = drawnHeight(world.selection.tree, LARGE, x, y);
      // Ground that is on its way must not reach the eye.
      const up = (k === 0 ? 1 : 9) + 2 * next();
      const state =
        kind === "map"
          ? mapCamera([x, y, 0], 0.4 + 3 * next(), WIDTH, HEIGHT)
          : lookAt([x, y - 0.3 * up, z + up], [x, y, z], WIDTH, HEIGHT, 40, 0.05, 4e5);
      // Refined tiles come, and later some go.
      if (k === 1) view.refineAround(x, y, () => Math.round(next()));
      if (k === 3) view.lose(() => next() < 0.3);
      const tau = 0.6 + 2 * next();
      const drawn = await picture(rig, world, sceneOf(view, state, "alpine"), tau, {
        rounds: k === 0 ? 5 : 2,
        share: k === 0 ? 1 : 0.3,
      });
      tally.add(drawn, kind, `view ${done} ${kind} tau ${tau.toFixed(2)}`, true);
    }
    world.atlas.destroy();
  }
  rig.device.destroy();
  return tally.report(views);
}

/** Takes the edge bits and corner weights away from every cut. */
export function spoilRecords(selection: Selection): void {
  const select = selection.select.bind(selection);
  selection.select = (...args) => {
    const cut = select(...args);
    for (let i = 0; i < cut.count; i += 1) {
      cut.records[RECORD_WORDS * i]! &= ~(15 << 24);
      cut.records[RECORD_WORDS * i + 3] = 0;
    }
    return cut;
  };
}
