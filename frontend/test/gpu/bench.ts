/**
 * The page behind frontend/dev/bench.html: our renderer as `esker bench render` measures it. `lambert` draws the ground
 * with the plain shading of three.js and of the dense reference, `flat` in one colour as CesiumJS does, so that geometry is
 * compared with geometry; `full` is the picture that people see.
 */

import type { FrameStats, QualityMode, Scene, TerrainSettings, TileView, Vec3 } from "../../src/core/types.ts";
import { PATCH_CELLS, SUBPATCHES } from "../../src/generated/contract.ts";
import { openGpu } from "../../src/gpu/device.ts";
import { GpuRenderer } from "../../src/gpu/renderer.ts";
import { recordColumn, recordLevel, recordRow } from "../../src/tiles/patches/records.ts";
import { type Cut, Selection } from "../../src/tiles/patches/selection.ts";
import { drawReference } from "./dense.ts";
import { type DrawnPatch, drawnPatch, samplesOf, shownHeight } from "./drawn.ts";
import { flightCamera, fly, type Moment, Tally } from "./flight.ts";
import { hiddenTwin } from "./hiddentwin.ts";
import { LAMBERT, type Plain } from "./lambert.ts";
import * as ridges from "./ridges.ts";
import { craggyField, FieldView, filteredField, lookAt, PLAIN_CHANNELS, SparseView } from "./world.ts";

export interface Camera {
  readonly eye: Vec3;
  readonly target: Vec3;
  readonly fovDeg: number;
  readonly near: number;
  readonly far: number;
  /** Metres east that a moving camera goes in a frame. */
  readonly stepM: number;
}

interface Ground {
  readonly url: string;
  readonly side: number;
  readonly sizeM: number;
  readonly width: number;
  readonly height: number;
  readonly sun: Vec3;
  readonly camera: Camera;
}

interface Shown {
  readonly renderer: GpuRenderer;
  readonly canvas: HTMLCanvasElement;
  readonly device: GPUDevice;
  readonly tally: Tally;
}

/** A view of nothing in particular, until `load` says of what. */
const IDLE: Ground = {
  url: "",
  side: 513,
  sizeM: 4096,
  width: 400,
  height: 300,
  sun: [-0.5, -0.2, 0.6],
  camera: { eye: [700, 700, 500], target: [1800, 1800, 100], fovDeg: 50, near: 1, far: 30_000, stepM: 3 },
};

let ground: Ground = IDLE;
let heights: Float32Array;
let view: TileView;
let shown: Shown;
let detail: Pick<TerrainSettings, "rule" | "detail"> = { rule: "plain", detail: 0 };
let tau = 1;
let quality: QualityMode = "fine";
/** A bound that differs by nothing that shows makes the renderer draw the same picture again. */
let nudge = 0;
/** Pictures drawn: the renderer takes the canvas's texture once for each. */
let drawn = 0;

/** Takes up a raw little-endian float32 grid, row 0 south. */
async function load(made: Ground): Promise<void> {
  ground = made;
  heights = new Float32Array(await (await fetch(made.url)).arrayBuffer());
  const last = made.side - 1;
  const at = (v: number): number => Math.round((v / made.sizeM) * last);
  view = new FieldView(made.sizeM, Math.log2(last / 64), (x, y) => heights[at(y) * made.side + at(x)]!);
}

/** Ground with features of every size whose finest level has (64 · 2^levels + 1)² samples, held where the camera looks. */
function grow(levels: number): void {
  const { sizeM, camera } = ground;
  const sparse = new SparseView(sizeM, levels, Math.min(4, levels), craggyField(3, sizeM));
  sparse.refineAround(camera.target[0], camera.target[1], () => 3);
  view = sparse;
}

async function open(shading: Plain | "full"): Promise<{ description: string }> {
  for (const old of document.querySelectorAll("canvas")) old.remove();
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width: ground.width, height: ground.height });
  document.body.append(canvas);
  const gpu = await openGpu(canvas);
  const { device } = gpu;
  const tally = new Tally(device);
  const take = gpu.context.getCurrentTexture.bind(gpu.context);
  gpu.context.getCurrentTexture = () => {
    drawn += 1;
    return take();
  };
  device.addEventListener("uncapturederror", (event) => {
    throw new Error(event.error.message);
  });
  if (shading !== "full") {
    const make = device.createShaderModule.bind(device);
    device.createShaderModule = (d) => make({ ...d, code: LAMBERT.replace(d.label ?? "", d.code, shading) });
  }
  shown = { renderer: await GpuRenderer.create(canvas, gpu), canvas, device, tally };
  // Peers and reference end with the map: so does what is compared with them.
  shown.renderer.endless = shading === "full";
  return { description: shown.renderer.description };
}

