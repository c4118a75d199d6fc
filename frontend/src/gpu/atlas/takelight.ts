/** Light of synthetic tiles taken over from their parents: for devices on which the march costs too much. */

import { TILE_SAMPLES } from "../../generated/contract.ts";
import { SOURCES } from "../shaders.ts";
import { SLOT_TEXELS } from "./apron.ts";
import { type Atlas, MAX_SLOTS, type Resident, SLOTS_ACROSS, SLOTS_PER_LAYER } from "./atlas.ts";

const JOB_WORDS = 4;
const GROUPS = Math.ceil((TILE_SAMPLES + 2) / 8);
/** Jobs of one dispatch begin at a multiple of this: 256 bytes. */
const ALIGN = 16;
/** Room for one dispatch of every level besides the tiles, and for the window that a dispatch binds. */
const MAX_JOBS = MAX_SLOTS + 32 * ALIGN + SLOTS_PER_LAYER;

export class TakeLightPass {
  readonly #words = new Uint32Array(JOB_WORDS * MAX_JOBS);
  readonly #buffer: GPUBuffer;
  readonly #scratch: GPUTexture;
  #group: GPUBindGroup | null = null;
  #atlas: Atlas | null = null;

  readonly #device: GPUDevice;
  readonly #layout: GPUBindGroupLayout;
  readonly #pipeline: GPUComputePipeline;

  private constructor(device: GPUDevice, layout: GPUBindGroupLayout, pipeline: GPUComputePipeline) {
    this.#device = device;
    this.#layout = layout;
    this.#pipeline = pipeline;
    this.#buffer = device.createBuffer({
      label: "light to take",
      size: this.#words.byteLength,
      usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST,
    });
    const side = SLOTS_ACROSS * SLOT_TEXELS;
    this.#scratch = device.createTexture({
      label: "light taken",
      format: "rgba8unorm",
      size: [side, side],
      usage: GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC,
    });
  }

  static async create(device: GPUDevice): Promise<TakeLightPass> {
    const visibility = GPUShaderStage.COMPUTE;
    const layout = device.createBindGroupLayout({
      label: "take light",
      entries: [
        { binding: 0, visibility, buffer: { type: "read-only-storage", hasDynamicOffset: true } },
        { binding: 1, visibility, texture: { sampleType: "unfilterable-float", viewDimension: "2d-array" } },
        { binding: 2, visibility, storageTexture: { format: "rgba8unorm" } },
      ],
    });
    const pipeline = await device.createComputePipelineAsync({
      label: "take light",
      layout: device.createPipelineLayout({ bindGroupLayouts: [layout] }),
      compute: { module: device.createShaderModule({ code: SOURCES.light }), entryPoint: "take_light" },
    });
    return new TakeLightPass(device, layout, pipeline);
  }

  attach(atlas: Atlas): void {
    this.#atlas = atlas;
    this.#group = this.#device.createBindGroup({
      label: "take light",
      layout: this.#layout,
      entries: [
        { binding: 0, resource: { buffer: this.#buffer, size: 4 * JOB_WORDS * SLOTS_PER_LAYER } },
        { binding: 1, resource: atlas.light.createView({ dimension: "2d-array" }) },
        { binding: 2, resource: this.#scratch.createView() },
      ],
    });
  }

  /** Fills the light of these tiles, parents before children; their parents have theirs. Once an encoder. */
  run(encoder: GPUCommandEncoder, jobs: readonly Resident[]): void {
    if (jobs.length === 0 || this.#atlas === null) return;
    const sorted = [...jobs].sort((a, b) => a.level - b.level);
    let room = 0;
    for (let from = 0; from < sorted.length; ) {
      let to = from;
      // As many of one level as the scratch layer holds.
      while (to < sorted.length && sorted[to]!.level === sorted[from]!.level && to - from < SLOTS_PER_LAYER) to += 1;
      this.#dispatch(encoder, sorted.slice(from, to), room);
      room += Math.ceil((to - from) / ALIGN) * ALIGN;
      from = to;
    }
    this.#device.queue.writeBuffer(this.#buffer, 0, this.#words, 0, room * JOB_WORDS);
  }

  destroy(): void {
    this.#buffer.destroy();
    this.#scratch.destroy();
  }

  #dispatch(encoder: GPUCommandEncoder, jobs: readonly Resident[], first: number): void {
    jobs.forEach((job, place) => {
      const parent = this.#atlas!.parentOf(job).slot;
      this.#words.set([place, parent, job.x, job.y], JOB_WORDS * (first + place));
    });
    const pass = encoder.beginComputePass({ label: "take light" });
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, this.#group, [first * JOB_WORDS * 4]);
    pass.dispatchWorkgroups(GROUPS, GROUPS, jobs.length);
    pass.end();
    jobs.forEach(({ slot }, place) => {
      encoder.copyTextureToTexture(
        { texture: this.#scratch, origin: originOf(place) },
        { texture: this.#atlas!.light, origin: originOf(slot) },
        [SLOT_TEXELS, SLOT_TEXELS],
      );
    });
  }
}

/** First texel of a slot, its border included, and its layer. */
function originOf(slot: number): [number, number, number] {
  const col = slot % SLOTS_ACROSS;
  const row = Math.floor(slot / SLOTS_ACROSS) % SLOTS_ACROSS;
  return [col * SLOT_TEXELS, row * SLOT_TEXELS, Math.floor(slot / SLOTS_PER_LAYER)];
}
