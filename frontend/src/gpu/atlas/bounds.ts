/**
 * Bounds of synthesised ground for the selection: a reduction on the device, read back in batches and never waited for
 * (DESIGN 10; paper 1, section 3.3). Shader: tiles/bounds.wgsl.
 */

import { SUBPATCHES } from "../../generated/contract.ts";
import { SOURCES } from "../shaders.ts";

/** Per sub-patch: lowest and highest height, error against the parent's surface, error that children may add; metres. */
export const BOUND_VALUES = 4;
/** Numbers of one tile: sub-patches row by row from the south-west. */
export const TILE_BOUNDS: number = SUBPATCHES * SUBPATCHES * BOUND_VALUES;

/** The fields of a job that the pass reads. The job itself comes back with the answer. */
export interface BoundsJob {
  readonly slot: number;
  readonly level: number;
  readonly x: number;
  readonly y: number;
  /** Slot of the parent; any number on level 0. */
  readonly parentSlot: number;
}

export interface BoundsAtlas {
  readonly heights: GPUTexture;
  readonly attributes1: GPUTexture;
}

interface Batch<Job> {
  readonly jobs: readonly Job[];
  readonly staging: GPUBuffer;
}

const JOB_WORDS = 8;
const HEAD_WORDS = 4;

export class BoundsPass<Job extends BoundsJob> {
  readonly #free: GPUBuffer[] = [];
  #encoded: Batch<Job>[] = [];
  readonly #list: GPUBuffer;
  readonly #results: GPUBuffer;
  readonly #words: Uint32Array<ArrayBuffer>;
  #group: GPUBindGroup | null = null;
  #destroyed = false;

  readonly #device: GPUDevice;
  readonly #pipeline: GPUComputePipeline;
  readonly #answer: (jobs: readonly Job[], bounds: Float32Array) => void;
  readonly #most: number;

  private constructor(
    device: GPUDevice,
    pipeline: GPUComputePipeline,
    answer: (jobs: readonly Job[], bounds: Float32Array) => void,
    most: number,
  ) {
    this.#device = device;
    this.#pipeline = pipeline;
    this.#answer = answer;
    this.#most = most;
    this.#words = new Uint32Array(HEAD_WORDS + JOB_WORDS * most);
    const { COPY_DST, COPY_SRC, STORAGE } = GPUBufferUsage;
    const size = this.#words.byteLength;
    this.#list = device.createBuffer({ label: "bounds jobs", size, usage: STORAGE | COPY_DST });
    this.#results = device.createBuffer({ label: "bounds", size: this.#bytes(most), usage: STORAGE | COPY_SRC });
  }

  /**
   * `answer`: called once per batch, frames later, with its jobs and TILE_BOUNDS numbers for each. Slots may have other tiles by
   * then: it compares. `most`: tiles of one batch.
   */
  static async create<Job extends BoundsJob>(
    device: GPUDevice,
    answer: (jobs: readonly Job[], bounds: Float32Array) => void,
    most = 1024,
  ): Promise<BoundsPass<Job>> {
    const module = device.createShaderModule({ label: "bounds", code: SOURCES.bounds });
    const compute = { module, entryPoint: "compute_bounds" };
    const pipeline = await device.createComputePipelineAsync({ label: "bounds", layout: "auto", compute });
    return new BoundsPass(device, pipeline, answer, most);
  }

  /** Works on this atlas from now on; answers to batches of the old one still come. */
  attach(atlas: BoundsAtlas): void {
    this.#group = this.#device.createBindGroup({
      label: "bounds",
      layout: this.#pipeline.getBindGroupLayout(0),
      entries: [
        { binding: 0, resource: { buffer: this.#list } },
        { binding: 1, resource: atlas.heights.createView({ dimension: "2d-array" }) },
        { binding: 2, resource: atlas.attributes1.createView({ dimension: "2d-array" }) },
        { binding: 3, resource: { buffer: this.#results } },
      ],
    });
  }

  /** Measures these tiles, after all passes of the encoder that make heights. Once per encoder; at most `most` tiles. */
  run(encoder: GPUCommandEncoder, sizeM: number, jobs: readonly Job[]): void {
    if (jobs.length === 0 || this.#group === null) return;
    if (jobs.length > this.#most)
      throw new RangeError(`${jobs.length} tiles to measure at once: at most ${this.#most}`);
    new Float32Array(this.#words.buffer)[0] = sizeM;
    jobs.forEach((job, i) => {
      this.#words.set([job.slot, job.level, job.x, job.y, job.parentSlot], HEAD_WORDS + JOB_WORDS * i);
    });
    this.#device.queue.writeBuffer(this.#list, 0, this.#words, 0, HEAD_WORDS + JOB_WORDS * jobs.length);
    const pass = encoder.beginComputePass({ label: "bounds" });
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, this.#group);
    pass.dispatchWorkgroups(jobs.length);
    pass.end();
    const staging = this.#free.pop() ?? this.#makeStaging();
    encoder.copyBufferToBuffer(this.#results, 0, staging, 0, this.#bytes(jobs.length));
    this.#encoded.push({ jobs: [...jobs], staging });
  }

  /** To be called when the encoder has been submitted: starts the read-back. */
  submitted(): void {
    const batches = this.#encoded;
    this.#encoded = [];
    for (const batch of batches) void this.#read(batch);
  }

  destroy(): void {
    this.#destroyed = true;
    for (const buffer of [this.#list, this.#results, ...this.#free]) buffer.destroy();
  }

  async #read({ jobs, staging }: Batch<Job>): Promise<void> {
    try {
      await staging.mapAsync(GPUMapMode.READ, 0, this.#bytes(jobs.length));
    } catch {
      // The device was lost or closed: whoever notices makes another renderer.
      return;
    }
    if (this.#destroyed) {
      staging.destroy();
      return;
    }
    const bounds = new Float32Array(staging.getMappedRange(0, this.#bytes(jobs.length)).slice(0));
    staging.unmap();
    this.#free.push(staging);
    this.#answer(jobs, bounds);
  }

  #makeStaging(): GPUBuffer {
    const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
    return this.#device.createBuffer({ label: "bounds read-back", size: this.#bytes(this.#most), usage });
  }

  #bytes(jobs: number): number {
    return 4 * TILE_BOUNDS * jobs;
  }
}
