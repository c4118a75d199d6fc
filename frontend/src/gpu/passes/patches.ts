/** The passes that draw patches: ground, sea and walls share the patch records of the cut. */

import {
  LAKE_FULL_FETCH_M,
  LAKE_LEVEL,
  type Look,
  NO_LAKE,
  PATCH_CELLS,
  TILE_CELLS,
} from "../../generated/contract.ts";
import { type Lakes, levelsOn } from "../../tiles/lakes/lakes.ts";
import type { ShownLakes } from "../../tiles/lakes/lakewatch.ts";
import {
  EDGE_EAST,
  EDGE_NORTH,
  EDGE_SOUTH,
  EDGE_WEST,
  FACT_WORDS,
  isWet,
  RECORD_WORDS,
  recordBorder,
  recordColumn,
  recordLevel,
  recordRow,
} from "../../tiles/patches/records.ts";
import type { Cut } from "../../tiles/patches/selection.ts";
import { type Detail, sceneSource, terrainSource } from "../shaders.ts";
import type { Round } from "./hidden.ts";
import { createPass, describePass, GrowingBuffer, type PassContext, type PassOptions } from "./pipeline.ts";

/** Row stride of the vertex numbering; not the vertex count, so that small vertex caches do not thrash (DESIGN 9). */
export const PITCH = 20;

const RECORD_LAYOUT: GPUVertexBufferLayout = {
  arrayStride: RECORD_WORDS * 4,
  stepMode: "instance",
  attributes: [{ shaderLocation: 0, offset: 0, format: "uint32x4" }],
};

/** Cells a side of the blocks in which triangles are listed: 128 triangles, a batch of SwiftShader. */
const BLOCK = 8;
/** Every second column of a block, eastmost first: the next triangle's new vertices then come before its old one. */
const EVEN = [6, 4, 2, 0];

/**
 * Triangles of a 16 x 16 patch; each cell is cut from its south-east to its north-west corner.
 *
 * The order is for vertex caches. SwiftShader shades four consecutive indices together when the first of them is not in its
 * cache of 64, so new vertices should follow each other: first every second cell's triangle with two of them, then the rest.
 * That takes 112 such runs a patch, row by row would take 260; and 489 vertices with warps of 32, not 576.
 */
export function patchIndices(): Uint16Array<ArrayBuffer> {
  const out: number[] = [];
  const southWest = (a: number): number => out.push(a, a + 1, a + PITCH);
  const northEast = (a: number): number => out.push(a + PITCH, a + 1, a + PITCH + 1);
  for (let block = 0; block < (PATCH_CELLS / BLOCK) ** 2; block += 1) {
    const corner = Math.floor((block * BLOCK) / PATCH_CELLS) * BLOCK * PITCH + ((block * BLOCK) % PATCH_CELLS);
    for (let row = 0; row < BLOCK; row += 1) {
      const first = corner + row * PITCH;
      // A block's first row has a new vertex row on either side.
      if (row === 0) for (const col of EVEN) southWest(first + col);
      for (const col of EVEN) northEast(first + col);
      if (row > 0) for (const col of EVEN) southWest(first + col);
      for (let col = 1; col < BLOCK; col += 2) {
        southWest(first + col);
        northEast(first + col);
      }
    }
  }
  return Uint16Array.from(out);
}

/** Indices of one patch. */
export const INDEX_COUNT = PATCH_CELLS * PATCH_CELLS * 6;
const WALL_VERTICES = PATCH_CELLS * 6;
const WALL_WORDS = RECORD_WORDS + 1;

const WALL_LAYOUT: GPUVertexBufferLayout = {
  arrayStride: WALL_WORDS * 4,
  stepMode: "instance",
  attributes: [
    { shaderLocation: 0, offset: 0, format: "uint32x4" },
    { shaderLocation: 1, offset: RECORD_WORDS * 4, format: "uint32" },
  ],
};

/** Water on a patch: its record, then level now, level that the lake is known by (NO_LAKE: the sea), waves. */
const WATER_WORDS = RECORD_WORDS + 4;
const WATER_LAYOUT: GPUVertexBufferLayout = {
  arrayStride: WATER_WORDS * 4,
  stepMode: "instance",
  attributes: [
    { shaderLocation: 0, offset: 0, format: "uint32x4" },
    { shaderLocation: 1, offset: RECORD_WORDS * 4, format: "float32x4" },
  ],
};

/** The water that lies on the ground. */
export interface Waters extends ShownLakes {
  readonly sizeM: number;
  readonly seaM: number | null;
}

const DRY: Waters = { sizeM: 1, seaM: null, lakes: null, heights: new Map() };

