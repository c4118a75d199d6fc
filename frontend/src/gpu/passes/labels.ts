/** Heights on the index contours while the contour overlay is shown (tiles/contourlabels.ts, shaders/wgsl/marks/label.wgsl). */

import type { CameraState, Scene } from "../../core/types.ts";
import { type ContourLabel, contourLabels } from "../../tiles/contourlabels.ts";
import { INDEX_EVERY } from "../../tiles/flat.ts";
import { contourInterval } from "../looks.ts";
import { SOURCES } from "../shaders.ts";
import { createPass, GrowingBuffer, type PassContext } from "./pipeline.ts";

/** The letters of the glyph texture, in order. */
export const LETTERS = "0123456789−. m";
const CELLS = 16;
const CELL = { width: 36, height: 48 } as const;
/** Advance from letter to letter, and of the space before the unit, in heights of a letter. */
const ADVANCE = 0.5;
const SPACE = 0.22;
const FLOATS = 8;
/** Height of a letter's cell in CSS pixels. */
const SIZE_PX = 20;

export class LabelPass {
  readonly #buffer: GrowingBuffer;
  #vertices: GPUBuffer | null = null;
  #count = 0;
  #camera: CameraState | null = null;
  #stamp = -1;
  #everyM = 0;
  #size = 0;

  readonly #pipeline: GPURenderPipeline;
  readonly #glyphs: GPUTexture;
  readonly #group: GPUBindGroup;

  private constructor(pipeline: GPURenderPipeline, glyphs: GPUTexture, group: GPUBindGroup, device: GPUDevice) {
    this.#pipeline = pipeline;
    this.#glyphs = glyphs;
    this.#group = group;
    this.#buffer = new GrowingBuffer(device, "labels");
  }

  static async create(context: PassContext): Promise<LabelPass> {
    const { device } = context;
    const layout = device.createBindGroupLayout({
      label: "letters",
      entries: [{ binding: 0, visibility: GPUShaderStage.FRAGMENT, texture: {} }],
    });
    const float4 = (shaderLocation: number): GPUVertexAttribute => ({
      shaderLocation,
      offset: 16 * shaderLocation,
      format: "float32x4",
    });
    const pipeline = await createPass(context, {
      label: "labels",
      code: SOURCES.label,
      vertex: "label_vertex",
      fragment: "label_fragment",
      groups: [layout],
      topology: "triangle-strip",
      buffers: [{ arrayStride: 4 * FLOATS, stepMode: "instance", attributes: [float4(0), float4(1)] }],
      blend: true,
      depthWrite: false,
    });
    const glyphs = glyphTexture(device);
    const group = device.createBindGroup({ layout, entries: [{ binding: 0, resource: glyphs.createView() }] });
    return new LabelPass(pipeline, glyphs, group, device);
  }

  /**
   * Places the labels for this frame. `reliefM`: of what is drawn, as the lines take it; `pixels`: drawn pixels per CSS
   * pixel; `scale`: drawn pixels per canvas pixel.
   */
  update(scene: Scene, reliefM: number, pixels: number, scale: number): void {
    if (scene.overlay !== "contours") {
      this.#count = 0;
      this.#camera = null;
      return;
    }
    const everyM = INDEX_EVERY * (scene.contourM || contourInterval(reliefM));
    const { camera, tiles } = scene;
    const size = SIZE_PX * (scene.lineScale ?? 1);
    if (this.#camera === camera && this.#stamp === tiles.stamp && this.#everyM === everyM && this.#size === size)
      return;
    [this.#camera, this.#stamp, this.#everyM, this.#size] = [camera, tiles.stamp, everyM, size];
    const labels = contourLabels(tiles, camera, { everyM, sizePx: (size * pixels) / scale });
    const data = letterInstances(labels, camera, size * pixels);
    this.#count = data.length / FLOATS;
    this.#vertices = this.#buffer.write(data, data.length);
  }

  draw(pass: GPURenderPassEncoder): void {
    if (this.#count === 0) return;
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(1, this.#group);
    pass.setVertexBuffer(0, this.#vertices);
    pass.draw(4, this.#count);
  }

  destroy(): void {
    this.#buffer.destroy();
    this.#glyphs.destroy();
  }
}

/** One instance per letter (`LabelIn` in marks/label.wgsl); places relative to the eye, subtracted in float64. */
export function letterInstances(
  labels: readonly ContourLabel[],
  camera: CameraState,
  sizePx: number,
): Float32Array<ArrayBuffer> {
  const out: number[] = [];
  for (const label of labels) {
    const steps = [...label.text].map((letter) => (letter === " " ? SPACE : ADVANCE));
    let at = -0.5 * steps.reduce((a, b) => a + b, 0);
    [...label.text].forEach((letter, i) => {
      const cell = LETTERS.indexOf(letter);
      const middle = at + 0.5 * steps[i]!;
      at += steps[i]!;
      if (letter === " " || cell < 0) return;
      out.push(label.x - camera.eye[0], label.y - camera.eye[1], label.z - camera.eye[2], middle * sizePx);
      out.push(label.dx, label.dy, cell, sizePx);
    });
  }
  return Float32Array.from(out);
}

/** The letters drawn once: red the letter, green the letter with its halo. */
function glyphTexture(device: GPUDevice): GPUTexture {
  const canvas = new OffscreenCanvas(CELLS * CELL.width, CELL.height);
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  context.font = `600 ${Math.round(0.66 * CELL.height)}px Inter, system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineJoin = "round";
  context.lineWidth = 0.2 * CELL.height;
  context.globalCompositeOperation = "lighter";
  [...LETTERS].forEach((letter, i) => {
    const [x, y] = [(i + 0.5) * CELL.width, 0.52 * CELL.height];
    context.fillStyle = "#0f0";
    context.strokeStyle = "#0f0";
    context.strokeText(letter, x, y);
    context.fillText(letter, x, y);
    context.fillStyle = "#f00";
    context.fillText(letter, x, y);
  });
  const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  const texture = device.createTexture({
    label: "letters",
    format: "rgba8unorm",
    size: [canvas.width, canvas.height],
    usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
  });
  device.queue.writeTexture({ texture }, data as Uint8ClampedArray<ArrayBuffer>, { bytesPerRow: 4 * canvas.width }, [
    canvas.width,
    canvas.height,
  ]);
  return texture;
}
