/** Colour and depth attachments, multisampled on real GPUs, and the stretch to the canvas when drawn smaller. */

import blit from "@shaders/wgsl/blit.wgsl?raw";

/** Depth is reversed, 1 near and 0 far (core/camera/projection.ts): floats then hold it equally well everywhere. */
export const DEPTH_FORMAT = "depth32float" as const;

export class Target {
  #depth: GPUTexture | null = null;
  #multisampled: GPUTexture | null = null;
  #scaled: GPUTexture | null = null;
  #blitGroup: GPUBindGroup | null = null;
  readonly #sampler: GPUSampler;
  #key = "";

  readonly #device: GPUDevice;
  readonly #format: GPUTextureFormat;
  readonly #readDepth: boolean;
  readonly #blitPipeline: GPURenderPipeline;

  private constructor(
    device: GPUDevice,
    format: GPUTextureFormat,
    readonly samples: number,
    readDepth: boolean,
    blitPipeline: GPURenderPipeline,
  ) {
    this.#device = device;
    this.#format = format;
    this.#readDepth = readDepth;
    this.#blitPipeline = blitPipeline;
    this.#sampler = device.createSampler({ magFilter: "linear", minFilter: "linear" });
  }

  /** `readDepth`: shaders read the depth between two passes. */
  static async create(
    device: GPUDevice,
    format: GPUTextureFormat,
    samples: number,
    readDepth = false,
  ): Promise<Target> {
    const module = device.createShaderModule({ label: "blit", code: blit });
    const pipeline = await device.createRenderPipelineAsync({
      label: "blit",
      layout: "auto",
      vertex: { module },
      fragment: { module, targets: [{ format }] },
    });
    return new Target(device, format, samples, readDepth, pipeline);
  }

  /**
   * Attachments for a frame of `width` x `height` pixels shown on `canvas`. When the sizes differ, `finish` stretches the
   * picture. `part`: a frame is drawn in one pass, or in two with a look at the depth between them.
   */
  begin(
    canvas: GPUTexture,
    width: number,
    height: number,
    part: "whole" | "first" | "second" = "whole",
  ): GPURenderPassDescriptor {
    this.#resize(canvas, width, height);
    const resolved = (this.#scaled ?? canvas).createView();
    const loadOp = part === "second" ? "load" : "clear";
    const goesOn = part === "first";
    const colour: GPURenderPassColorAttachment = {
      view: this.#multisampled === null ? resolved : this.#multisampled.createView(),
      clearValue: [0, 0, 0, 1],
      loadOp,
      storeOp: this.#multisampled === null || goesOn ? "store" : "discard",
    };
    if (this.#multisampled !== null && !goesOn) colour.resolveTarget = resolved;
    return {
      label: "scene",
      colorAttachments: [colour],
      depthStencilAttachment: {
        view: this.#depth!.createView(),
        depthClearValue: 0,
        depthLoadOp: loadOp,
        depthStoreOp: goesOn ? "store" : "discard",
      },
    };
  }

  /** Depth of the picture, between its two passes. */
  get depthView(): GPUTextureView {
    return this.#depth!.createView();
  }

  finish(encoder: GPUCommandEncoder, canvas: GPUTexture): void {
    if (this.#scaled === null) return;
    const pass = encoder.beginRenderPass({
      label: "blit",
      colorAttachments: [{ view: canvas.createView(), loadOp: "clear", storeOp: "store" }],
    });
    pass.setPipeline(this.#blitPipeline);
    pass.setBindGroup(0, this.#blitGroup);
    pass.draw(3);
    pass.end();
  }

  destroy(): void {
    for (const texture of [this.#depth, this.#multisampled, this.#scaled]) texture?.destroy();
    this.#key = "";
  }

  #resize(canvas: GPUTexture, width: number, height: number): void {
    const key = `${canvas.width} ${canvas.height} ${width} ${height}`;
    if (key === this.#key) return;
    this.destroy();
    this.#key = key;
    const usage = GPUTextureUsage.RENDER_ATTACHMENT;
    const make = (label: string, format: GPUTextureFormat, sampleCount: number, more = 0): GPUTexture =>
      this.#device.createTexture({ label, format, sampleCount, size: [width, height], usage: usage | more });
    this.#depth = make("depth", DEPTH_FORMAT, this.samples, this.#readDepth ? GPUTextureUsage.TEXTURE_BINDING : 0);
    this.#multisampled = this.samples > 1 ? make("colour", this.#format, this.samples) : null;
    this.#scaled = null;
    if (width !== canvas.width || height !== canvas.height) {
      this.#scaled = make("scaled", this.#format, 1, GPUTextureUsage.TEXTURE_BINDING);
      this.#blitGroup = this.#device.createBindGroup({
        layout: this.#blitPipeline.getBindGroupLayout(0),
        entries: [
          { binding: 0, resource: this.#scaled.createView() },
          { binding: 1, resource: this.#sampler },
        ],
      });
    }
  }
}