/** Height of the waves on lakes in those of the sea, by their fetch: about the root of it. */
export function wavesOf({ samples }: Lakes, sizeM: number): Map<number, number> {
  const cell = sizeM / (TILE_CELLS << LAKE_LEVEL);
  return new Map(
    [...samples].map(([lake, n]) => [lake, Math.sqrt(Math.min(1, (Math.sqrt(n) * cell) / LAKE_FULL_FETCH_M))]),
  );
}

/** The pipeline that draws the ground in a look. */
function groundOf(look: Look, detail: Detail): PassOptions {
  return {
    label: `terrain ${look}`,
    code: terrainSource(look, detail),
    vertex: "terrain_vertex",
    fragment: "terrain_fragment",
    buffers: [RECORD_LAYOUT],
    vertexConstants: { PITCH },
  };
}

/** What the ground wears: materials of a look, with stones and blades close by or as they are from afar. */
export interface Clothes {
  readonly look: Look;
  readonly detail: Detail;
}

/** The cut on the device, drawn by the ground, water and wall pipelines. */
export class PatchPasses {
  readonly #records: GrowingBuffer;
  readonly #walls: GrowingBuffer;
  readonly #wet: GrowingBuffer;
  #waters = new Uint32Array(WATER_WORDS * 64);
  #waterCount = 0;
  #wetBuffer: GPUBuffer | null = null;
  readonly #indices: GPUBuffer;
  #wallRecords = new Uint32Array(WALL_WORDS * 256);
  #wallCount = 0;
  #count = 0;
  readonly #looks = new Map<string, GPURenderPipeline>();
  readonly #coming = new Set<string>();
  #terrain: GPURenderPipeline | null = null;
  #shown: Clothes | null = null;
  #recordBuffer: GPUBuffer | null = null;
  #wallBuffer: GPUBuffer | null = null;

  readonly #context: PassContext;
  readonly #water: GPURenderPipeline;
  readonly #wall: GPURenderPipeline;

