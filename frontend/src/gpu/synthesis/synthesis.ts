/**
 * Detail on the device (DESIGN 10, docs/renderer.md "Synthesis"): makes ground and attributes of atlas slots from those of
 * their parents' slots. Shaders: synthesis/synthesise.wgsl, one rule_*.wgsl a rule.
 *
 * A slot is filled in two steps. The atlas writes the samples that are *held* into `grounds` (guide, base; metres): from
 * the tile itself and from any of its eight neighbours on the level, one owner per shared sample (apron.ts). Then a job with
 * the mask of those nine tiles makes the rest: samples that nobody holds are interpolated from the parent; those beyond the
 * domain mirror held ones point-symmetrically; above level `solved` the guide is interpolated whatever is held. So each
 * sample is a function of its place, its level and the held tiles alone, and slots agree on all that they share.
 */

import type { ChannelView } from "../../core/types.ts";
import { MAX_SYNTHESIS_LEVEL, TILE_SAMPLES } from "../../generated/contract.ts";
import { synthesisSource } from "../shaders.ts";
import { type ChannelFacts, channelWords, NO_CHANNELS } from "./channels.ts";
import { SITE_BYTES, type SynthesisRule, type SynthesisSettings, sameSettings, siteWords } from "./site.ts";

export type { SynthesisRule, SynthesisSettings } from "./site.ts";

/** Samples along one side of a slot. */
export const SLOT_SAMPLES: number = TILE_SAMPLES + 4;
/** Sample of `grounds` and `state`: slot * SLOT_AREA + row * SLOT_SAMPLES + column, row and column 0 in the border. */
export const SLOT_AREA: number = SLOT_SAMPLES * SLOT_SAMPLES;
export const GROUND_BYTES = 8;
export const STATE_BYTES = 16;

/** One tile to make. */
export interface SynthesisJob {
  readonly slot: number;
  readonly level: number;
  readonly x: number;
  readonly y: number;
  /** Slot of the parent; any number on level 0. */
  readonly parentSlot: number;
  /**
   * Bit (dy + 1) * 3 + dx + 1: the tile at (x + dx, y + dy) of the level is held and its samples are in `grounds`. The root is
   * always held. (In a cyclic domain neighbours wrap; the root is its own.)
   */
  readonly held: number;
}

/**
 * The part of the atlas that the passes use: the samples of all slots. Textures are 2d-arrays in its layout
 * (tiles/tile.wgsl).
 */
export interface SynthesisAtlas {
  /** vec2f per sample: guide, base; metres. STORAGE | COPY_DST. */
  readonly grounds: GPUBuffer;
  /** vec4u per sample (docs/synthesis.md, "State"). STORAGE. */
  readonly state: GPUBuffer;
  /** r32float: base + detail, metres. STORAGE_BINDING | TEXTURE_BINDING; so are the others. */
  readonly heights: GPUTexture;
  /** rgba8unorm: snow, wet, foam, h / 2. */
  readonly attributes0: GPUTexture;
  /** rgba8unorm: grass, forest, noise of the level (0.5 in the middle), size of the next level's detail (finer_code). */
  readonly attributes1: GPUTexture;
}

/** Jobs that one encoder may hold, all calls together. */
export const MAX_JOBS = 16384;
const JOB_WORDS = 8;
/** Jobs of a level start where a dynamic offset may point. */
const JOB_ALIGN = 256 / (4 * JOB_WORDS);
/** Workgroups of 64 parents' cells that make one slot. */
const GROUPS = Math.ceil((TILE_SAMPLES / 2 + 2.5) ** 2 / 64);
type Entry = "synthesise" | "compose" | "compose_root";
/** Pipelines that are ready from the start; another rule's are made when first asked for: compiling takes its time. */
const FIRST_RULE: SynthesisRule = "landscape";
const FIRST_ENTRIES: readonly Entry[] = ["synthesise", "compose"];

export class SynthesisPass {
  readonly #site: GPUBuffer;
  readonly #jobs: GPUBuffer;
  readonly #words = new Uint32Array(JOB_WORDS * MAX_JOBS);
  #next = 0;
  #channels: GPUBuffer | null = null;
  #channelSource: ChannelView | null = null;
  #channelStamp = -1;
  #channelFacts: ChannelFacts = NO_CHANNELS;
  #settings: SynthesisSettings | null = null;
  #atlas: SynthesisAtlas | null = null;
  #group: GPUBindGroup | null = null;

