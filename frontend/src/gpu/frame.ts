/**
 * Bindings that all passes of a frame share: the view uniform, the atlas, the sky tables, noise and stones
 * (shaders/wgsl/view.wgsl).
 */

import { eyeProjection, reversedDepth, viewAxes } from "../core/camera/projection.ts";
import type { Scene, Vec3 } from "../core/types.ts";
import { type Look, MAX_SYNTHESIS_LEVEL, TILE_CELLS } from "../generated/contract.ts";
import type { Lakes } from "../tiles/lakes/lakes.ts";
import { reliefM, shoreM, zeroM } from "../tiles/rules/rule.ts";
import type { Atlas } from "./atlas/atlas.ts";
import { ChannelTexture, contourShares, overlayGrid } from "./atlas/channeltexture.ts";
import { LakeTexture } from "./atlas/laketexture.ts";
import { RiverTexture } from "./atlas/rivertexture.ts";
import { StructWriter, structLayout } from "./layout.ts";
import { adaptation, contourInterval, LOOKS } from "./looks.ts";
import type { SkyTables } from "./passes/sky.ts";
import { VIEW_SOURCE } from "./shaders.ts";

const MAX_CURSORS = 32;
const OVERLAYS = {
  none: 0,
  contours: 1,
  slope: 2,
  patches: 3,
  detail: 4,
  influence: 5,
  snow: 6,
  forest: 6,
  grass: 6,
  wetness: 6,
  erosion: 6,
  watershed: 7,
  difference: 8,
} as const;

/** Facts that a frame is drawn with besides the scene. */
export interface FrameFacts {
  readonly width: number;
  readonly height: number;
  readonly low: number;
  readonly high: number;
  /** The lakes of the terrain; without them no lake is drawn. */
  readonly lakes?: Lakes | null;
  /**
   * The look in which the ground is drawn while the terrain's own look is still being made; without it the terrain's
   * own.
   */
  readonly look?: Look;
}

/** Unit vector towards the sun; azimuth clockwise from north (the y axis), degrees. */
export function sunDirection(azimuthDeg: number, elevationDeg: number): Vec3 {
  const a = (azimuthDeg * Math.PI) / 180;
  const e = (Math.max(elevationDeg, 0.5) * Math.PI) / 180;
  return [Math.sin(a) * Math.cos(e), Math.cos(a) * Math.cos(e), Math.sin(e)];
}

export class FrameBindings {
  readonly layout: GPUBindGroupLayout;
  readonly #writer = new StructWriter(structLayout(VIEW_SOURCE, "View"));
  readonly #uniform: GPUBuffer;
  readonly #clamp: GPUSampler;
  readonly #repeat: GPUSampler;
  readonly #channels: ChannelTexture;
  readonly #lakes: LakeTexture;
  readonly #rivers: RiverTexture;
  #atlas: Atlas | null = null;
  /** Pixels that the last update was for. */
  #drawn = { width: 1, height: 1 };
  #group: GPUBindGroup | null = null;

  readonly #device: GPUDevice;
  readonly #sky: SkyTables;
  readonly #noise: GPUTexture;
  #stones: GPUTexture;
  readonly #guardPx: number;

