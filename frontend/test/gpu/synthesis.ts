/** The page's synthesis passes on this browser's device, held against tests/vectors/synthesis.json (SPEC R26). */

import type { ChannelGrid, ChannelView } from "../../src/core/types.ts";
import type { Place as Home, Look } from "../../src/generated/contract.ts";
import { type BoundsJob, BoundsPass, TILE_BOUNDS } from "../../src/gpu/atlas/bounds.ts";
import {
  GROUND_BYTES,
  SLOT_AREA,
  SLOT_SAMPLES,
  STATE_BYTES,
  type SynthesisJob,
  SynthesisPass,
  type SynthesisRule,
} from "../../src/gpu/synthesis/synthesis.ts";

interface VectorSite {
  readonly name: string;
  readonly size_m: number;
  readonly seed: number;
  readonly detail: number;
  readonly erosion: number;
  readonly erosion_scale: number;
  readonly hold: number;
  readonly rule: SynthesisRule;
  readonly look: Look;
  readonly sea_level_m: number | null;
  readonly place: Home | null;
  readonly ground: readonly [number, number] | null;
  readonly cyclic: boolean;
  readonly solved: number;
  readonly channels: Readonly<Record<string, readonly (readonly number[])[]>>;
  readonly quanta: readonly (readonly number[])[];
}

interface Place {
  readonly site: string;
  readonly level: number;
  /** r0, r1, c0, c1. */
  readonly window: readonly [number, number, number, number];
  readonly guide: readonly number[];
  readonly base: readonly number[];
  readonly state: readonly number[];
}

interface Vectors {
  readonly sites: readonly VectorSite[];
  readonly places: readonly Place[];
}

/** How far one place is off: metres, metres, units of 16 bits. */
export interface Deviation {
  readonly site: string;
  readonly level: number;
  readonly cellM: number;
  readonly ground: number;
  readonly detail: number;
  readonly halves: number;
  /** Lowest to highest height of the tile as read back by the bounds pass, and as its samples say. */
  readonly bounds: readonly [number, number];
  readonly range: readonly [number, number];
}

const SLOTS = 20;
const BORDER = 2;

class Bench {
  readonly grounds = this.buffer(GROUND_BYTES);
  readonly state = this.buffer(STATE_BYTES);
  readonly heights = this.texture("r32float");
  readonly attributes0 = this.texture("rgba8unorm");
  readonly attributes1 = this.texture("rgba8unorm");

  constructor(private readonly device: GPUDevice) {}

  async read(source: GPUBuffer, offset: number, size: number): Promise<ArrayBuffer> {
    const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
    const staging = this.device.createBuffer({ size, usage });
    const encoder = this.device.createCommandEncoder();
    encoder.copyBufferToBuffer(source, offset, staging, 0, size);
    this.device.queue.submit([encoder.finish()]);
    await staging.mapAsync(GPUMapMode.READ);
    const data = staging.getMappedRange().slice(0);
    staging.destroy();
    return data;
  }

  private buffer(bytes: number): GPUBuffer {
    const usage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST | GPUBufferUsage.COPY_SRC;
    return this.device.createBuffer({ size: SLOTS * SLOT_AREA * bytes, usage });
  }

  private texture(format: GPUTextureFormat): GPUTexture {
    const side = 16 * SLOT_SAMPLES;
    const usage = GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.TEXTURE_BINDING;
    return this.device.createTexture({ format, size: [side, side, 2], usage });
  }
}

function channelsOf(site: VectorSite): ChannelView {
  const grid = (name: string, base: number): ChannelGrid => {
    const rows = site.channels[name];
    if (rows === undefined) return { side: 2, values: new Float32Array(4).fill(base) };
    return { side: rows.length, values: Float32Array.from(rows.flat()) };
  };
  return {
    stamp: 1,
    amplitude: grid("amplitude", 0),
    roughness: grid("roughness", 0.5),
    snow: grid("snow", 0),
    grass: grid("grass", 0),
    forest: grid("forest", 0),
    wetness: grid("wetness", 0),
    survey: grid("survey", -1),
    erosion: grid("erosion", 0),
    far: grid("far", 1),
  };
}

/** Guide and base of a solved tile with what its neighbours hold; the mask of the nine tiles that are there. */
function heldGround(site: VectorSite, level: number, x: number, y: number): { held: number; samples: Float32Array } {
  const n = 64 << level;
  const quantum = site.size_m / n / 256;
  const samples = new Float32Array(2 * SLOT_AREA).fill(1e7);
  for (let row = 0; row < SLOT_SAMPLES; row += 1) {
    for (let col = 0; col < SLOT_SAMPLES; col += 1) {
      let j = 64 * y + row - BORDER;
      let i = 64 * x + col - BORDER;
      if (site.cyclic) [i, j] = [(i + n) % n, (j + n) % n];
      if (i < 0 || j < 0 || i > n || j > n) continue;
      samples.fill(
        site.quanta[level]![j * (n + 1) + i]! * quantum,
        2 * (row * SLOT_SAMPLES + col),
        2 * (row * SLOT_SAMPLES + col) + 2,
      );
    }
  }
  let held = 0;
  for (let k = 0; k < 9; k += 1) {
    const u = x + (k % 3) - 1;
    const v = y + Math.floor(k / 3) - 1;
    if (site.cyclic || (u >= 0 && v >= 0 && u < 1 << level && v < 1 << level)) held |= 1 << k;
  }
  return { held, samples };
}

