/** Settings that the passes' pipelines share. */

import type { Detail } from "../shaders.ts";
import { DEPTH_FORMAT } from "../target.ts";

/** Where and how finely passes draw. */
export interface PassContext {
  readonly device: GPUDevice;
  readonly frameLayout: GPUBindGroupLayout;
  readonly format: GPUTextureFormat;
  readonly samples: number;
  readonly detail: Detail;
}

export interface PassOptions {
  readonly label: string;
  readonly code: string;
  readonly vertex: string;
  readonly fragment: string;
  readonly buffers?: readonly GPUVertexBufferLayout[];
  readonly vertexConstants?: Readonly<Record<string, number>>;
  readonly fragmentConstants?: Readonly<Record<string, number>>;
  readonly topology?: GPUPrimitiveTopology;
  readonly blend?: boolean;
  readonly depthCompare?: GPUCompareFunction;
  readonly depthWrite?: boolean;
  /** Bind groups after the frame's. */
  readonly groups?: readonly GPUBindGroupLayout[];
}

const OVER: GPUBlendState = {
  color: { srcFactor: "src-alpha", dstFactor: "one-minus-src-alpha" },
  alpha: { srcFactor: "one", dstFactor: "one-minus-src-alpha" },
};

export function createPass(context: PassContext, options: PassOptions): Promise<GPURenderPipeline> {
  return context.device.createRenderPipelineAsync(describePass(context, options));
}

export function describePass(context: PassContext, options: PassOptions): GPURenderPipelineDescriptor {
  const { device } = context;
  const module = device.createShaderModule({ label: options.label, code: options.code });
  return {
    label: options.label,
    layout: device.createPipelineLayout({ bindGroupLayouts: [context.frameLayout, ...(options.groups ?? [])] }),
    vertex: {
      module,
      entryPoint: options.vertex,
      buffers: [...(options.buffers ?? [])],
      constants: { ...options.vertexConstants },
    },
    fragment: {
      module,
      entryPoint: options.fragment,
      constants: { ...options.fragmentConstants },
      targets: [options.blend === true ? { format: context.format, blend: OVER } : { format: context.format }],
    },
    primitive: { topology: options.topology ?? "triangle-list", cullMode: "none" },
    depthStencil: {
      format: DEPTH_FORMAT,
      depthWriteEnabled: options.depthWrite ?? true,
      depthCompare: options.depthCompare ?? "greater",
    },
    multisample: { count: context.samples },
  };
}

/** A vertex buffer that grows, which kernels may read too; contents are written whole. */
export class GrowingBuffer {
  #buffer: GPUBuffer | null = null;

  readonly #device: GPUDevice;
  readonly #label: string;

  constructor(device: GPUDevice, label: string) {
    this.#device = device;
    this.#label = label;
  }

  /** Uploads `data` (its first `words` 4-byte elements) and returns the buffer. */
  write(data: Uint32Array | Float32Array, words: number): GPUBuffer {
    const bytes = Math.max(16, words * 4);
    if (this.#buffer === null || this.#buffer.size < bytes) {
      this.#buffer?.destroy();
      this.#buffer = this.#device.createBuffer({
        label: this.#label,
        size: 2 ** Math.ceil(Math.log2(bytes)),
        usage: GPUBufferUsage.VERTEX | GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST,
      });
    }
    if (words > 0)
      this.#device.queue.writeBuffer(this.#buffer, 0, data.buffer as ArrayBuffer, data.byteOffset, words * 4);
    return this.#buffer;
  }

  destroy(): void {
    this.#buffer?.destroy();
    this.#buffer = null;
  }
}