function scene(step: number): Scene {
  const { camera, width, height, sizeM, sun } = ground;
  const along = step * camera.stepM;
  const eye: Vec3 = [camera.eye[0] + along, camera.eye[1], camera.eye[2]];
  const target: Vec3 = [camera.target[0] + along, camera.target[1], camera.target[2]];
  return {
    camera: lookAt(eye, target, width, height, camera.fovDeg, camera.near, camera.far),
    tiles: view,
    channels: PLAIN_CHANNELS,
    settings: {
      size_m: sizeM,
      edition: 1,
      title: "Bench",
      reach_m: 128,
      border: "free",
      sea_level_m: null,
      lakes_m: null,
      rivers: 0,
      wetness: 1,
      seed: 1,
      look: "natural",
      ...detail,
      erosion: 0,
      erosion_scale: 10,
      hold: 1,
      sun_azimuth_deg: (Math.atan2(sun[0], sun[1]) * 180) / Math.PI,
      sun_elevation_deg: (Math.atan2(sun[2], Math.hypot(sun[0], sun[1])) * 180) / Math.PI,
      place: null,
      task: null,
      task_pictures: [],
    },
    strokes: [],
    ghost: null,
    cursors: [],
    tauPx: tau + 1e-9 * nudge,
    quality,
    time: 0,
    overlay: "none",
    showStrokes: false,
  };
}

const pause = (ms: number): Promise<void> => new Promise((done) => setTimeout(done, ms));

/** Draws until the renderer rests. */
async function settle(tauPx: number, mode: QualityMode): Promise<FrameStats> {
  tau = tauPx;
  quality = mode;
  for (let i = 0; i < 20_000; i += 1) {
    const stats = shown.renderer.render(scene(0));
    await pause(4);
    if (!stats.busy && i > 2) return stats;
  }
  throw new Error("the renderer never rests");
}

/** Draws `count` frames of a still or a moving camera, each waited for. Times in milliseconds, of this thread but `wall`. */
async function frames(
  count: number,
  moving: boolean,
): Promise<{ wall: number; host: number; select: number; patches: number }> {
  const began = performance.now();
  const sum = { host: 0, select: 0, patches: 0 };
  for (let i = 0; i < count; i += 1) {
    const stats = await draw(moving ? i : 0);
    await shown.device.queue.onSubmittedWorkDone();
    sum.host += stats.cpuMs;
    sum.select += stats.selectMs;
    sum.patches += stats.patches;
  }
  const wall = performance.now() - began;
  return { wall: wall / count, host: sum.host / count, select: sum.select / count, patches: sum.patches / count };
}

/** Draws one frame, whether or not anything changed; the canvas holds it until the task ends. */
async function draw(step: number): Promise<FrameStats> {
  for (;;) {
    nudge += 1;
    const before = drawn;
    const stats = shown.renderer.render(scene(step));
    if (drawn > before) return stats;
    // The device is behind: the frame was put off.
    await shown.device.queue.onSubmittedWorkDone();
    await pause(1);
  }
}

/** The picture at rest as a PNG data URL. */
async function picture(): Promise<string> {
  await settle(tau, quality);
  await draw(0);
  return shown.canvas.toDataURL("image/png");
}

/** The whole grid, every triangle of it, with the same shading. */
async function reference(): Promise<string> {
  return drawReference({ ...ground, heights, camera: scene(0).camera });
}

/**
 * Vertical error on the screen, pixels, at samples of the grid (flat indices, inside of the picture); those behind nearer
 * ground count too.
 */
