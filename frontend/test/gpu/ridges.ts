/**
 * Low views among ridges, with and without the search for hidden patches (SPEC R58): pictures must be the same, and
 * `esker bench render` times both. Plain shading, so that the ground's geometry is what is drawn and what costs.
 */

import type { CameraState, FrameStats, Scene, Vec3 } from "../../src/core/types.ts";
import { openGpu } from "../../src/gpu/device.ts";
import type { Picture } from "../../src/gpu/passes/picture.ts";
import { GpuRenderer } from "../../src/gpu/renderer.ts";
import { samplesOf } from "./drawn.ts";
import { LAMBERT } from "./lambert.ts";
import { FieldView, filteredField, lookAt, mapCamera, PLAIN_CHANNELS, random } from "./world.ts";

const SIZE = 4096;
const RUGGED_M = 400;

interface Shown {
  readonly renderer: GpuRenderer;
  readonly canvas: HTMLCanvasElement;
  readonly device: GPUDevice;
  readonly view: FieldView;
}

let shown: Shown;
let tau = 1.5;
let nudge = 0;
let taken = 0;

const pause = (ms: number): Promise<void> => new Promise((done) => setTimeout(done, ms));

/** Opens a rugged ground. `rich`: as on a real device, multisampled; `shading` as in bench.ts. */
export async function open(options: {
  width: number;
  height: number;
  shading: "lambert" | "full";
  rich?: boolean;
  levels?: number;
  tauPx?: number;
}): Promise<void> {
  for (const old of document.querySelectorAll("canvas")) old.remove();
  const canvas = Object.assign(document.createElement("canvas"), { width: options.width, height: options.height });
  document.body.append(canvas);
  const found = await openGpu(canvas);
  const gpu = options.rich === true ? { ...found, software: false } : found;
  const { device } = gpu;
  const take = gpu.context.getCurrentTexture.bind(gpu.context);
  gpu.context.getCurrentTexture = () => {
    taken += 1;
    return take();
  };
  device.addEventListener("uncapturederror", (event) => {
    throw new Error(event.error.message);
  });
  if (options.shading === "lambert") {
    const make = device.createShaderModule.bind(device);
    device.createShaderModule = (d) => make({ ...d, code: LAMBERT.replace(d.label ?? "", d.code) });
  }
  tau = options.tauPx ?? 1.5;
  const view = new FieldView(SIZE, options.levels ?? 4, filteredField(7, RUGGED_M));
  shown = { renderer: await GpuRenderer.create(canvas, gpu), canvas, device, view };
  shown.renderer.endless = false;
}

function heightAt(view: FieldView, x: number, y: number): number {
  const n = 64 << view.levels;
  return samplesOf(view)(view.levels, Math.round((x / SIZE) * n), Math.round((y / SIZE) * n));
}

/** A place near the ground, looking over it; every fifth from the air, or the map. */
function pose(next: () => number, index: number): CameraState {
  const { canvas, view } = shown;
  const [width, height] = [canvas.width, canvas.height];
  const angle = next() * 2 * Math.PI;
  const [x, y] = [SIZE * (0.15 + 0.7 * next()), SIZE * (0.15 + 0.7 * next())];
  const up = index % 5 === 3 ? 200 + 300 * next() : 10 + 25 * next();
  if (index % 5 === 4) return mapCamera([x, y, 0], 900 + 2000 * next(), width, height);
  const eye: Vec3 = [x, y, heightAt(view, x, y) + up];
  const down = index % 5 === 3 ? 0.5 : 0.1 * (next() - 0.5);
  return lookAt(eye, [x + Math.cos(angle), y + Math.sin(angle), eye[2] - down], width, height, 50);
}