  readonly #device: GPUDevice;
  readonly #layout: GPUBindGroupLayout;
  readonly #pipelines: Map<string, GPUComputePipeline>;

  private constructor(device: GPUDevice, layout: GPUBindGroupLayout, pipelines: Map<string, GPUComputePipeline>) {
    this.#device = device;
    this.#layout = layout;
    this.#pipelines = pipelines;
    const usage = GPUBufferUsage.COPY_DST;
    this.#site = device.createBuffer({ label: "site", size: SITE_BYTES, usage: usage | GPUBufferUsage.UNIFORM });
    const size = this.#words.byteLength;
    this.#jobs = device.createBuffer({ label: "synthesis jobs", size, usage: usage | GPUBufferUsage.STORAGE });
  }

  static async create(device: GPUDevice): Promise<SynthesisPass> {
    const layout = synthesisLayout(device);
    const made = FIRST_ENTRIES.map((entry) =>
      device.createComputePipelineAsync(describeStage(device, layout, FIRST_RULE, entry)),
    );
    const first = await Promise.all(made);
    return new SynthesisPass(device, layout, new Map(first.map((pipeline) => [pipeline.label, pipeline])));
  }

  /** Works on this atlas from now on. */
  attach(atlas: SynthesisAtlas): void {
    this.#atlas = atlas;
    this.#group = null;
  }