  constructor(
    device: GPUDevice,
    sky: SkyTables,
    noise: GPUTexture,
    stones: GPUTexture,
    software: boolean,
    guardPx: number = 0,
  ) {
    this.#device = device;
    this.#sky = sky;
    this.#noise = noise;
    this.#stones = stones;
    this.#guardPx = guardPx;
    const visibility = GPUShaderStage.VERTEX | GPUShaderStage.FRAGMENT | GPUShaderStage.COMPUTE;
    const texture = (
      binding: number,
      sampleType: GPUTextureSampleType,
      viewDimension: GPUTextureViewDimension,
    ): GPUBindGroupLayoutEntry => ({ binding, visibility, texture: { sampleType, viewDimension } });
    this.layout = device.createBindGroupLayout({
      label: "frame",
      entries: [
        { binding: 0, visibility, buffer: { type: "uniform" } },
        texture(1, "unfilterable-float", "2d-array"),
        texture(2, "float", "2d-array"),
        texture(3, "float", "2d-array"),
        texture(4, "float", "2d"),
        { binding: 5, visibility, buffer: { type: "uniform" } },
        texture(6, "float", "2d"),
        { binding: 7, visibility, sampler: { type: "filtering" } },
        { binding: 8, visibility, sampler: { type: "filtering" } },
        texture(9, "float", "2d"),
        texture(10, "float", "2d-array"),
        texture(11, "float", "2d-array"),
        texture(12, "float", "2d"),
        texture(13, "unfilterable-float", "2d"),
        texture(14, "unfilterable-float", "2d"),
      ],
    });
    this.#channels = new ChannelTexture(device);
    this.#lakes = new LakeTexture(device);
    this.#rivers = new RiverTexture(device);
    this.#uniform = device.createBuffer({
      label: "view",
      size: this.#writer.layout.size,
      usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST,
    });
    this.#clamp = device.createSampler({ label: "clamp", magFilter: "linear", minFilter: "linear" });
    this.#repeat = device.createSampler({
      label: "repeat",
      addressModeU: "repeat",
      addressModeV: "repeat",
      magFilter: "linear",
      minFilter: "linear",
      mipmapFilter: software ? "nearest" : "linear",
      maxAnisotropy: software ? 1 : 8,
    });
  }

  /** Binds another atlas. */
  attach(atlas: Atlas): void {
    this.#atlas = atlas;
    const array = (texture: GPUTexture): GPUTextureView => texture.createView({ dimension: "2d-array" });
    this.#group = this.#device.createBindGroup({
      label: "frame",
      layout: this.layout,
      entries: [
        { binding: 0, resource: { buffer: this.#uniform } },
        { binding: 1, resource: array(atlas.heights) },
        { binding: 2, resource: array(atlas.slopes) },
        { binding: 3, resource: array(atlas.light) },
        { binding: 4, resource: this.#sky.radiance.createView() },
        { binding: 5, resource: { buffer: this.#sky.ambient } },
        { binding: 6, resource: this.#noise.createView() },
        { binding: 7, resource: this.#clamp },
        { binding: 8, resource: this.#repeat },
        { binding: 9, resource: this.#channels.texture.createView() },
        { binding: 10, resource: array(atlas.attributes0) },
        { binding: 11, resource: array(atlas.attributes1) },
        { binding: 12, resource: this.#stones.createView() },
        { binding: 13, resource: this.#lakes.texture.createView() },
        { binding: 14, resource: this.#rivers.texture.createView() },
      ],
    });
  }

  /** From now on materials read this texture of stones. */
  useStones(stones: GPUTexture): void {
    this.#stones.destroy();
    this.#stones = stones;
    if (this.#atlas !== null) this.attach(this.#atlas);
  }

  /** The view uniform, for passes that bind nothing else of a frame. */
  get view(): GPUBuffer {
    return this.#uniform;
  }

  /** The bind group; `attach` must have been called. */
  get bindGroup(): GPUBindGroup {
    if (this.#group === null) throw new Error("frame: no atlas attached");
    return this.#group;
  }

  /** From here on a pass draws patches: their vertices are for a viewport with a border (gpu/passes/guard.ts). */
  widen(pass: GPURenderPassEncoder): void {
    if (this.#guardPx > 0) this.#setViewport(pass, this.#guardPx);
  }

  /** From here on a pass draws all else. */
  narrow(pass: GPURenderPassEncoder): void {
    if (this.#guardPx > 0) this.#setViewport(pass, 0);
  }

  /** Writes the uniform for this frame. */
  update(scene: Scene, facts: FrameFacts): void {
    const { lakes = null } = facts;
    const every = scene.contourM || contourInterval(facts.high - facts.low);
    const channels = this.#channels.update(scene.channels, overlayGrid(scene), contourShares(scene, every));
    const grown = this.#lakes.update(lakes);
    const rivers = this.#rivers.update(scene.rivers ?? null);
    if ((channels || grown || rivers) && this.#atlas !== null) this.attach(this.#atlas);
    this.#writeCamera(scene, facts);
    const w = this.#writer;
    const { settings } = scene;
    const size = scene.tiles.sizeM;
    const name = facts.look ?? settings.look;
    const look = LOOKS[name];
    const sun = sunDirection(settings.sun_azimuth_deg, settings.sun_elevation_deg);
    const relief = facts.high - facts.low;
    w.set("sun", [...sun, sun[2]]);
    w.set("time", scene.time % 3600);
    w.set("size", size);
    w.set("base", baseHeight(facts.low, size));
    const climate = { ...settings, ground: scene.ground ?? null };
    w.set("sea", zeroM(climate));
    w.set("has_sea", settings.sea_level_m === null ? 0 : 1);
    w.set("has_lakes", lakes === null ? 0 : 1);
    w.set("has_rivers", scene.rivers ? 1 : 0);
    w.set("exposure", look.exposure * (name === "paper" ? 1 : adaptation(settings.sun_elevation_deg)));
    w.set("haze", look.haze / size);
    w.set("low", facts.low);
    w.set("high", facts.high);
    w.set("grid", 1 - smoothstep(0.02, 0.1, relief / size));
    w.set("contour", scene.contourM || contourInterval(relief));
    w.set("line_scale", scene.lineScale ?? 1);
    w.set("contour_strength", relief > 0 ? look.contours : 0);
    w.set("look", look.index);
    w.set("amplitude", this.#channels.fullScale);
    w.set("relief", reliefM({ ...climate, size_m: size }));
    w.set("shore", shoreM(size, settings.place));
    w.set("shade", scene.surface?.shade === false ? 0 : 1);
    w.set("overlay", OVERLAYS[scene.overlay]);
    this.#writeCursors(scene);
    this.#device.queue.writeBuffer(this.#uniform, 0, w.buffer);
  }

  destroy(): void {
    this.#uniform.destroy();
    this.#channels.destroy();
    this.#lakes.destroy();
    this.#rivers.destroy();
  }

  #setViewport(pass: GPURenderPassEncoder, border: number): void {
    const { width, height } = this.#drawn;
    pass.setViewport(-border, -border, width + 2 * border, height + 2 * border, 0, 1);
  }

  #writeCamera(scene: Scene, facts: FrameFacts): void {
    const w = this.#writer;
    const { camera } = scene;
    const { forward, right, up } = viewAxes(camera);
    const ortho = camera.orthoHeight > 0;
    const tan = Math.tan((camera.fovDeg * Math.PI) / 360);
    w.set("eye_proj", reversedDepth(eyeProjection(camera)));
    w.set("eye", [...camera.eye, ortho ? 1 : 0]);
    w.set("eye_low", [...camera.eye.map((v) => v - Math.fround(v)), 0]);
    const cell = scene.tiles.sizeM / (TILE_CELLS << MAX_SYNTHESIS_LEVEL);
    const whole = [camera.eye[0], camera.eye[1]].map((v) => Math.floor(v / cell));
    w.set("eye_cell", whole);
    w.set("eye_part", [camera.eye[0] - whole[0]! * cell, camera.eye[1] - whole[1]! * cell]);
    w.set("finest_cell", cell);
    const k = camera.exaggeration ?? 1;
    // Directions of the true world, in which all that is lit lies.
    const truly = (v: Vec3): Vec3 => (ortho ? v : [v[0], v[1], v[2] / k]);
    w.set("exaggeration", k);
    w.set("right", [...truly(right), (tan * facts.width) / facts.height]);
    w.set("up", [...truly(up), tan]);
    w.set("forward", [...truly(forward), ortho ? camera.orthoHeight / facts.height : (2 * tan) / facts.height]);
    w.set("viewport", [facts.width, facts.height]);
    const border = 2 * this.#guardPx;
    w.set("guard", [facts.width / (facts.width + border), facts.height / (facts.height + border)]);
    this.#drawn = { width: facts.width, height: facts.height };
  }

  #writeCursors(scene: Scene): void {
    const shown = scene.cursors.slice(0, MAX_CURSORS);
    const { camera } = scene;
    const scale = camera.orthoHeight > 0 ? camera.orthoHeight : 2 * Math.tan((camera.fovDeg * Math.PI) / 360);
    shown.forEach((cursor, i) => {
      const [x, y, z] = cursor.position;
      const dz = (camera.exaggeration ?? 1) * (z - camera.eye[2]);
      const away = camera.orthoHeight > 0 ? 1 : Math.hypot(x - camera.eye[0], y - camera.eye[1], dz);
      const pixel = (scale * away) / camera.height;
      this.#writer.set("cursors", [x, y, cursor.radiusPx * pixel, 1.6 * pixel, ...cursor.colour], i * 8);
    });
    this.#writer.set("cursor_count", shown.length);
  }
}

/** Where the block's foot lies: steps with the relief, so that it does not creep while somebody draws. */
export function baseHeight(low: number, sizeM: number): number {
  const step = sizeM / 32;
  return Math.floor((low - 0.02 * sizeM) / step) * step;
}

function smoothstep(a: number, b: number, v: number): number {
  const t = Math.min(1, Math.max(0, (v - a) / (b - a)));
  return t * t * (3 - 2 * t);
}
