/**
 * What draws the pictures of the crack tests: the real selection, atlas, synthesis and patch shaders on one device; only the
 * targets are the tests' own. Most pictures show the ground in one colour, which takes a tenth of the time: no fragment is
 * ever discarded, so where ground is drawn is up to the vertices alone. The others have a look and its light.
 */

import type { CameraState, Scene, TileView } from "../../src/core/types.ts";
import { Atlas, type Changes, SOFTWARE_SLOTS } from "../../src/gpu/atlas/atlas.ts";
import { LightQueue } from "../../src/gpu/atlas/lightqueue.ts";
import { TakeLightPass } from "../../src/gpu/atlas/takelight.ts";
import { SunPass } from "../../src/gpu/atlas/tilecompute.ts";
import { TileFill } from "../../src/gpu/atlas/tilefill.ts";
import { FrameBindings, sunDirection } from "../../src/gpu/frame.ts";
import { guardOf } from "../../src/gpu/passes/guard.ts";
import { INDEX_COUNT, PatchPasses, PITCH, patchIndices } from "../../src/gpu/passes/patches.ts";
import { createPass, GrowingBuffer, type PassContext } from "../../src/gpu/passes/pipeline.ts";
import { SkyTables } from "../../src/gpu/passes/sky.ts";
import { createStonesTexture } from "../../src/gpu/passes/stones.ts";
import { terrainSource } from "../../src/gpu/shaders.ts";
import { createNoiseTexture } from "../../src/gpu/synthesis/noise.ts";
import { DEPTH_FORMAT } from "../../src/gpu/target.ts";
import { finestLevel } from "../../src/tiles/detail/detail.ts";
import { expectation } from "../../src/tiles/detail/synthetic.ts";
import { RECORD_WORDS, recordLevel } from "../../src/tiles/patches/records.ts";
import { type Cut, Selection } from "../../src/tiles/patches/selection.ts";
import { type Drawn, HEIGHT, WIDTH } from "./cracktally.ts";
import { PLAIN_CHANNELS } from "./world.ts";

const SUN = { azimuth: 115, elevation: 24 };

/** The ground in one colour, its vertices those of the page. */
const BARE = /* wgsl */ `
@fragment
fn bare_fragment() -> @location(0) vec4f { return vec4f(1.0); }
`;

class Target {
  private readonly colour: GPUTexture;
  private readonly readback: GPUBuffer;

  constructor(
    private readonly device: GPUDevice,
    format: GPUTextureFormat,
    private readonly pixelBytes: number,
  ) {
    const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC;
    this.colour = device.createTexture({ size: [WIDTH, HEIGHT], format, usage });
    this.readback = device.createBuffer({
      size: WIDTH * HEIGHT * pixelBytes,
      usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ,
    });
  }

  /** One pass on a clear target; its pixels. */
  async draw(encoder: GPUCommandEncoder, depth: GPUTexture, commands: (pass: GPURenderPassEncoder) => void) {
    const view = this.colour.createView();
    const pass = encoder.beginRenderPass({
      colorAttachments: [{ view, clearValue: [0, 0, 0, 0], loadOp: "clear", storeOp: "store" }],
      depthStencilAttachment: {
        view: depth.createView(),
        depthClearValue: 0,
        depthLoadOp: "clear",
        depthStoreOp: "discard",
      },
    });
    commands(pass);
    pass.end();
    const layout = { buffer: this.readback, bytesPerRow: WIDTH * this.pixelBytes };
    encoder.copyTextureToBuffer({ texture: this.colour }, layout, [WIDTH, HEIGHT]);
    this.device.queue.submit([encoder.finish()]);
    await this.readback.mapAsync(GPUMapMode.READ);
    const pixels = this.readback.getMappedRange().slice(0);
    this.readback.unmap();
    return pixels;
  }
}

/** The device and its passes: made once, for many worlds. */
export interface Rig {
  readonly device: GPUDevice;
  readonly frame: FrameBindings;
  readonly patches: PatchPasses;
  readonly bare: GPURenderPipeline;
  readonly records: GrowingBuffer;
  readonly indices: GPUBuffer;
  readonly fill: TileFill;
  readonly sun: SunPass;
  readonly taking: TakeLightPass;
  readonly sky: SkyTables;
  readonly one: Target;
  readonly full: Target;
  readonly depth: GPUTexture;
}

let shared: Promise<Rig> | null = null;

/** The page's rig. */
export function sharedRig(): Promise<Rig> {
  shared ??= makeRig();
  return shared;
}

