/**
 * Per-tile compute: gradients when the heights change, sun and sky visibility when ground or sun change. Both work on a
 * list of slots in one dispatch.
 */

import type { Vec3 } from "../../core/types.ts";
import { TILE_SAMPLES } from "../../generated/contract.ts";
import { SOURCES } from "../shaders.ts";
import { type Atlas, MAX_SLOTS } from "./atlas.ts";

/** Tangent of half the angle over which a shadow's edge softens: wider than the sun's disc, as air and grass blur it. */
const PENUMBRA = 0.02;
const GROUPS = Math.ceil((TILE_SAMPLES + 2) / 8);
const JOB_WORDS = 4;

export interface SlotJob {
  readonly slot: number;
  readonly level: number;
  readonly x: number;
  readonly y: number;
}

class JobPass {
  #group: GPUBindGroup | null = null;
  readonly #buffer: GPUBuffer;
  protected readonly words: Uint32Array<ArrayBuffer>;
  protected readonly floats: Float32Array<ArrayBuffer>;

  readonly #device: GPUDevice;
  readonly #pipeline: GPUComputePipeline;
  readonly #label: string;

  constructor(
    device: GPUDevice,
    pipeline: GPUComputePipeline,
    label: string,
    protected readonly headWords: number,
  ) {
    this.#device = device;
    this.#pipeline = pipeline;
    this.#label = label;
    this.words = new Uint32Array(headWords + JOB_WORDS * MAX_SLOTS);
    this.floats = new Float32Array(this.words.buffer);
    this.#buffer = device.createBuffer({
      label,
      size: this.words.byteLength,
      usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST,
    });
  }

  protected bind(entries: GPUBindGroupEntry[]): void {
    this.#group = this.#device.createBindGroup({
      label: this.#label,
      layout: this.#pipeline.getBindGroupLayout(0),
      entries: [{ binding: 0, resource: { buffer: this.#buffer } }, ...entries],
    });
  }

  protected dispatch(encoder: GPUCommandEncoder, jobs: readonly SlotJob[]): void {
    if (jobs.length === 0 || this.#group === null) return;
    this.words[1] = jobs.length;
    jobs.forEach((job, i) => {
      this.words.set([job.slot, job.level, job.x, job.y], this.headWords + JOB_WORDS * i);
    });
    this.#device.queue.writeBuffer(this.#buffer, 0, this.words, 0, this.headWords + JOB_WORDS * jobs.length);
    const pass = encoder.beginComputePass({ label: this.#label });
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, this.#group);
    pass.dispatchWorkgroups(GROUPS, GROUPS, jobs.length);
    pass.end();
  }

  destroy(): void {
    this.#buffer.destroy();
  }
}

/** A shorter march where the device computes on the CPU. */
const SOFTWARE_MARCH = { SUN_STEPS: 32, SUN_GROWTH: 0.18, SKY_DIRECTIONS: 5, SKY_STEPS: 4 };

function pipeline(
  device: GPUDevice,
  code: string,
  entryPoint: string,
  constants: Record<string, number> = {},
): Promise<GPUComputePipeline> {
  const module = device.createShaderModule({ label: entryPoint, code });
  return device.createComputePipelineAsync({
    label: entryPoint,
    layout: "auto",
    compute: { module, entryPoint, constants },
  });
}

export class NormalsPass extends JobPass {
  static async create(device: GPUDevice): Promise<NormalsPass> {
    return new NormalsPass(device, await pipeline(device, SOURCES.normals, "compute_normals"), "normals", 4);
  }

  attach(atlas: Atlas): void {
    this.bind([
      { binding: 1, resource: atlas.heights.createView({ dimension: "2d-array" }) },
      { binding: 2, resource: atlas.slopes.createView({ dimension: "2d-array" }) },
    ]);
  }

  /** Fills the gradients of these slots. */
  run(encoder: GPUCommandEncoder, sizeM: number, jobs: readonly SlotJob[]): void {
    this.floats[0] = sizeM;
    this.dispatch(encoder, jobs);
  }
}

export class SunPass extends JobPass {
  static async create(device: GPUDevice, software: boolean): Promise<SunPass> {
    const constants = software ? SOFTWARE_MARCH : {};
    return new SunPass(device, await pipeline(device, SOURCES.sun, "compute_sun", constants), "sun", 8);
  }

  attach(atlas: Atlas): void {
    this.bind([
      { binding: 1, resource: atlas.heights.createView({ dimension: "2d-array" }) },
      { binding: 2, resource: { buffer: atlas.pages } },
      { binding: 3, resource: atlas.light.createView({ dimension: "2d-array" }) },
    ]);
  }

  /** Fills sun and sky visibility of these slots. `high`: highest ground, metres. */
  run(encoder: GPUCommandEncoder, sizeM: number, high: number, sun: Vec3, jobs: readonly SlotJob[]): void {
    this.floats[0] = sizeM;
    this.floats[2] = high;
    this.floats.set([...sun, PENUMBRA], 4);
    this.dispatch(encoder, jobs);
  }
}