/** Makes every place of the vectors from the root and returns how far it is off. Throws on any validation error. */
export async function synthesisVectors(vectors: Vectors, featureLevel = "core"): Promise<Deviation[]> {
  const adapter = await navigator.gpu.requestAdapter({ featureLevel });
  const device = await adapter!.requestDevice();
  device.pushErrorScope("validation");
  const pass = await SynthesisPass.create(device);
  let answer: (bounds: Float32Array) => void = () => undefined;
  const bounds = await BoundsPass.create<BoundsJob>(device, (_, values) => answer(values), SLOTS);
  const bench = new Bench(device);
  pass.attach(bench);
  bounds.attach(bench);
  const out: Deviation[] = [];
  for (const site of vectors.sites) {
    pass.configure({
      sizeM: site.size_m,
      seed: site.seed,
      detail: site.detail,
      erosion: { erosion: site.erosion, erosion_scale: site.erosion_scale, hold: site.hold },
      rule: site.rule,
      look: site.look,
      seaLevelM: site.sea_level_m,
      place: site.place,
      ground: site.ground,
      solved: site.solved,
      cyclic: site.cyclic,
    });
    pass.setChannels(channelsOf(site));
    for (const place of vectors.places.filter((p) => p.site === site.name)) {
      const measured = new Promise<Float32Array>((resolve) => {
        answer = resolve;
      });
      const jobs = lineage(device, bench, site, place);
      const encoder = device.createCommandEncoder();
      // The order of the jobs is not theirs to care about.
      pass.run(encoder, [...jobs].reverse());
      bounds.run(encoder, site.size_m, jobs.slice(-1));
      device.queue.submit([encoder.finish()]);
      bounds.submitted();
      out.push(await deviation(bench, site, place, jobs.at(-1)!, await measured));
    }
  }
  const problem = await device.popErrorScope();
  if (problem !== null) throw new Error(problem.message);
  pass.destroy();
  bounds.destroy();
  device.destroy();
  return out;
}

function lineage(device: GPUDevice, bench: Bench, site: VectorSite, { level, window }: Place): SynthesisJob[] {
  const tile = (from: number): number => Math.min(2 ** level - 1, Math.max(0, Math.floor(from / 64)));
  const jobs: SynthesisJob[] = [];
  for (let l = 0; l <= level; l += 1) {
    const x = tile(window[2]) >> (level - l);
    const y = tile(window[0]) >> (level - l);
    let held = 0;
    if (l <= site.solved) {
      const ground = heldGround(site, l, x, y);
      held = ground.held;
      device.queue.writeBuffer(
        bench.grounds,
        l * SLOT_AREA * GROUND_BYTES,
        ground.samples as Float32Array<ArrayBuffer>,
      );
    }
    jobs.push({ slot: l, level: l, x, y, parentSlot: l - 1, held });
  }
  return jobs.map((job) => ({ ...job, parentSlot: Math.max(0, job.parentSlot) }));
}

async function deviation(
  bench: Bench,
  site: VectorSite,
  place: Place,
  job: SynthesisJob,
  bounds: Float32Array,
): Promise<Deviation> {
  const first = job.slot * SLOT_AREA;
  const grounds = new Float32Array(await bench.read(bench.grounds, first * GROUND_BYTES, SLOT_AREA * GROUND_BYTES));
  const words = new Uint32Array(await bench.read(bench.state, first * STATE_BYTES, SLOT_AREA * STATE_BYTES));
  const details = new Float32Array(words.buffer);
  const [r0, r1, c0, c1] = place.window;
  let ground = 0;
  let detail = 0;
  let halves = 0;
  let k = 0;
  const wantedWords = Uint32Array.from(place.state);
  const wantedDetails = new Float32Array(wantedWords.buffer);
  for (let row = r0; row < r1; row += 1) {
    for (let col = c0; col < c1; col += 1, k += 1) {
      const at = (row - 64 * job.y + BORDER) * SLOT_SAMPLES + col - 64 * job.x + BORDER;
      ground = Math.max(ground, Math.abs(grounds[2 * at]! - place.guide[k]!));
      ground = Math.max(ground, Math.abs(grounds[2 * at + 1]! - place.base[k]!));
      detail = Math.max(detail, Math.abs(details[4 * at]! - wantedDetails[4 * k]!));
      for (let word = 1; word < 4; word += 1) {
        const [got, wanted] = [words[4 * at + word]!, wantedWords[4 * k + word]!];
        halves = Math.max(
          halves,
          Math.abs((got & 0xffff) - (wanted & 0xffff)),
          Math.abs((got >>> 16) - (wanted >>> 16)),
        );
      }
    }
  }
  return {
    site: site.name,
    level: place.level,
    cellM: site.size_m / (64 * 2 ** place.level),
    ground,
    detail,
    halves,
    bounds: rangeOf(
      (i) => bounds[4 * i]!,
      (i) => bounds[4 * i + 1]!,
      TILE_BOUNDS / 4,
    ),
    range: shownRange(grounds, details),
  };
}

function rangeOf(low: (i: number) => number, high: (i: number) => number, count: number): [number, number] {
  let [min, max] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (let i = 0; i < count; i += 1) [min, max] = [Math.min(min, low(i)), Math.max(max, high(i))];
  return [min, max];
}

/** Lowest and highest height that the tile shows, borders left out. */
function shownRange(grounds: Float32Array, details: Float32Array): [number, number] {
  const at = (i: number): number => (Math.floor(i / 65) + BORDER) * SLOT_SAMPLES + (i % 65) + BORDER;
  const height = (i: number): number => Math.fround(grounds[2 * at(i) + 1]! + details[4 * at(i)]!);
  return rangeOf(height, height, 65 * 65);
}
