/**
 * Trees, rocks and tufts: found on the device for each picture, one workgroup a patch and kind, and drawn by indirect draws
 * (shaders/wgsl/instances/). Where they stand is a function of the place alone.
 */

import {
  MAX_SYNTHESIS_LEVEL,
  MOST_FAR_TREES,
  MOST_NEAR_TREES,
  MOST_ROCKS,
  MOST_TUFTS,
  SOIL_M,
  TILE_CELLS,
  TREE_NEAR_M,
} from "../../generated/contract.ts";
import type { Atlas } from "../atlas/atlas.ts";
import { SOURCES } from "../shaders.ts";
import { createPass, type PassContext } from "./pipeline.ts";

/** Shapes in the order of the kernel: entry points, vertices of one, and how many a picture may have. */
const SORTS = [
  { name: "tree", vertices: 336, most: MOST_NEAR_TREES },
  { name: "impostor", vertices: 6, most: MOST_FAR_TREES },
  { name: "rock", vertices: 96, most: MOST_ROCKS },
  { name: "tuft", vertices: 45, most: MOST_TUFTS },
] as const;
const KINDS = 3;
const DRAW_WORDS = 4;
/** Bytes of one instance: three vectors. */
const STRIDE = 48;

const LAYOUT: GPUVertexBufferLayout = {
  arrayStride: STRIDE,
  stepMode: "instance",
  attributes: [0, 1, 2].map((k) => ({ shaderLocation: k, offset: 16 * k, format: "float32x4" })),
};

/** The level on which the channels count, whatever level is drawn: none comes or goes as tiles refine. */
export function soilLevel(sizeM: number): number {
  return Math.min(Math.max(Math.round(Math.log2(sizeM / (TILE_CELLS * SOIL_M))), 0), MAX_SYNTHESIS_LEVEL);
}

/** Patches of a cut on the device. */
export interface PatchRecords {
  readonly buffer: GPUBuffer | null;
  readonly count: number;
}

export class InstancePass {
  readonly #device: GPUDevice;
  readonly #layout: GPUBindGroupLayout;
  readonly #scatter: GPUComputePipeline;
  readonly #close: GPUComputePipeline;
  readonly #pipelines: readonly GPURenderPipeline[];
  readonly #turn: GPUBuffer;
  readonly #found: GPUBuffer;
  readonly #draws: GPUBuffer;
  readonly #none: Uint32Array<ArrayBuffer>;
  #atlas: Atlas | null = null;
  #records: GPUBuffer | null = null;
  #group: GPUBindGroup | null = null;
  #any = false;

  private constructor(
    device: GPUDevice,
    layout: GPUBindGroupLayout,
    compute: readonly [GPUComputePipeline, GPUComputePipeline],
    pipelines: readonly GPURenderPipeline[],
  ) {
    this.#device = device;
    this.#layout = layout;
    [this.#scatter, this.#close] = compute;
    this.#pipelines = pipelines;
    const make = (label: string, size: number, usage: number): GPUBuffer =>
      device.createBuffer({ label: `instances ${label}`, size, usage: usage | GPUBufferUsage.COPY_DST });
    this.#turn = make("turn", 16, GPUBufferUsage.UNIFORM);
    const room = SORTS.reduce((sum, { most }) => sum + most, 0);
    this.#found = make(
      "found",
      STRIDE * room,
      GPUBufferUsage.STORAGE | GPUBufferUsage.VERTEX | GPUBufferUsage.COPY_SRC,
    );
    this.#none = Uint32Array.from(SORTS.flatMap(({ vertices }) => [vertices, 0, 0, 0]));
    this.#draws = make(
      "draws",
      this.#none.byteLength,
      GPUBufferUsage.STORAGE | GPUBufferUsage.INDIRECT | GPUBufferUsage.COPY_SRC,
    );
  }

  static async create(context: PassContext): Promise<InstancePass> {
    const { device, frameLayout } = context;
    const visibility = GPUShaderStage.COMPUTE;
    const types: readonly GPUBufferBindingType[] = [
      "uniform",
      "read-only-storage",
      "read-only-storage",
      "storage",
      "storage",
    ];
    const layout = device.createBindGroupLayout({
      label: "instances",
      entries: types.map((type, binding) => ({ binding, visibility, buffer: { type } })),
    });
    const module = device.createShaderModule({ label: "scatter", code: SOURCES.scatter });
    const compute = (entryPoint: string): Promise<GPUComputePipeline> =>
      device.createComputePipelineAsync({
        label: entryPoint,
        layout: device.createPipelineLayout({ bindGroupLayouts: [frameLayout, layout] }),
        compute: { module, entryPoint },
      });
    const [scatter, close, ...pipelines] = await Promise.all([
      compute("scatter"),
      compute("close"),
      ...SORTS.map(({ name }) =>
        createPass(context, {
          label: name,
          code: SOURCES.instances,
          vertex: `${name}_vertex`,
          fragment: `${name}_fragment`,
          buffers: [LAYOUT],
        }),
      ),
    ] as const);
    return new InstancePass(device, layout, [scatter, close], pipelines as readonly GPURenderPipeline[]);
  }

  /** Finds what stands on the patches of a cut. Without an atlas of theirs nothing does. */
  find(encoder: GPUCommandEncoder, frame: GPUBindGroup, atlas: Atlas, records: PatchRecords, sizeM: number): void {
    this.#any = records.buffer !== null && records.count > 0;
    if (records.buffer === null || records.count === 0) return;
    this.#bind(atlas, records.buffer);
    const turn = new Uint32Array([records.count, soilLevel(sizeM), 0, 0]);
    new Float32Array(turn.buffer)[2] = TREE_NEAR_M;
    this.#device.queue.writeBuffer(this.#turn, 0, turn);
    this.#device.queue.writeBuffer(this.#draws, 0, this.#none);
    const pass = encoder.beginComputePass({ label: "scatter" });
    pass.setBindGroup(0, frame);
    pass.setBindGroup(1, this.#group);
    pass.setPipeline(this.#scatter);
    pass.dispatchWorkgroups(records.count, KINDS);
    pass.setPipeline(this.#close);
    pass.dispatchWorkgroups(1);
    pass.end();
  }

  /** Draws what was found. */
  draw(pass: GPURenderPassEncoder): void {
    if (!this.#any) return;
    let first = 0;
    SORTS.forEach(({ most }, k) => {
      pass.setPipeline(this.#pipelines[k]!);
      pass.setVertexBuffer(0, this.#found, STRIDE * first, STRIDE * most);
      pass.drawIndirect(this.#draws, 4 * DRAW_WORDS * k);
      first += most;
    });
  }

  /** Buffers that tests read back. */
  get state(): { readonly found: GPUBuffer; readonly draws: GPUBuffer } {
    return { found: this.#found, draws: this.#draws };
  }

  destroy(): void {
    for (const buffer of [this.#turn, this.#found, this.#draws]) buffer.destroy();
  }

  #bind(atlas: Atlas, records: GPUBuffer): void {
    if (this.#atlas === atlas && this.#records === records) return;
    this.#atlas = atlas;
    this.#records = records;
    const buffers = [this.#turn, records, atlas.pages, this.#found, this.#draws];
    this.#group = this.#device.createBindGroup({
      label: "instances",
      layout: this.#layout,
      entries: buffers.map((buffer, binding) => ({ binding, resource: { buffer } })),
    });
  }
}
