/** The page behind frontend/dev/renderer.html: scenes for screenshots and for the tests that drive a browser. */

import type {
  ChannelGrid,
  ChannelView,
  CursorVisual,
  FrameStats,
  GhostVisual,
  Scene,
  SceneRenderer,
  StrokeVisual,
  SurfaceChoice,
  TerrainSettings,
  TileView,
  Vec3,
} from "../../src/core/types.ts";
import { openGpu } from "../../src/gpu/device.ts";
import { createMapRenderer, createRenderer } from "../../src/gpu/index.ts";
import { GpuRenderer } from "../../src/gpu/renderer.ts";
import { SETTINGS } from "../settings.ts";
import { crackTest, deepCrackTest, walkCrackTest } from "./cracks.ts";
import { guardTest } from "./guard.ts";
import { layeredCrackTest } from "./layered.ts";
import { synthesisVectors } from "./synthesis.ts";
import { alpineField, FieldView, lookAt, mapCamera, PLAIN_CHANNELS } from "./world.ts";

const worlds = new Map<string, TileView>();

function world(name: string, levels: number): TileView {
  const key = `${name}${levels}`;
  let view = worlds.get(key);
  if (view === undefined) {
    const smooth = alpineField(0);
    const rough = alpineField(1);
    const fields = {
      flat: () => 0,
      smooth: (x: number, y: number) => smooth(x, y, 0),
      rough: (x: number, y: number) => rough(x, y, 0),
      /** A cone with a crater of 90 m that has a low brim in the south. */
      crater: (x: number, y: number) => {
        const [east, north] = [x - 2048, y - 2048];
        const d = Math.hypot(east, north);
        const brim = 500 + 0.05 * north;
        return 0.12 * rough(x, y, 0) + (d > 420 ? Math.max(brim - 0.45 * (d - 420), 0) : brim - 0.34 * (420 - d));
      },
      island: (x: number, y: number) => {
        const d = Math.hypot(x - 2048, y - 2048) / 2048;
        return rough(x, y, 0) * Math.max(0, 1 - d * d) - 60 * d * d + 12;
      },
    };
    view = new FieldView(4096, levels, fields[name as keyof typeof fields]);
    worlds.set(key, view);
  }
  return view;
}

/** Loads a terrain from a raw little-endian float32 grid of (64 * 2^levels + 1)^2 heights, row 0 south. */
async function load(name: string, url: string, levels: number, sizeM: number): Promise<void> {
  const grid = new Float32Array(await (await fetch(url)).arrayBuffer());
  const n = 64 * 2 ** levels + 1;
  const at = (v: number): number => Math.round((v / sizeM) * (n - 1));
  worlds.set(`${name}${levels}`, new FieldView(sizeM, levels, (x, y) => grid[at(y) * n + at(x)]!));
}

interface Shot {
  world: string;
  levels?: number;
  eye: Vec3;
  target: Vec3;
  settings?: Partial<TerrainSettings>;
  overlay?: Scene["overlay"];
  strokes?: boolean;
  map?: number;
  /** Draw with the 2D map. */
  print?: boolean;
  /** Draw as on a real GPU: all detail, multisampled. */
  rich?: boolean;
  /** What of the surface is drawn; what suits the adapter where it is left out. */
  surface?: SurfaceChoice;
  /** Paint over the whole domain: values of channels, -1..1. */
  paint?: Partial<Record<"snow" | "grass" | "forest" | "wetness", number>>;
  tau?: number;
  /** Near plane, metres. */
  near?: number;
  /** Seconds; 0: nothing moves. */
  time?: number;
  width?: number;
  height?: number;
}