  private constructor(context: PassContext, water: GPURenderPipeline, wall: GPURenderPipeline) {
    this.#context = context;
    this.#water = water;
    this.#wall = wall;
    const { device } = context;
    this.#records = new GrowingBuffer(device, "patch records");
    this.#walls = new GrowingBuffer(device, "wall records");
    this.#wet = new GrowingBuffer(device, "water");
    const indices = patchIndices();
    this.#indices = device.createBuffer({
      label: "patch indices",
      size: indices.byteLength,
      usage: GPUBufferUsage.INDEX | GPUBufferUsage.COPY_DST,
    });
    device.queue.writeBuffer(this.#indices, 0, indices);
  }

  static async create(context: PassContext): Promise<PatchPasses> {
    const [water, wall] = await Promise.all([
      createPass(context, {
        label: "water",
        code: sceneSource("background", context.detail),
        vertex: "water_vertex",
        fragment: "water_fragment",
        buffers: [WATER_LAYOUT],
        vertexConstants: { PITCH },
        blend: true,
        depthWrite: false,
      }),
      createPass(context, {
        label: "wall",
        code: sceneSource("wall", context.detail),
        vertex: "wall_vertex",
        fragment: "wall_fragment",
        buffers: [WALL_LAYOUT],
      }),
    ]);
    return new PatchPasses(context, water, wall);
  }

  /**
   * Makes the ground's pipeline of a look and detail the current one. The first is made at once; a later one in the
   * background, while the last one goes on. Returns what is drawn.
   */
  dress(wanted: Clothes): Clothes {
    const { look, detail } = wanted;
    const key = `${look} ${detail}`;
    const ready = this.#looks.get(key);
    if (ready !== undefined) {
      this.#terrain = ready;
      this.#shown = wanted;
    } else if (this.#shown === null) {
      this.#terrain = this.#context.device.createRenderPipeline(describePass(this.#context, groundOf(look, detail)));
      this.#looks.set(key, this.#terrain);
      this.#shown = wanted;
    } else if (!this.#coming.has(key)) {
      this.#coming.add(key);
      createPass(this.#context, groundOf(look, detail)).then(
        (pipeline) => this.#looks.set(key, pipeline),
        // A lost device: the renderer's `lost` tells.
        () => this.#coming.delete(key),
      );
    }
    return this.#shown;
  }

  /** Uploads the cut and the water on it. */
  update(cut: Cut, water: Waters = DRY): void {
    this.#count = cut.count;
    this.#recordBuffer = this.#records.write(cut.records, cut.count * RECORD_WORDS);
    this.#collectWater(cut, water);
    this.#wetBuffer = this.#wet.write(this.#waters, this.#waterCount * WATER_WORDS);
    this.#collectWalls(cut);
    this.#wallBuffer = this.#walls.write(this.#wallRecords, this.#wallCount * WALL_WORDS);
  }

  drawGround(pass: GPURenderPassEncoder): void {
    if (this.#terrain !== null) this.#drawPatches(pass, this.#terrain, this.#recordBuffer, this.#count);
  }

  /** Draws the ground that one round of the search for hidden patches leaves. */
  drawRound(pass: GPURenderPassEncoder, round: Round): void {
    if (this.#terrain === null || this.#count === 0) return;
    pass.setPipeline(this.#terrain);
    pass.setVertexBuffer(0, round.records, round.recordOffset);
    pass.setIndexBuffer(this.#indices, "uint16");
    pass.drawIndexedIndirect(round.draws, round.drawOffset);
  }

  drawWater(pass: GPURenderPassEncoder): void {
    this.#drawPatches(pass, this.#water, this.#wetBuffer, this.#waterCount);
  }

  drawWalls(pass: GPURenderPassEncoder): void {
    if (this.#wallCount === 0) return;
    pass.setPipeline(this.#wall);
    pass.setVertexBuffer(0, this.#wallBuffer);
    pass.draw(WALL_VERTICES, this.#wallCount);
  }

  /** The patches of the cut, for kernels. */
  get records(): { readonly buffer: GPUBuffer | null; readonly count: number } {
    return { buffer: this.#recordBuffer, count: this.#count };
  }

  get triangles(): number {
    return (this.#count * INDEX_COUNT) / 3;
  }

  destroy(): void {
    this.#records.destroy();
    this.#walls.destroy();
    this.#wet.destroy();
    this.#indices.destroy();
  }

  #drawPatches(
    pass: GPURenderPassEncoder,
    pipeline: GPURenderPipeline,
    records: GPUBuffer | null,
    count: number,
  ): void {
    if (count === 0) return;
    pass.setPipeline(pipeline);
    pass.setVertexBuffer(0, records);
    pass.setIndexBuffer(this.#indices, "uint16");
    pass.drawIndexed(INDEX_COUNT, count);
  }

  /** The sea first: a lake may stand over ground that is below it. */
  #collectWater(cut: Cut, { sizeM, seaM, lakes, heights }: Waters): void {
    this.#waterCount = 0;
    const lowest = new Float32Array(cut.facts.buffer);
    if (seaM !== null) {
      for (let i = 0; i < cut.count; i += 1) {
        if (isWet(cut.records, i) && lowest[i * FACT_WORDS]! < seaM) this.#addWater(cut, i, seaM, NO_LAKE, 1);
      }
    }
    if (lakes === null) return;
    const waves = wavesOf(lakes, sizeM);
    for (let i = 0; i < cut.count; i += 1) {
      if (!isWet(cut.records, i)) continue;
      const level = recordLevel(cut.records, i);
      const px = recordColumn(cut.records, i) / PATCH_CELLS;
      const py = recordRow(cut.records, i) / PATCH_CELLS;
      for (const lake of levelsOn(lakes, level, px, py)) {
        const at = heights.get(lake);
        if (at !== undefined && lowest[i * FACT_WORDS]! < at) this.#addWater(cut, i, at, lake, waves.get(lake) ?? 0);
      }
    }
  }

  #addWater(cut: Cut, patch: number, at: number, lake: number, waves: number): void {
    const to = this.#waterCount * WATER_WORDS;
    if (to + WATER_WORDS > this.#waters.length) {
      const grown = new Uint32Array(this.#waters.length * 2);
      grown.set(this.#waters);
      this.#waters = grown;
    }
    for (let k = 0; k < RECORD_WORDS; k += 1) this.#waters[to + k] = cut.records[patch * RECORD_WORDS + k]!;
    const floats = new Float32Array(this.#waters.buffer);
    floats[to + RECORD_WORDS] = at;
    floats[to + RECORD_WORDS + 1] = lake;
    floats[to + RECORD_WORDS + 2] = waves;
    this.#waterCount += 1;
  }

  #collectWalls(cut: Cut): void {
    this.#wallCount = 0;
    for (let i = 0; i < cut.count; i += 1) {
      const border = recordBorder(cut.records, i);
      if (border === 0) continue;
      for (const side of [EDGE_WEST, EDGE_EAST, EDGE_SOUTH, EDGE_NORTH]) {
        if ((border & side) === 0) continue;
        if ((this.#wallCount + 1) * WALL_WORDS > this.#wallRecords.length) {
          const grown = new Uint32Array(this.#wallRecords.length * 2);
          grown.set(this.#wallRecords);
          this.#wallRecords = grown;
        }
        const to = this.#wallCount * WALL_WORDS;
        for (let k = 0; k < RECORD_WORDS; k += 1) this.#wallRecords[to + k] = cut.records[i * RECORD_WORDS + k]!;
        this.#wallRecords[to + RECORD_WORDS] = side;
        this.#wallCount += 1;
      }
    }
  }
}
