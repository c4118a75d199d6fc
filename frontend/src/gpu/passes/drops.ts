/** Drops of rain as small discs on the ground (shaders/wgsl/water/drops.wgsl). */

import type { DropsVisual } from "../../core/types.ts";
import { SOURCES } from "../shaders.ts";
import { createPass, GrowingBuffer, type PassContext } from "./pipeline.ts";

const FLOATS = 4;

export class DropPass {
  readonly #buffer: GrowingBuffer;
  readonly #pipeline: GPURenderPipeline;
  #vertices: GPUBuffer | null = null;
  #count = 0;
  #stamp = -1;

  private constructor(device: GPUDevice, pipeline: GPURenderPipeline) {
    this.#pipeline = pipeline;
    this.#buffer = new GrowingBuffer(device, "drops");
  }

  static async create(context: PassContext): Promise<DropPass> {
    const pipeline = await createPass(context, {
      label: "drops",
      code: SOURCES.drops,
      vertex: "drop_vertex",
      fragment: "drop_fragment",
      buffers: [
        {
          arrayStride: 4 * FLOATS,
          stepMode: "instance",
          attributes: [{ shaderLocation: 0, offset: 0, format: "float32x4" }],
        },
      ],
      topology: "triangle-strip",
      blend: true,
      depthWrite: false,
      depthCompare: "greater-equal",
    });
    return new DropPass(context.device, pipeline);
  }

  update(drops: DropsVisual | null): void {
    this.#count = drops?.count ?? 0;
    if (drops === null || drops.stamp === this.#stamp) return;
    this.#stamp = drops.stamp;
    this.#vertices = this.#buffer.write(drops.data, FLOATS * drops.count);
  }

  draw(pass: GPURenderPassEncoder): void {
    if (this.#count === 0 || this.#vertices === null) return;
    pass.setPipeline(this.#pipeline);
    pass.setVertexBuffer(0, this.#vertices);
    pass.draw(4, this.#count);
  }

  destroy(): void {
    this.#buffer.destroy();
  }
}
