/**
 * Patches that nearer ground hides, found on the device by a depth pyramid (Greene, Kass, Miller, "Hierarchical Z-Buffer
 * Visibility", 1993), in two rounds a frame so that nothing in sight is ever late:
 *
 * 1. what showed in the last picture is drawn; of what was never tested, the nearest third;
 * 2. the depth that it leaves is reduced to a pyramid of the farthest depths, all boxes of the cut are tested against it, and
 *    those of the rest are drawn that may show.
 *
 * A box is that of the bounds that the selection culls with, so no sample that is left out would have passed the depth test:
 * pictures are the same. What was found stays with the node of the patch tree, from frame to frame; a page that serves again
 * brings a wrong guess at worst, which costs time alone. The shader is shaders/wgsl/hidden/hidden.wgsl.
 */

import { FACT_WORDS, RECORD_WORDS } from "../../tiles/patches/records.ts";
import type { Cut } from "../../tiles/patches/selection.ts";
import { SOURCES } from "../shaders.ts";

const BASE_PIXELS = 4;
const MAX_LEVELS = 12;
/** The first round draws this share of the patches that were never tested, the nearest ones. */
const FIRST_SHARE = 1 / 3;
/** Least distance of dynamic offsets. */
const STRIDE = 256;
const DRAW_WORDS = 5;
const GROUP = 64;

interface Pipelines {
  readonly chooseFirst: GPUComputePipeline;
  readonly pack: GPUComputePipeline;
  readonly base: GPUComputePipeline;
  readonly reduce: GPUComputePipeline;
  readonly test: GPUComputePipeline;
}

/** Where a level of the pyramid lies: offset, width, height. */
export type PyramidLevel = readonly [number, number, number];

/** Levels of the pyramid of a picture, finest first, down to one texel. */
export function pyramidLevels(width: number, height: number): PyramidLevel[] {
  const out: PyramidLevel[] = [];
  let [w, h, at] = [Math.ceil(width / BASE_PIXELS), Math.ceil(height / BASE_PIXELS), 0];
  while (out.length < MAX_LEVELS) {
    out.push([at, w, h]);
    if (w === 1 && h === 1) break;
    at += w * h;
    [w, h] = [Math.ceil(w / 2), Math.ceil(h / 2)];
  }
  return out;
}

/** The draw of one round: its records and the arguments of an indirect draw. */
export interface Round {
  readonly records: GPUBuffer;
  readonly recordOffset: number;
  readonly draws: GPUBuffer;
  readonly drawOffset: number;
}

export class HiddenPatches {
  readonly #turn: GPUBuffer;
  readonly #words = new Uint32Array(8 + 4 * MAX_LEVELS);
  readonly #parts: GPUBuffer;
  readonly #draws: GPUBuffer;
  readonly #readback: GPUBuffer;
  #reading = false;
  #facts: GPUBuffer | null = null;
  #inputs: GPUBuffer | null = null;
  #drawn: GPUBuffer | null = null;
  #bits: GPUBuffer | null = null;
  #known: GPUBuffer | null = null;
  #pyramid: GPUBuffer | null = null;
  #levels: PyramidLevel[] = [];
  #size = "";
  #count = 0;
  #room = 0;
  #group: GPUBindGroup | null = null;

  readonly #device: GPUDevice;
  readonly #view: GPUBindGroup;
  readonly #layout: GPUBindGroupLayout;
  readonly #depthLayout: GPUBindGroupLayout;
  readonly #pipelines: Pipelines;