function demoStrokes(view: TileView): { strokes: StrokeVisual[]; ghost: GhostVisual; cursors: CursorVisual[] } {
  const ground = (x: number, y: number): number => {
    const n = 1 << view.levels;
    const w = view.sizeM / n;
    const tile = view.tile(view.levels, Math.floor(x / w), Math.floor(y / w));
    return tile?.heights[Math.round(((y % w) / w) * 64) * 65 + Math.round(((x % w) / w) * 64)] ?? 0;
  };
  const line = (a: [number, number], b: [number, number], rise: number): Float32Array => {
    const out: number[] = [];
    for (let i = 0; i <= 40; i += 1) {
      const t = i / 40;
      const x = a[0] + (b[0] - a[0]) * t;
      const y = a[1] + (b[1] - a[1]) * t;
      out.push(x, y, ground(x, y) + rise * Math.sin(Math.PI * t));
    }
    return Float32Array.from(out);
  };
  const visual = (
    id: string,
    points: Float32Array,
    colour: [number, number, number, number],
    selected = false,
  ): StrokeVisual => ({
    id,
    kind: "profile",
    points,
    colour,
    selected,
    hovered: false,
    live: false,
  });
  const shadow = line([900, 1000], [2300, 900], 0);
  return {
    strokes: [
      visual("a", line([500, 2300], [3700, 2700], 60), [0.95, 0.55, 0.2, 1]),
      visual("b", line([1300, 2650], [1300, 1500], 0), [0.3, 0.75, 0.95, 1]),
      visual("c", line([900, 1000], [2300, 900], 320), [0.95, 0.85, 0.3, 1], true),
    ],
    ghost: {
      corners: [
        [800, 1007, ground(900, 1000) - 20],
        [2400, 893, ground(2300, 900) - 20],
        [2400, 893, 520],
        [800, 1007, 520],
      ],
      shadow,
      colour: [0.55, 0.8, 1, 0.8],
    },
    cursors: [
      { position: [2700, 1100, ground(2700, 1100)], colour: [0.4, 0.9, 0.5, 1], radiusPx: 18 },
      { position: [2300, 900, ground(2300, 900)], colour: [0.95, 0.85, 0.3, 1], radiusPx: 12 },
    ],
  };
}

function scene(shot: Shot, width: number, height: number): Scene {
  const view = world(shot.world, shot.levels ?? 4);
  const demo = shot.strokes === true ? demoStrokes(view) : { strokes: [], ghost: null, cursors: [] };
  return {
    camera:
      shot.map === undefined
        ? lookAt(shot.eye, shot.target, width, height, 45, shot.near ?? 2)
        : mapCamera(shot.target, shot.map, width, height),
    tiles: view,
    channels: shot.paint === undefined ? PLAIN_CHANNELS : painted(shot.paint),
    settings: { ...SETTINGS, ...shot.settings },
    strokes: demo.strokes,
    ghost: demo.ghost,
    cursors: demo.cursors,
    tauPx: shot.tau ?? 1.5,
    ...(shot.surface === undefined ? {} : { surface: shot.surface }),
    time: shot.time ?? 12,
    overlay: shot.overlay ?? "none",
    showStrokes: true,
  };
}

const paints = new Map<string, ChannelView>();

/** Channels that say the same everywhere. */
function painted(paint: NonNullable<Shot["paint"]>): ChannelView {
  const key = JSON.stringify(paint);
  const all = (value: number): ChannelGrid => ({ side: 2, values: new Float32Array(4).fill(value) });
  const made = paints.get(key) ?? {
    ...PLAIN_CHANNELS,
    ...Object.fromEntries(Object.entries(paint).map(([name, value]) => [name, all(value)])),
  };
  paints.set(key, made);
  return made;
}

const renderers = new Map<string, SceneRenderer>();

const canvasOf = (shot: Shot): string => (shot.print === true ? "print" : shot.rich === true ? "rich" : "plain");

/** The renderer that a shot asks for, its canvas shown. */
async function rendererFor(shot: Shot): Promise<SceneRenderer> {
  const id = canvasOf(shot);
  for (const other of document.querySelectorAll("canvas")) other.hidden = other.id !== id;
  const canvas = document.querySelector<HTMLCanvasElement>(`#${id}`)!;
  let made = renderers.get(id);
  if (made === undefined) {
    if (id === "print") made = createMapRenderer(canvas);
    else if (id === "rich") made = await GpuRenderer.create(canvas, { ...(await openGpu(canvas)), software: false });
    else made = await createRenderer(canvas);
    renderers.set(id, made);
  }
  return made;
}

/** Pictures that were drawn on canvases of the device. */
let drawnPictures = 0;
const currentTexture = GPUCanvasContext.prototype.getCurrentTexture;
GPUCanvasContext.prototype.getCurrentTexture = function (this: GPUCanvasContext): GPUTexture {
  drawnPictures += 1;
  return currentTexture.call(this);
};

/**
 * Asks a renderer for a frame, and tells whether it drew one: where it skips, its figures are those of the last frame, and
 * two frames may have the same figures. Taken for one, the last picture before the renderer rested was lost now and then.
 */
function drew(used: SceneRenderer, asked: Scene): { stats: FrameStats; isDrawn: boolean } {
  const before = drawnPictures;
  const stats = used.render(asked);
  return { stats, isDrawn: drawnPictures !== before || used.kind === "map" };
}

