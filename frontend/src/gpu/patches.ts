/** The passes that draw patches: ground, sea and walls share the patch records of the cut. */

import { PATCH_CELLS } from "../generated/contract.ts";
import { type Cut, EDGE_EAST, EDGE_NORTH, EDGE_SOUTH, EDGE_WEST, RECORD_WORDS } from "../tiles/selection.ts";
import { createPass, GrowingBuffer, type PassContext } from "./pipeline.ts";
import { SOURCES } from "./shaders.ts";

/** Row stride of the vertex numbering; not the vertex count, so that small vertex caches do not thrash (DESIGN 9). */
export const PITCH = 20;

const RECORD_LAYOUT: GPUVertexBufferLayout = {
  arrayStride: RECORD_WORDS * 4,
  stepMode: "instance",
  attributes: [{ shaderLocation: 0, offset: 0, format: "uint32x4" }],
};

/** Triangles of a 16 x 16 patch; each cell is cut from its south-east to its north-west corner. */
export function patchIndices(): Uint16Array<ArrayBuffer> {
  const out = new Uint16Array(PATCH_CELLS * PATCH_CELLS * 6);
  let k = 0;
  for (let row = 0; row < PATCH_CELLS; row += 1) {
    for (let col = 0; col < PATCH_CELLS; col += 1) {
      const a = row * PITCH + col;
      out.set([a, a + 1, a + PITCH, a + PITCH, a + 1, a + PITCH + 1], k);
      k += 6;
    }
  }
  return out;
}

const INDEX_COUNT = PATCH_CELLS * PATCH_CELLS * 6;
const WALL_VERTICES = PATCH_CELLS * 6;
const WALL_WORDS = RECORD_WORDS + 1;

/** The cut on the device, drawn by the ground, sea and wall pipelines. */
export class PatchPasses {
  private readonly records: GrowingBuffer;
  private readonly walls: GrowingBuffer;
  private readonly indices: GPUBuffer;
  private wallRecords = new Uint32Array(WALL_WORDS * 256);
  private wallCount = 0;
  private count = 0;
  private recordBuffer: GPUBuffer | null = null;
  private wallBuffer: GPUBuffer | null = null;

  private constructor(
    device: GPUDevice,
    private readonly terrain: GPURenderPipeline,
    private readonly sea: GPURenderPipeline,
    private readonly wall: GPURenderPipeline,
  ) {
    this.records = new GrowingBuffer(device, "patch records");
    this.walls = new GrowingBuffer(device, "wall records");
    const indices = patchIndices();
    this.indices = device.createBuffer({
      label: "patch indices",
      size: indices.byteLength,
      usage: GPUBufferUsage.INDEX | GPUBufferUsage.COPY_DST,
    });
    device.queue.writeBuffer(this.indices, 0, indices);
  }

  static async create(context: PassContext): Promise<PatchPasses> {
    const constants = { PITCH };
    const buffers = [RECORD_LAYOUT];
    const wallLayout: GPUVertexBufferLayout = {
      arrayStride: WALL_WORDS * 4,
      stepMode: "instance",
      attributes: [
        { shaderLocation: 0, offset: 0, format: "uint32x4" },
        { shaderLocation: 1, offset: RECORD_WORDS * 4, format: "uint32" },
      ],
    };
    const [terrain, sea, wall] = await Promise.all([
      createPass(context, {
        label: "terrain",
        code: SOURCES.terrain,
        vertex: "terrain_vertex",
        fragment: "terrain_fragment",
        buffers,
        constants,
      }),
      createPass(context, {
        label: "sea",
        code: SOURCES.background,
        vertex: "water_vertex",
        fragment: "water_fragment",
        buffers,
        constants,
        blend: true,
        depthWrite: false,
      }),
      createPass(context, {
        label: "wall",
        code: SOURCES.wall,
        vertex: "wall_vertex",
        fragment: "wall_fragment",
        buffers: [wallLayout],
      }),
    ]);
    return new PatchPasses(context.device, terrain, sea, wall);
  }

  /** Uploads the cut. */
  update(cut: Cut): void {
    this.count = cut.count;
    this.recordBuffer = this.records.write(cut.records, cut.count * RECORD_WORDS);
    this.collectWalls(cut);
    this.wallBuffer = this.walls.write(this.wallRecords, this.wallCount * WALL_WORDS);
  }

  drawGround(pass: GPURenderPassEncoder): void {
    this.drawPatches(pass, this.terrain);
  }

  drawSea(pass: GPURenderPassEncoder): void {
    this.drawPatches(pass, this.sea);
  }

  drawWalls(pass: GPURenderPassEncoder): void {
    if (this.wallCount === 0) return;
    pass.setPipeline(this.wall);
    pass.setVertexBuffer(0, this.wallBuffer);
    pass.draw(WALL_VERTICES, this.wallCount);
  }

  get triangles(): number {
    return (this.count * INDEX_COUNT) / 3;
  }

  destroy(): void {
    this.records.destroy();
    this.walls.destroy();
    this.indices.destroy();
  }

  private drawPatches(pass: GPURenderPassEncoder, pipeline: GPURenderPipeline): void {
    if (this.count === 0) return;
    pass.setPipeline(pipeline);
    pass.setVertexBuffer(0, this.recordBuffer);
    pass.setIndexBuffer(this.indices, "uint16");
    pass.drawIndexed(INDEX_COUNT, this.count);
  }

  private collectWalls(cut: Cut): void {
    this.wallCount = 0;
    for (let i = 0; i < cut.count; i += 1) {
      const border = (cut.records[i * RECORD_WORDS + 2]! >> 12) & 15;
      if (border === 0) continue;
      for (const side of [EDGE_WEST, EDGE_EAST, EDGE_SOUTH, EDGE_NORTH]) {
        if ((border & side) === 0) continue;
        if ((this.wallCount + 1) * WALL_WORDS > this.wallRecords.length) {
          const grown = new Uint32Array(this.wallRecords.length * 2);
          grown.set(this.wallRecords);
          this.wallRecords = grown;
        }
        const to = this.wallCount * WALL_WORDS;
        for (let k = 0; k < RECORD_WORDS; k += 1) this.wallRecords[to + k] = cut.records[i * RECORD_WORDS + k]!;
        this.wallRecords[to + RECORD_WORDS] = side;
        this.wallCount += 1;
      }
    }
  }
}
