/** The coarse relief of a grid that is being placed (shaders/wgsl/marks/placing.wgsl). */

import type { PlacingVisual } from "../../core/types.ts";
import { SOURCES } from "../shaders.ts";
import { createPass, GrowingBuffer, type PassContext } from "./pipeline.ts";

/** Floats a vertex: x y z, cells east and north, shade, r g b a. */
export const PLACING_FLOATS = 10;

/** Direction to the light of the picture: from the north-west, half-way up, as on printed maps. */
const LIGHT = [-0.5, 0.5, Math.SQRT1_2] as const;

/**
 * How bright each point of the picture is, 0..1 [row, col]: the share of a light from the north-west that it takes. NaN without
 * data.
 */
export function placingShades({ side, points }: PlacingVisual): Float32Array {
  const out = new Float32Array(side * side).fill(Number.NaN);
  const z = (row: number, col: number): number => points[3 * (row * side + col) + 2]!;
  for (let row = 0; row < side; row++)
    for (let col = 0; col < side; col++) {
      if (Number.isNaN(z(row, col))) continue;
      const n = normal(points, side, row, col);
      const facing = n[0] * LIGHT[0] + n[1] * LIGHT[1] + n[2] * LIGHT[2];
      out[row * side + col] = Math.max(0, facing);
    }
  return out;
}

/** Unit normal from the neighbours that hold data; up where there are none. */
function normal(points: Float32Array, side: number, row: number, col: number): [number, number, number] {
  const here = 3 * (row * side + col);
  const step = (dr: number, dc: number): [number, number, number] => {
    const [r, c] = [row + dr, col + dc];
    const at = r < 0 || c < 0 || r >= side || c >= side ? here : 3 * (r * side + c);
    const to = Number.isNaN(points[at + 2]!) ? here : at;
    return [points[to]!, points[to + 1]!, points[to + 2]!];
  };
  const minus = (a: number[], b: number[]): number[] => a.map((v, k) => v - b[k]!);
  const e = minus(step(0, 1), step(0, -1));
  const n = minus(step(1, 0), step(-1, 0));
  const up = [e[1]! * n[2]! - e[2]! * n[1]!, e[2]! * n[0]! - e[0]! * n[2]!, e[0]! * n[1]! - e[1]! * n[0]!];
  const length = Math.hypot(up[0]!, up[1]!, up[2]!);
  return length > 0 ? [up[0]! / length, up[1]! / length, up[2]! / length] : [0, 0, 1];
}

/** Two triangles a cell, of the cells whose four corners hold data. */
export function placingVertices(placed: PlacingVisual): Float32Array {
  const { side, points, colour } = placed;
  const shades = placingShades(placed);
  const out: number[] = [];
  const put = (row: number, col: number): void => {
    const i = row * side + col;
    out.push(points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!, col, row, shades[i]!, ...colour);
  };
  for (let row = 0; row + 1 < side; row++)
    for (let col = 0; col + 1 < side; col++) {
      const i = row * side + col;
      if ([i, i + 1, i + side, i + side + 1].some((k) => Number.isNaN(shades[k]!))) continue;
      put(row, col);
      put(row, col + 1);
      put(row + 1, col + 1);
      put(row, col);
      put(row + 1, col + 1);
      put(row + 1, col);
    }
  return new Float32Array(out);
}

export class PlacingPass {
  readonly #buffer: GrowingBuffer;
  #vertices: GPUBuffer | null = null;
  #count = 0;
  #held: PlacingVisual | null = null;

  readonly #shown: GPURenderPipeline;
  readonly #behind: GPURenderPipeline;

  private constructor(device: GPUDevice, shown: GPURenderPipeline, behind: GPURenderPipeline) {
    this.#shown = shown;
    this.#behind = behind;
    this.#buffer = new GrowingBuffer(device, "placing");
  }

  static async create(context: PassContext): Promise<PlacingPass> {
    const attribute = (shaderLocation: number, offset: number, format: GPUVertexFormat): GPUVertexAttribute => ({
      shaderLocation,
      offset,
      format,
    });
    const pipeline = (behind: boolean): Promise<GPURenderPipeline> =>
      createPass(context, {
        label: behind ? "placing behind" : "placing",
        code: SOURCES.placing,
        vertex: "placing_vertex",
        fragment: "placing_fragment",
        buffers: [
          {
            arrayStride: PLACING_FLOATS * 4,
            attributes: [attribute(0, 0, "float32x3"), attribute(1, 12, "float32x3"), attribute(2, 24, "float32x4")],
          },
        ],
        fragmentConstants: { BEHIND: behind ? 1 : 0 },
        blend: true,
        depthWrite: !behind,
        depthCompare: behind ? "less" : "greater-equal",
      });
    const [shown, behind] = await Promise.all([pipeline(false), pipeline(true)]);
    return new PlacingPass(context.device, shown, behind);
  }

  update(placed: PlacingVisual | null): void {
    if (placed === this.#held) return;
    this.#held = placed;
    const data = placed === null ? new Float32Array() : placingVertices(placed);
    this.#count = data.length / PLACING_FLOATS;
    if (this.#count > 0) this.#vertices = this.#buffer.write(data, data.length);
  }

  draw(pass: GPURenderPassEncoder): void {
    if (this.#count === 0) return;
    pass.setVertexBuffer(0, this.#vertices);
    for (const pipeline of [this.#behind, this.#shown]) {
      pass.setPipeline(pipeline);
      pass.draw(this.#count);
    }
  }

  destroy(): void {
    this.#buffer.destroy();
  }
}