  /** Takes over what changed; true when all that was made is stale. Cheap when nothing did: call it in every frame. */
  configure(settings: SynthesisSettings): boolean {
    if (this.#settings !== null && sameSettings(this.#settings, settings)) return false;
    this.#settings = settings;
    this.#writeSite();
    return true;
  }

  /** Takes the channels that strokes ask of the detail. Returns whether they have changed. */
  setChannels(channels: ChannelView): boolean {
    if (channels === this.#channelSource && channels.stamp === this.#channelStamp) return false;
    this.#channelSource = channels;
    this.#channelStamp = channels.stamp;
    const { values, ...facts } = channelWords(channels);
    if (this.#channels?.size !== values.byteLength) {
      this.#channels?.destroy();
      const usage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST;
      this.#channels = this.#device.createBuffer({ label: "synthesis channels", size: values.byteLength, usage });
      this.#group = null;
    }
    this.#device.queue.writeBuffer(this.#channels, 0, values);
    this.#channelFacts = facts;
    this.#writeSite();
    return true;
  }

  /** Makes these tiles, parents before children, whatever their order. Their parents are among them or were made before. */
  run(encoder: GPUCommandEncoder, jobs: readonly SynthesisJob[]): void {
    this.#dispatch(encoder, jobs, "synthesise");
  }

  /** Makes ground and heights of these tiles and keeps their detail: for ground that moved only above level `solved`. */
  compose(encoder: GPUCommandEncoder, jobs: readonly SynthesisJob[]): void {
    this.#dispatch(encoder, jobs, "compose");
  }

  destroy(): void {
    for (const buffer of [this.#site, this.#jobs, this.#channels]) buffer?.destroy();
  }

  #dispatch(encoder: GPUCommandEncoder, jobs: readonly SynthesisJob[], what: "synthesise" | "compose"): void {
    if (jobs.length === 0) return;
    if (this.#settings === null) throw new Error("synthesis: configure, setChannels and attach come before run");
    const { rule } = this.#settings;
    const levels = byLevel(jobs);
    const first = this.#reserve(levels);
    const group = this.#bindGroup();
    const pass = encoder.beginComputePass({ label: what });
    let at = first;
    for (const level of levels) {
      level.forEach((job, i) => {
        this.#words.set([job.slot, job.level, job.x, job.y, job.parentSlot, job.held], JOB_WORDS * (at + i));
      });
      pass.setPipeline(this.#pipeline(rule, what === "compose" && level[0]!.level === 0 ? "compose_root" : what));
      pass.setBindGroup(0, group, [4 * JOB_WORDS * at]);
      pass.dispatchWorkgroups(GROUPS, level.length);
      at += padded(level.length);
    }
    pass.end();
    const from = JOB_WORDS * first;
    this.#device.queue.writeBuffer(this.#jobs, 4 * from, this.#words, from, JOB_WORDS * (at - first));
  }

  #pipeline(rule: SynthesisRule, entry: Entry): GPUComputePipeline {
    const known = this.#pipelines.get(labelOf(rule, entry));
    if (known !== undefined) return known;
    const made = this.#device.createComputePipeline(describeStage(this.#device, this.#layout, rule, entry));
    this.#pipelines.set(made.label, made);
    return made;
  }

  /** Room for the jobs of one call. Throws RangeError when there are too many. */
  #reserve(levels: readonly (readonly SynthesisJob[])[]): number {
    const room = levels.reduce((sum, level) => sum + padded(level.length), 0);
    if (room > MAX_JOBS / 2) throw new RangeError(`${room} tiles to synthesise at once: at most ${MAX_JOBS / 2}`);
    // A binding is half of the buffer long, whatever its offset.
    if (this.#next + room > MAX_JOBS / 2) this.#next = 0;
    const first = this.#next;
    this.#next += room;
    return first;
  }

  #writeSite(): void {
    if (this.#settings === null) return;
    this.#device.queue.writeBuffer(this.#site, 0, siteWords(this.#settings, this.#channelFacts));
  }

  #bindGroup(): GPUBindGroup {
    if (this.#group !== null) return this.#group;
    if (this.#atlas === null || this.#channels === null) throw new Error("synthesis: no atlas or no channels");
    const { grounds, state, heights, attributes0, attributes1 } = this.#atlas;
    const resources: GPUBindingResource[] = [
      { buffer: this.#site },
      { buffer: this.#jobs, size: this.#words.byteLength / 2 },
      { buffer: grounds },
      { buffer: state },
      { buffer: this.#channels },
      ...[heights, attributes0, attributes1].map((texture) => texture.createView({ dimension: "2d-array" })),
    ];
    const entries = resources.map((resource, binding) => ({ binding, resource }));
    this.#group = this.#device.createBindGroup({ label: "synthesis", layout: this.#layout, entries });
    return this.#group;
  }
}

/** Jobs of each level, coarse levels first; levels without any left out. */
function byLevel(jobs: readonly SynthesisJob[]): SynthesisJob[][] {
  const levels = Array.from({ length: MAX_SYNTHESIS_LEVEL + 1 }, (): SynthesisJob[] => []);
  for (const job of jobs) levels[job.level]!.push(job);
  return levels.filter((level) => level.length > 0);
}

function labelOf(rule: SynthesisRule, entry: Entry): string {
  return `${entry} ${rule}`;
}

function describeStage(
  device: GPUDevice,
  layout: GPUBindGroupLayout,
  rule: SynthesisRule,
  entryPoint: Entry,
): GPUComputePipelineDescriptor {
  const module = device.createShaderModule({ label: `synthesis ${rule}`, code: synthesisSource(rule) });
  return {
    label: labelOf(rule, entryPoint),
    layout: device.createPipelineLayout({ bindGroupLayouts: [layout] }),
    compute: { module, entryPoint },
  };
}

function padded(jobs: number): number {
  return Math.ceil(jobs / JOB_ALIGN) * JOB_ALIGN;
}

function synthesisLayout(device: GPUDevice): GPUBindGroupLayout {
  const buffer = (type: GPUBufferBindingType, hasDynamicOffset = false): Omit<GPUBindGroupLayoutEntry, "binding"> => ({
    visibility: GPUShaderStage.COMPUTE,
    buffer: { type, hasDynamicOffset },
  });
  const store = (format: GPUTextureFormat): Omit<GPUBindGroupLayoutEntry, "binding"> => ({
    visibility: GPUShaderStage.COMPUTE,
    storageTexture: { format, access: "write-only", viewDimension: "2d-array" },
  });
  const parts = [
    buffer("uniform"),
    buffer("read-only-storage", true),
    buffer("storage"),
    buffer("storage"),
    buffer("read-only-storage"),
    store("r32float"),
    store("rgba8unorm"),
    store("rgba8unorm"),
  ];
  return device.createBindGroupLayout({
    label: "synthesis",
    entries: parts.map((part, binding) => ({ binding, ...part })),
  });
}