  private constructor(
    device: GPUDevice,
    view: GPUBindGroup,
    layout: GPUBindGroupLayout,
    depthLayout: GPUBindGroupLayout,
    pipelines: Pipelines,
    indexCount: number,
  ) {
    this.#device = device;
    this.#view = view;
    this.#layout = layout;
    this.#depthLayout = depthLayout;
    this.#pipelines = pipelines;
    const usage = GPUBufferUsage.COPY_DST;
    this.#turn = device.createBuffer({
      label: "hidden turn",
      size: this.#words.byteLength,
      usage: usage | GPUBufferUsage.UNIFORM,
    });
    this.#parts = device.createBuffer({
      label: "hidden parts",
      size: STRIDE * MAX_LEVELS,
      usage: usage | GPUBufferUsage.UNIFORM,
    });
    const parts = new Uint32Array((STRIDE / 4) * MAX_LEVELS);
    for (let k = 0; k < MAX_LEVELS; k += 1) parts[(STRIDE / 4) * k] = k;
    device.queue.writeBuffer(this.#parts, 0, parts);
    this.#draws = device.createBuffer({
      label: "hidden draws",
      size: 8 * DRAW_WORDS,
      usage: usage | GPUBufferUsage.INDIRECT | GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC,
    });
    const none = [indexCount, 0, 0, 0, 0];
    device.queue.writeBuffer(this.#draws, 0, Uint32Array.from([...none, ...none]));
    this.#readback = device.createBuffer({
      label: "hidden counts",
      size: 8 * DRAW_WORDS,
      usage: usage | GPUBufferUsage.MAP_READ,
    });
  }

  /** `view`: the frame's uniform; `samples` of the depth texture; `indexCount` of one patch. */
  static async create(device: GPUDevice, view: GPUBuffer, samples: number, indexCount: number): Promise<HiddenPatches> {
    const visibility = GPUShaderStage.COMPUTE;
    const types: readonly GPUBufferBindingType[] = [
      "uniform",
      "read-only-storage",
      "read-only-storage",
      "storage",
      "storage",
      "storage",
      "storage",
      "storage",
    ];
    const layout = device.createBindGroupLayout({
      label: "hidden",
      entries: [
        ...types.map((type, binding) => ({ binding, visibility, buffer: { type } })),
        { binding: 8, visibility, buffer: { type: "uniform" as const, hasDynamicOffset: true, minBindingSize: 4 } },
      ],
    });
    const viewLayout = device.createBindGroupLayout({
      label: "hidden view",
      entries: [{ binding: 0, visibility, buffer: { type: "uniform" } }],
    });
    const depthLayout = device.createBindGroupLayout({
      label: "hidden depth",
      entries: [{ binding: 0, visibility, texture: { sampleType: "depth", multisampled: samples > 1 } }],
    });
    const plain = device.createShaderModule({ label: "hidden", code: SOURCES.hidden });
    const base = device.createShaderModule({
      label: "hidden depth",
      code: samples > 1 ? SOURCES.hiddenSamples : SOURCES.hiddenDepth,
    });
    const make = (module: GPUShaderModule, entryPoint: string, more: GPUBindGroupLayout[] = []) =>
      device.createComputePipelineAsync({
        label: `hidden ${entryPoint}`,
        layout: device.createPipelineLayout({ bindGroupLayouts: [viewLayout, layout, ...more] }),
        compute: { module, entryPoint },
      });
    const [chooseFirst, pack, first, reduce, test] = await Promise.all([
      make(plain, "choose_first"),
      make(plain, "pack"),
      make(base, "reduce_depth", [depthLayout]),
      make(plain, "reduce"),
      make(plain, "test_boxes"),
    ]);
    const group = device.createBindGroup({
      layout: viewLayout,
      entries: [{ binding: 0, resource: { buffer: view } }],
    });
    const pipelines = { chooseFirst, pack, base: first, reduce, test };
    return new HiddenPatches(device, group, layout, depthLayout, pipelines, indexCount);
  }

  /** Takes up a cut for a picture of `width` x `height` pixels; `nodes`: for how many the patch tree has room. */
  update(cut: Cut, nodes: number, width: number, height: number): void {
    const device = this.#device;
    this.#count = cut.count;
    this.#allocate(cut.count, nodes, width, height);
    const words = this.#words;
    const levels = this.#levels;
    words.set([
      cut.count,
      Math.ceil(cut.count * FIRST_SHARE),
      this.#room / 32,
      levels.length,
      width,
      height,
      this.#room,
    ]);
    levels.forEach((level, k) => {
      words.set(level, 8 + 4 * k);
    });
    device.queue.writeBuffer(this.#turn, 0, words);
    if (cut.count === 0) return;
    const send = (to: GPUBuffer, data: Uint32Array, count: number): void =>
      device.queue.writeBuffer(to, 0, data.buffer as ArrayBuffer, data.byteOffset, 4 * count);
    send(this.#inputs!, cut.records, cut.count * RECORD_WORDS);
    send(this.#facts!, cut.facts, cut.count * FACT_WORDS);
  }

  /** Chooses what the first round draws. */
  first(encoder: GPUCommandEncoder): Round {
    encoder.clearBuffer(this.#bits!);
    const pass = this.#begin(encoder, "hidden first");
    this.#run(pass, this.#pipelines.chooseFirst, 0, this.#groups);
    this.#run(pass, this.#pipelines.pack, 0, this.#groups);
    pass.end();
    return this.#round(0);
  }

  /** Tests all patches against the depth that the first round left, and chooses what the second draws. */
  second(encoder: GPUCommandEncoder, depth: GPUTextureView): Round {
    const pass = this.#begin(encoder, "hidden second");
    const source = this.#device.createBindGroup({
      layout: this.#depthLayout,
      entries: [{ binding: 0, resource: depth }],
    });
    pass.setBindGroup(2, source);
    this.#levels.forEach(([, width, height], k) => {
      const pipeline = k === 0 ? this.#pipelines.base : this.#pipelines.reduce;
      this.#run(pass, pipeline, k, Math.ceil(width / 8), Math.ceil(height / 8));
    });
    this.#run(pass, this.#pipelines.test, 0, this.#groups);
    this.#run(pass, this.#pipelines.pack, 1, this.#groups);
    pass.end();
    return this.#round(1);
  }

  /**
   * Reads after the submission how many patches were drawn of how many, as the device tells; null while a reading is
   * due.
   */
  measure(encoder: GPUCommandEncoder): (() => Promise<{ total: number; drawn: number }>) | null {
    if (this.#reading) return null;
    this.#reading = true;
    const total = this.#count;
    encoder.copyBufferToBuffer(this.#draws, 0, this.#readback, 0, 8 * DRAW_WORDS);
    return async () => {
      try {
        await this.#readback.mapAsync(GPUMapMode.READ);
        const words = new Uint32Array(this.#readback.getMappedRange().slice(0));
        this.#readback.unmap();
        return { total, drawn: words[1]! + words[DRAW_WORDS + 1]! };
      } finally {
        this.#reading = false;
      }
    };
  }

  /** Buffers that tests read back. */
  get state(): { bits: GPUBuffer; known: GPUBuffer; pyramid: GPUBuffer; words: number } {
    return { bits: this.#bits!, known: this.#known!, pyramid: this.#pyramid!, words: this.#room / 32 };
  }

  destroy(): void {
    const turn = this.#turn;
    const parts = this.#parts;
    const draws = this.#draws;
    const readback = this.#readback;
    const facts = this.#facts;
    const inputs = this.#inputs;
    const drawn = this.#drawn;
    const bits = this.#bits;
    const known = this.#known;
    const pyramid = this.#pyramid;
    for (const buffer of [turn, parts, draws, readback, facts, inputs, drawn, bits, known, pyramid]) buffer?.destroy();
  }

  get #groups(): number {
    return Math.max(1, Math.ceil(this.#count / GROUP));
  }

  #round(k: number): Round {
    return {
      records: this.#drawn!,
      recordOffset: 4 * RECORD_WORDS * this.#room * k,
      draws: this.#draws,
      drawOffset: 4 * DRAW_WORDS * k,
    };
  }

  #begin(encoder: GPUCommandEncoder, label: string): GPUComputePassEncoder {
    const pass = encoder.beginComputePass({ label });
    pass.setBindGroup(0, this.#view);
    return pass;
  }

  #run(pass: GPUComputePassEncoder, pipeline: GPUComputePipeline, part: number, x: number, y = 1): void {
    pass.setPipeline(pipeline);
    pass.setBindGroup(1, this.#group, [STRIDE * part]);
    pass.dispatchWorkgroups(x, y);
  }

  #allocate(count: number, nodes: number, width: number, height: number): void {
    let anew = this.#group === null;
    const storage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST | GPUBufferUsage.COPY_SRC;
    const make = (label: string, words: number, more = 0): GPUBuffer =>
      this.#device.createBuffer({ label: `hidden ${label}`, size: 4 * words, usage: storage | more });
    if (count > this.#room || this.#room === 0) {
      this.#room = Math.max(1024, 2 ** Math.ceil(Math.log2(count)));
      for (const old of [this.#inputs, this.#facts, this.#drawn, this.#bits]) old?.destroy();
      this.#inputs = make("records", RECORD_WORDS * this.#room);
      this.#facts = make("facts", FACT_WORDS * this.#room);
      this.#drawn = make("drawn", 2 * RECORD_WORDS * this.#room, GPUBufferUsage.VERTEX);
      this.#bits = make("bits", (2 * this.#room) / 32);
      anew = true;
    }
    if (this.#known === null || this.#known.size < 4 * nodes) {
      this.#known?.destroy();
      this.#known = make("known", nodes);
      anew = true;
    }
    if (this.#size !== `${width} ${height}`) {
      this.#size = `${width} ${height}`;
      this.#levels = pyramidLevels(width, height);
      const [at, w, h] = this.#levels.at(-1)!;
      this.#pyramid?.destroy();
      this.#pyramid = make("pyramid", at + w * h);
      anew = true;
    }
    if (anew) this.#bind();
  }

  #bind(): void {
    const whole = [
      this.#turn,
      this.#inputs,
      this.#facts,
      this.#known,
      this.#bits,
      this.#pyramid,
      this.#drawn,
      this.#draws,
    ] as const;
    this.#group = this.#device.createBindGroup({
      label: "hidden",
      layout: this.#layout,
      entries: [
        ...whole.map((buffer, binding) => ({ binding, resource: { buffer: buffer! } })),
        { binding: 8, resource: { buffer: this.#parts, size: 4 } },
      ],
    });
  }
}
