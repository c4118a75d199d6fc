/** Sky, and the plane or sea around the block (shaders/wgsl/sky/background.wgsl). */

import { sceneSource } from "../shaders.ts";
import { createPass, type PassContext } from "./pipeline.ts";

export class BackgroundPass {
  readonly #pipeline: GPURenderPipeline;
  readonly #openSea: GPURenderPipeline;

  private constructor(pipeline: GPURenderPipeline, openSea: GPURenderPipeline) {
    this.#pipeline = pipeline;
    this.#openSea = openSea;
  }

  static async create(context: PassContext): Promise<BackgroundPass> {
    const [sky, openSea] = await Promise.all([
      createPass(context, {
        label: "background",
        code: sceneSource("background", context.detail),
        vertex: "background_vertex",
        fragment: "background_fragment",
        depthCompare: "greater-equal",
        depthWrite: false,
      }),
      createPass(context, {
        label: "open sea",
        code: sceneSource("background", context.detail),
        vertex: "open_sea_vertex",
        fragment: "open_sea_fragment",
      }),
    ]);
    return new BackgroundPass(sky, openSea);
  }

  /** `sea`: with the open sea around the domain. */
  draw(pass: GPURenderPassEncoder, sea: boolean): void {
    if (sea) {
      pass.setPipeline(this.#openSea);
      pass.draw(24);
    }
    pass.setPipeline(this.#pipeline);
    pass.draw(3);
  }
}