/**
 * Draws a scene until the renderer rests; returns the last frame's figures with the number of frames. `drawn` is called in
 * the task that drew a frame: a WebGPU canvas keeps its picture only until that ends.
 */
async function drawToRest(
  used: SceneRenderer,
  asked: Scene,
  drawn: () => void = () => {},
): Promise<FrameStats & { frames: number }> {
  for (let frames = 1; ; frames += 1) {
    const { stats, isDrawn } = drew(used, asked);
    if (isDrawn) drawn();
    await new Promise((done) => setTimeout(done, 16));
    if (!stats.busy && frames > 2) return { ...stats, frames };
    if (frames > 9000) throw new Error("the renderer never rests");
  }
}

/** Draws a shot until the renderer rests, and tells how long that took. */
async function shoot(shot: Shot): Promise<FrameStats & { frames: number; description: string; ms: number }> {
  const used = await rendererFor(shot);
  const began = performance.now();
  const stats = await drawToRest(used, scene(shot, shot.width ?? 1280, shot.height ?? 720));
  return { ...stats, description: used.description, ms: performance.now() - began };
}

let pictures = 0;

/** The picture of a shot at rest as a PNG data URL. */
async function picture(shot: Shot): Promise<string> {
  const used = await rendererFor(shot);
  const canvas = document.querySelector<HTMLCanvasElement>(`#${canvasOf(shot)}`)!;
  const asked = scene(shot, shot.width ?? 1280, shot.height ?? 720);
  pictures += 1;
  const anew = { ...asked, tauPx: asked.tauPx * (1 + 1e-9 * pictures) }; // nothing that shows, but it is drawn once at least
  let url = "";
  await drawToRest(used, anew, () => {
    url = canvas.toDataURL("image/png");
  });
  return url;
}

/** The first picture after a shot got another look, PNG data URL; what the look needs is not made yet. */
async function firstIn(shot: Shot, look: TerrainSettings["look"]): Promise<string> {
  const used = await rendererFor(shot);
  const canvas = document.querySelector<HTMLCanvasElement>(`#${canvasOf(shot)}`)!;
  const changed = scene({ ...shot, settings: { ...shot.settings, look } }, shot.width ?? 1280, shot.height ?? 720);
  await shoot(shot);
  while (!drew(used, changed).isDrawn) await new Promise((done) => setTimeout(done, 8));
  return canvas.toDataURL("image/png");
}

/** Draws `frames` frames of a circling camera, waiting for the device after each; milliseconds per frame. */
async function circle(shot: Shot, frames: number): Promise<{ ms: number; patches: number }> {
  const used = await rendererFor(shot);
  const began = performance.now();
  let patches = 0;
  for (let i = 0; i < frames; ) {
    const turned: Shot = { ...shot, eye: [shot.eye[0] + i * 3, shot.eye[1], shot.eye[2]] };
    const { stats, isDrawn } = drew(used, scene(turned, shot.width ?? 1280, shot.height ?? 720));
    if (isDrawn) i += 1;
    patches = stats.patches;
    await new Promise((done) => setTimeout(done, 8));
  }
  return { ms: (performance.now() - began) / frames, patches };
}

/** Changes all tiles of a rough world at once, as a live morph does, and gives the host's milliseconds for the frame. */
async function morph(shot: Shot, rounds: number): Promise<{ uploads: number; cpuMs: number[] }> {
  await shoot(shot);
  const used = await rendererFor(shot);
  const view = world(shot.world, shot.levels ?? 4) as FieldView;
  const s = scene(shot, shot.width ?? 1280, shot.height ?? 720);
  const cpuMs: number[] = [];
  let uploads = 0;
  for (let round = 0; round < rounds; round += 1) {
    view.change((x, y) => 300 * Math.sin(x / 300 + round) * Math.cos(y / 400) + 20 * Math.sin((x * y) / 9000));
    let stats = used.render(s);
    while (stats.uploads === 0) {
      await new Promise((done) => setTimeout(done, 5));
      stats = used.render(s);
    }
    cpuMs.push(stats.cpuMs);
    uploads = stats.uploads;
  }
  return { uploads, cpuMs };
}

Object.assign(globalThis, {
  esker: {
    morph,
    load,
    shoot,
    picture,
    firstIn,
    circle,
    crackTest,
    deepCrackTest,
    guardTest,
    layeredCrackTest,
    walkCrackTest,
    synthesisVectors,
  },
});