function scene(camera: CameraState): Scene {
  return {
    camera,
    tiles: shown.view,
    channels: PLAIN_CHANNELS,
    settings: {
      size_m: SIZE,
      edition: 1,
      title: "Ridges",
      reach_m: 128,
      border: "free",
      sea_level_m: null,
      lakes_m: null,
      rivers: 0,
      wetness: 1,
      seed: 1,
      look: "natural",
      rule: "plain",
      detail: 0,
      erosion: 0,
      erosion_scale: 10,
      hold: 1,
      sun_azimuth_deg: 115,
      sun_elevation_deg: 30,
      place: null,
      task: null,
      task_pictures: [],
    },
    strokes: [],
    ghost: null,
    cursors: [],
    tauPx: tau + 1e-9 * nudge,
    quality: "fine",
    time: 0,
    overlay: "none",
    showStrokes: false,
  };
}

/** Draws one frame, whether or not anything changed. */
async function draw(camera: CameraState, search: Picture["search"]): Promise<FrameStats> {
  shown.renderer.picture.search = search;
  for (;;) {
    nudge += 1;
    const before = taken;
    const stats = shown.renderer.render(scene(camera));
    if (taken > before) return stats;
    await shown.device.queue.onSubmittedWorkDone();
    await pause(1);
  }
}

/** Draws until all tiles of a view are there. */
async function settle(camera: CameraState): Promise<void> {
  shown.renderer.picture.search = "never";
  for (let i = 0; i < 20_000; i += 1) {
    const stats = shown.renderer.render(scene(camera));
    await pause(2);
    if (!stats.busy && i > 2) return;
  }
  throw new Error("the renderer never rests");
}

/** Draws until no tile enters any more; light, which plain shading does not show, may still be due. */
async function load(camera: CameraState): Promise<void> {
  for (let i = 0; i < 500; i += 1) {
    const { uploads } = await draw(camera, "never");
    await shown.device.queue.onSubmittedWorkDone();
    if (uploads === 0) return;
  }
  throw new Error("tiles never stop to enter");
}

async function pixels(camera: CameraState, search: Picture["search"]): Promise<Uint8ClampedArray> {
  await draw(camera, search);
  const { width, height } = shown.canvas;
  const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true })!;
  copy.drawImage(shown.canvas, 0, 0);
  const { data } = copy.getImageData(0, 0, width, height);
  await shown.device.queue.onSubmittedWorkDone();
  await pause(1);
  return data;
}

export interface RidgesReport {
  readonly differing: number;
  readonly covered: number;
  readonly patches: number;
  readonly drawn: number;
}

/**
 * Pixels that differ between pictures with and without the search, over random views. What the search remembers is of
 * another view at first, then of the same one.
 */
export async function compare(seed: number, views: number): Promise<RidgesReport> {
  const next = random(seed);
  const report = { differing: 0, covered: 0, patches: 0, drawn: 0 };
  for (let k = 0; k < views; k += 1) {
    const camera = pose(next, k);
    await load(camera);
    const plain = await pixels(camera, "never");
    for (let again = 0; again < 2; again += 1) {
      const searched = await pixels(camera, "always");
      for (let i = 0; i < plain.length; i += 4) {
        const same = plain[i] === searched[i] && plain[i + 1] === searched[i + 1] && plain[i + 2] === searched[i + 2];
        if (!same) report.differing += 1;
      }
      report.covered += plain.length / 4;
      report.patches += shown.renderer.picture.found.total;
      report.drawn += shown.renderer.picture.found.drawn;
    }
  }
  return report;
}

/** Takes up a low view for `frames`. */
export async function low(seed: number): Promise<{ patches: number }> {
  const camera = pose(random(seed), 0);
  standing = camera;
  await settle(camera);
  return { patches: (await draw(camera, "never")).patches };
}

let standing: CameraState;

/** Draws the low view `count` times, each waited for. */
export async function frames(count: number, search: Picture["search"]): Promise<{ patches: number; drawn: number }> {
  for (let i = 0; i < count; i += 1) {
    await draw(standing, search);
    await shown.device.queue.onSubmittedWorkDone();
  }
  await pause(5);
  const { total, drawn } = shown.renderer.picture.found;
  return { patches: total, drawn };
}