async function makeRig(): Promise<Rig> {
  const adapter = await navigator.gpu.requestAdapter();
  if (adapter === null) throw new Error("no adapter");
  const device = await adapter.requestDevice();
  device.addEventListener("uncapturederror", (event) => {
    throw new Error(event.error.message);
  });
  const sky = await SkyTables.create(device);
  const guard = await guardOf(device, true);
  const frame = new FrameBindings(
    device,
    sky,
    createNoiseTexture(device),
    createStonesTexture(device, true),
    true,
    guard,
  );
  const context: PassContext = {
    device,
    frameLayout: frame.layout,
    format: "rgba16float",
    samples: 1,
    detail: "plain",
  };
  const attributes: GPUVertexAttribute[] = [{ shaderLocation: 0, offset: 0, format: "uint32x4" }];
  const bare = await createPass(
    { ...context, format: "r8unorm" },
    {
      label: "bare ground",
      code: terrainSource("paper", "plain") + BARE,
      vertex: "terrain_vertex",
      fragment: "bare_fragment",
      buffers: [{ arrayStride: RECORD_WORDS * 4, stepMode: "instance", attributes }],
      vertexConstants: { PITCH },
    },
  );
  const order = patchIndices();
  const usage = GPUBufferUsage.INDEX | GPUBufferUsage.COPY_DST;
  const indices = device.createBuffer({ size: order.byteLength, usage });
  device.queue.writeBuffer(indices, 0, order);
  return {
    device,
    frame,
    sky,
    bare,
    indices,
    records: new GrowingBuffer(device, "crack records"),
    patches: await PatchPasses.create(context),
    fill: await TileFill.create(device),
    taking: await TakeLightPass.create(device),
    sun: await SunPass.create(device, true),
    one: new Target(device, "r8unorm", 1),
    full: new Target(device, "rgba16float", 8),
    depth: device.createTexture({
      size: [WIDTH, HEIGHT],
      format: DEPTH_FORMAT,
      usage: GPUTextureUsage.RENDER_ATTACHMENT,
    }),
  };
}

