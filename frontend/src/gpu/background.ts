/** Sky, and the plane or sea around the block (shaders/wgsl/background.wgsl). */

import { createPass, type PassContext } from "./pipeline.ts";
import { SOURCES } from "./shaders.ts";

export class BackgroundPass {
  private constructor(private readonly pipeline: GPURenderPipeline) {}

  static async create(context: PassContext): Promise<BackgroundPass> {
    return new BackgroundPass(
      await createPass(context, {
        label: "background",
        code: SOURCES.background,
        vertex: "background_vertex",
        fragment: "background_fragment",
        depthCompare: "less-equal",
        depthWrite: false,
      }),
    );
  }

  draw(pass: GPURenderPassEncoder): void {
    pass.setPipeline(this.pipeline);
    pass.draw(3);
  }
}