function screenError(tauPx: number, places: readonly number[]): Record<"places" | "p50" | "p95" | "max", number> {
  const { camera, side, sizeM, height } = ground;
  const selection = new Selection(view.levels);
  selection.occlusion = false;
  for (const tile of view.tiles()) selection.tree.setUsable(tile.level, tile.x, tile.y, true);
  tau = tauPx;
  const cut = selection.select(view, scene(0).camera, tauPx, { slot: () => 0, touch: () => {} });
  const sample = samplesOf(view);
  const perRadian = height / 2 / Math.tan((camera.fovDeg * Math.PI) / 360);
  const cell = sizeM / (side - 1);
  const errors: number[] = [];
  const drawnAt = patchAt(cut, (p) => drawnPatch(cut, p, sizeM, sample));
  for (const k of places) {
    const [i, j] = [k % side, Math.floor(k / side)];
    const patch = drawnAt((i * cell) / sizeM, (j * cell) / sizeM);
    if (patch === undefined) continue;
    const truth = heights[k]!;
    const off = Math.abs(shownHeight(patch, i * cell, j * cell) - truth);
    const away = Math.hypot(i * cell - camera.eye[0], j * cell - camera.eye[1], truth - camera.eye[2]);
    errors.push((off * perRadian) / away);
  }
  errors.sort((a, b) => a - b);
  const quantile = (q: number): number => errors[Math.floor(q * (errors.length - 1))]!;
  return { places: errors.length, p50: quantile(0.5), p95: quantile(0.95), max: quantile(1) };
}

/** Finds the patch of a cut that lies at a place, given as parts of the domain; each is made once. */
function patchAt(cut: Cut, make: (index: number) => DrawnPatch): (u: number, v: number) => DrawnPatch | undefined {
  const key = (level: number, column: number, row: number): number => (level * 4096 + column) * 4096 + row;
  const found = new Map<number, number>();
  for (let p = 0; p < cut.count; p += 1) {
    const { records } = cut;
    const [column, row] = [recordColumn(records, p) / PATCH_CELLS, recordRow(records, p) / PATCH_CELLS];
    found.set(key(recordLevel(records, p), column, row), p);
  }
  const made: DrawnPatch[] = [];
  return (u, v) => {
    for (let level = 0; level <= view.levels; level += 1) {
      const across = SUBPATCHES << level;
      const on = (part: number): number => Math.min(across - 1, Math.floor(part * across));
      const p = found.get(key(level, on(u), on(v)));
      if (p !== undefined) {
        made[p] ??= make(p);
        return made[p];
      }
    }
    return undefined;
  };
}

/** Hills of 4 km whose detail is made where one looks, in a window of 400 x 300. */
async function hills(): Promise<void> {
  view = new FieldView(IDLE.sizeM, 3, filteredField(11, 220));
  ground = IDLE;
  detail = { rule: "landscape", detail: 1 };
  tau = 1.5;
  quality = "fine";
  await open("full");
}

/** A flight over the hills, low above the ground. */
async function flight(options: { frames: number; seconds: number; moments: number; stepM: number }): Promise<Moment[]> {
  await hills();
  const still = scene(0);
  const size: [number, number] = [ground.width, ground.height];
  const sceneAt = (frame: number): Scene => ({ ...still, camera: flightCamera(view, frame, options.stepM, 12, size) });
  return fly(shown.renderer, shown.device, shown.tally, sceneAt, options);
}

/** Pixels that differ between consecutive frames of a scene at rest, and the largest difference of a channel. */
async function flicker(frames: number): Promise<{ differing: number; largest: number }> {
  await settle(tau, quality);
  let last: Uint8ClampedArray | null = null;
  let differing = 0;
  let largest = 0;
  const { width, height } = shown.canvas;
  const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true })!;
  for (let i = 0; i < frames; i += 1) {
    await draw(0);
    copy.drawImage(shown.canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, width, height);
    await shown.device.queue.onSubmittedWorkDone();
    for (let k = 0; last !== null && k < data.length; k += 1) {
      const d = Math.abs(data[k]! - last[k]!);
      if (d > 0) differing += 1;
      largest = Math.max(largest, d);
    }
    last = data;
  }
  return { differing, largest };
}

Object.assign(globalThis, {
  bench: {
    load,
    grow,
    open,
    settle,
    frames,
    picture,
    reference,
    screenError,
    hills,
    flight,
    flicker,
    ridges,
    hiddenTwin,
  },
});
