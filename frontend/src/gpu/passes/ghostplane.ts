/** The plane that is being drawn on (shaders/wgsl/marks/ghost.wgsl). */

import type { GhostVisual } from "../../core/types.ts";
import { SOURCES } from "../shaders.ts";
import { createPass, GrowingBuffer, type PassContext } from "./pipeline.ts";

const FLOATS = 16;

export class GhostPass {
  readonly #buffer: GrowingBuffer;
  #vertices: GPUBuffer | null = null;

  readonly #pipeline: GPURenderPipeline;

  private constructor(device: GPUDevice, pipeline: GPURenderPipeline) {
    this.#pipeline = pipeline;
    this.#buffer = new GrowingBuffer(device, "ghost");
  }

  static async create(context: PassContext): Promise<GhostPass> {
    const corner = (shaderLocation: number): GPUVertexAttribute => ({
      shaderLocation,
      offset: shaderLocation * 12,
      format: "float32x3",
    });
    const pipeline = await createPass(context, {
      label: "ghost",
      code: SOURCES.ghost,
      vertex: "ghost_vertex",
      fragment: "ghost_fragment",
      buffers: [
        {
          arrayStride: FLOATS * 4,
          stepMode: "instance",
          attributes: [
            corner(0),
            corner(1),
            corner(2),
            corner(3),
            { shaderLocation: 4, offset: 48, format: "float32x4" },
          ],
        },
      ],
      blend: true,
      depthWrite: false,
    });
    return new GhostPass(context.device, pipeline);
  }

  update(ghost: GhostVisual | null): void {
    this.#vertices =
      ghost === null ? null : this.#buffer.write(new Float32Array([...ghost.corners.flat(), ...ghost.colour]), FLOATS);
  }

  draw(pass: GPURenderPassEncoder): void {
    if (this.#vertices === null) return;
    pass.setPipeline(this.#pipeline);
    pass.setVertexBuffer(0, this.#vertices);
    pass.draw(6, 1);
  }

  destroy(): void {
    this.#buffer.destroy();
  }
}