export function sceneOf(view: TileView, state: CameraState, look: Scene["settings"]["look"]): Scene {
  return {
    camera: state,
    tiles: view,
    channels: PLAIN_CHANNELS,
    settings: {
      size_m: view.sizeM,
      edition: 1,
      title: "",
      reach_m: null,
      border: "free",
      sea_level_m: null,
      lakes_m: null,
      rivers: 0,
      wetness: 1,
      seed: 1,
      look,
      detail: 1,
      rule: "landscape",
      erosion: 1,
      erosion_scale: 10,
      hold: 1,
      sun_azimuth_deg: SUN.azimuth,
      sun_elevation_deg: SUN.elevation,
      place: null,
      task: null,
      task_pictures: [],
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

export interface World {
  readonly atlas: Atlas;
  readonly selection: Selection;
}

/** An empty atlas and selection for a store; `fades`: refined tiles enter by and by. */
export function makeWorld(rig: Rig, view: TileView, fades = false): World {
  const selection = new Selection(finestLevel(view.sizeM));
  const atlas = new Atlas(
    rig.device,
    (l, x, y, usable) => selection.tree.setUsable(l, x, y, usable, fades && l > view.solved),
    SOFTWARE_SLOTS,
  );
  for (const pass of [rig.frame, rig.fill, rig.sun, rig.taking]) pass.attach(atlas);
  return { atlas, selection };
}

export interface Pace {
  /** Share of their time by which tiles go on that fade in; all of it. */
  readonly entrance?: () => number;
  /** How often they go on at most. */
  readonly steps?: number;
  /** Share by which ground goes on that blends over; all of it. */
  readonly share?: number;
  /** How often figures may come; once: not at all. */
  readonly rounds?: number;
  /** The ground stands still, whatever the store has: one more camera on what is there. */
  readonly still?: boolean;
  /** In the look of the scene, with light. */
  readonly full?: boolean;
}

const STILL: Changes = { remade: [], moved: [] };

/** Brings the atlas up to date for a view, as a lean frame does. Returns the cut and how many tiles were made. */
function prepare(rig: Rig, world: World, scene: Scene, tau: number, how: Pace): { cut: Cut; made: number } {
  const { tiles, settings, channels } = scene;
  const detail = {
    sizeM: tiles.sizeM,
    seed: settings.seed,
    detail: settings.detail,
    rule: settings.rule,
    erosion: settings,
  };
  const { synthesis } = rig.fill;
  const anew = synthesis.configure({ ...detail, look: settings.look, seaLevelM: null, solved: tiles.solved });
  if (synthesis.setChannels(channels) || anew) world.atlas.remakeAll();
  world.selection.tree.expect(expectation(tiles.sizeM, settings, channels));
  const changes = how.still === true ? STILL : world.atlas.refresh(tiles, true, how.share ?? 1);
  for (const { level, x, y } of [...changes.remade, ...changes.moved]) world.selection.tree.remade(level, x, y);
  const entered = [];
  let cut = world.selection.select(tiles, scene.camera, tau, world.atlas);
  for (let step = 1; ; step += 1) {
    const more = world.atlas.admit(cut.requests, 4096);
    entered.push(...more);
    // Refined tiles are let in one level after the other, each when its parent has entered.
    const entering = world.selection.tree.advance((how.entrance ?? (() => 1))());
    if ((more.length === 0 && !entering) || step > (how.steps ?? 21)) break;
    cut = world.selection.select(tiles, scene.camera, tau, world.atlas);
  }
  const encoder = rig.device.createCommandEncoder();
  world.atlas.flushPages();
  rig.fill.run(encoder, tiles.sizeM, changes, entered);
  rig.device.queue.submit([encoder.finish()]);
  rig.fill.submitted();
  return { cut, made: changes.remade.length + changes.moved.length + entered.length };
}

/** The same until the view asks for no more, `rounds` times at most: figures of what was made come in between. */
export async function settle(rig: Rig, world: World, scene: Scene, tau: number, how: Pace = {}): Promise<Cut> {
  for (let round = 1; ; round += 1) {
    // All figures of what was made have come, so that a seed repeats its views.
    while (rig.fill.pending) if (!rig.fill.tell(world.selection.tree)) await new Promise((done) => setTimeout(done, 1));
    const { cut, made } = prepare(rig, world, scene, tau, how);
    if (made === 0 || round === (how.rounds ?? 1)) return cut;
  }
}

/** Tiles of a view that get light of their own: it is sampled as bytes, can be no NaN and moves no vertex. */
const LIT = 12;

/** Light on the coarsest tiles that a cut rests on, and on those that take it over from them. */
function lightUp(rig: Rig, { atlas }: World, encoder: GPUCommandEncoder, sizeM: number, high: number): void {
  const sun = sunDirection(SUN.azimuth, SUN.elevation);
  rig.sky.bake(rig.device, encoder, sun);
  const light = new LightQueue(rig.sun, atlas, rig.taking);
  const shown = [...atlas.residents()].filter((resident) => atlas.isCurrent(resident));
  light.mark(shown, [], sun);
  light.run(encoder, { sizeM, high, sun }, LIT);
}

/** The ground's pixels and the infinities and NaNs of a picture as half floats. Alpha is 0 only where nothing was drawn. */
function scan(words: Uint16Array): { ground: Uint8Array; nans: number } {
  const ground = new Uint8Array(words.length / 4);
  let nans = 0;
  for (let at = 0; at < words.length; at += 1) if ((words[at]! & 0x7c00) === 0x7c00) nans += 1;
  for (let at = 0; at < ground.length; at += 1) ground[at] = words[4 * at + 3] === 0 ? 0 : 1;
  return { ground, nans };
}

/** A picture in one colour. */
async function bare(rig: Rig, encoder: GPUCommandEncoder, cut: Cut): Promise<{ ground: Uint8Array; nans: number }> {
  const records = rig.records.write(cut.records, cut.count * RECORD_WORDS);
  const pixels = await rig.one.draw(encoder, rig.depth, (pass) => {
    pass.setBindGroup(0, rig.frame.bindGroup);
    rig.frame.widen(pass);
    pass.setPipeline(rig.bare);
    pass.setVertexBuffer(0, records);
    pass.setIndexBuffer(rig.indices, "uint16");
    pass.drawIndexed(INDEX_COUNT, cut.count);
  });
  return { ground: new Uint8Array(pixels), nans: 0 };
}

/** A view settled and drawn. */
export async function picture(rig: Rig, world: World, scene: Scene, tau: number, how: Pace = {}): Promise<Drawn> {
  const full = how.full === true;
  const cut = await settle(rig, world, scene, tau, how);
  const encoder = rig.device.createCommandEncoder();
  rig.frame.update(scene, { width: WIDTH, height: HEIGHT, low: cut.minHeight, high: cut.maxHeight });
  let shown: { ground: Uint8Array; nans: number };
  if (full) {
    lightUp(rig, world, encoder, scene.tiles.sizeM, cut.top);
    rig.patches.update(cut);
    while (rig.patches.dress({ look: scene.settings.look, detail: "plain" }).look !== scene.settings.look)
      await new Promise((done) => setTimeout(done, 10));
    const pixels = await rig.full.draw(encoder, rig.depth, (pass) => {
      pass.setBindGroup(0, rig.frame.bindGroup);
      rig.frame.widen(pass);
      rig.patches.drawGround(pass);
    });
    shown = scan(new Uint16Array(pixels));
  } else shown = await bare(rig, encoder, cut);
  const levels = new Set<number>();
  for (let i = 0; i < cut.count; i += 1) levels.add(recordLevel(cut.records, i));
  return { ...shown, full, patches: cut.count, mixed: levels.size > 1, deepest: Math.max(...levels) };
}

/** Takes the edge bits and corner weights away from every cut, to see a test fail. */
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
