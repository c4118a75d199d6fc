/** Strokes, and the shadow of the stroke under way, as ribbons of constant width (shaders/wgsl/marks/ribbon.wgsl). */

import type { FootprintVisual, GhostVisual, Rgba, StrokeVisual } from "../../core/types.ts";
import { SOURCES } from "../shaders.ts";
import { createPass, GrowingBuffer, type PassContext } from "./pipeline.ts";

/** Floats a point: x y z, metres along, r g b a, half width, halo, opacity where hidden, 1 where a segment starts. */
const POINT_FLOATS = 12;
const STRIDE = POINT_FLOATS * 4;

export interface RibbonStyle {
  readonly colour: Rgba;
  readonly halfWidthPx: number;
  readonly haloPx: number;
  readonly hiddenOpacity: number;
}

/** Points of all lines in one array; a line of n points takes n + 2 (its ends doubled, for the joints). */
export class RibbonBuilder {
  data = new Float32Array(POINT_FLOATS * 256);
  points = 0;

  clear(): void {
    this.points = 0;
  }

  /** Appends a line of xyz triples; fewer than two points draw nothing. */
  add(xyz: Float32Array, style: RibbonStyle): void {
    const n = Math.floor(xyz.length / 3);
    if (n < 2) return;
    let along = 0;
    this.#push(xyz, 0, 0, style, false);
    for (let i = 0; i < n; i += 1) {
      if (i > 0) {
        along += Math.hypot(
          xyz[3 * i]! - xyz[3 * i - 3]!,
          xyz[3 * i + 1]! - xyz[3 * i - 2]!,
          xyz[3 * i + 2]! - xyz[3 * i - 1]!,
        );
      }
      this.#push(xyz, i, along, style, i + 1 < n);
    }
    this.#push(xyz, n - 1, along, style, false);
  }

  /** Instances to draw: one per point that could start a segment. */
  get instances(): number {
    return Math.max(0, this.points - 3);
  }

  #push(xyz: Float32Array, i: number, along: number, style: RibbonStyle, starts: boolean): void {
    const to = this.points * POINT_FLOATS;
    if (to + POINT_FLOATS > this.data.length) {
      const grown = new Float32Array(this.data.length * 2);
      grown.set(this.data);
      this.data = grown;
    }
    const { colour } = style;
    this.data[to] = xyz[3 * i]!;
    this.data[to + 1] = xyz[3 * i + 1]!;
    this.data[to + 2] = xyz[3 * i + 2]!;
    this.data[to + 3] = along;
    this.data.set(colour, to + 4);
    this.data[to + 8] = style.halfWidthPx;
    this.data[to + 9] = style.haloPx;
    this.data[to + 10] = style.hiddenOpacity;
    this.data[to + 11] = starts ? 1 : 0;
    this.points += 1;
  }
}

/** How a stroke is drawn. Selected: brighter, wider, with a halo; under way: wider; calm: a hairline, nothing of it through hills. `scale`: device pixels per unit. */
export function strokeStyle(stroke: StrokeVisual, scale: number): RibbonStyle {
  const lift = stroke.selected ? 0.35 : stroke.hovered ? 0.2 : 0;
  const [r, g, b, a] = stroke.colour;
  const brighter = (v: number): number => v + (1 - v) * lift;
  const width = stroke.selected || stroke.live ? 2 : stroke.hovered ? 1.7 : stroke.calm ? 0.7 : 1.15;
  return {
    colour: [brighter(r), brighter(g), brighter(b), lift > 0 || stroke.live ? a : 0.88 * a],
    halfWidthPx: width * scale,
    haloPx: (stroke.selected ? 7 : stroke.hovered ? 4 : 0) * scale,
    hiddenOpacity: stroke.selected || stroke.live ? 0.6 : stroke.calm ? 0 : 0.32,
  };
}

/** Outlines of grids, thin, under all strokes. (Rivers are lines on the 2D map alone: here the ground's shader draws them.) */
export function footprintStyle({ colour, strong }: FootprintVisual, scale: number): RibbonStyle {
  return {
    colour,
    halfWidthPx: (strong ? 1.5 : 0.9) * scale,
    haloPx: (strong ? 4 : 0) * scale,
    hiddenOpacity: strong ? 0.5 : 0.22,
  };
}

/** Four points in a row, each its own view of the one buffer: the one before, both ends, the one after. */
const BUFFERS: readonly GPUVertexBufferLayout[] = [0, 1, 2, 3].map((place) => {
  const attribute = (shaderLocation: number, offset: number): GPUVertexAttribute => ({
    shaderLocation,
    offset,
    format: "float32x4",
  });
  const attributes = [attribute(place, 0)];
  // Colour and style are those of the start.
  if (place === 1) attributes.push(attribute(4, 16), attribute(5, 32));
  return { arrayStride: STRIDE, stepMode: "instance", attributes };
});

export class RibbonPass {
  readonly #builder = new RibbonBuilder();
  readonly #buffer: GrowingBuffer;
  #vertices: GPUBuffer | null = null;

  readonly #shown: GPURenderPipeline;
  readonly #hidden: GPURenderPipeline;

  private constructor(device: GPUDevice, shown: GPURenderPipeline, hidden: GPURenderPipeline) {
    this.#shown = shown;
    this.#hidden = hidden;
    this.#buffer = new GrowingBuffer(device, "ribbons");
  }

  static async create(context: PassContext): Promise<RibbonPass> {
    const pipeline = (hidden: boolean): Promise<GPURenderPipeline> =>
      createPass(context, {
        label: hidden ? "ribbons behind" : "ribbons",
        code: SOURCES.ribbon,
        vertex: "ribbon_vertex",
        fragment: "ribbon_fragment",
        buffers: BUFFERS,
        fragmentConstants: { HIDDEN: hidden ? 1 : 0 },
        topology: "triangle-strip",
        blend: true,
        depthWrite: false,
        depthCompare: hidden ? "less" : "greater-equal",
      });
    const [shown, hidden] = await Promise.all([pipeline(false), pipeline(true)]);
    return new RibbonPass(context.device, shown, hidden);
  }

  /** Uploads the lines of a frame; `scale`: drawn pixels per device-independent pixel. */
  update(
    strokes: readonly StrokeVisual[],
    ghost: GhostVisual | null,
    scale: number,
    footprints: readonly FootprintVisual[] = [],
  ): void {
    this.#builder.clear();
    for (const footprint of footprints) this.#builder.add(footprint.points, footprintStyle(footprint, scale));
    if (ghost !== null) {
      this.#builder.add(ghost.shadow, {
        colour: [0.04, 0.05, 0.08, 0.55],
        halfWidthPx: 1.6 * scale,
        haloPx: 5 * scale,
        hiddenOpacity: 0.25,
      });
    }
    const order = (s: StrokeVisual): number => (s.selected ? 2 : s.hovered || s.live ? 1 : 0);
    for (const rank of [0, 1, 2]) {
      for (const stroke of strokes)
        if (order(stroke) === rank) this.#builder.add(stroke.points, strokeStyle(stroke, scale));
    }
    this.#vertices = this.#buffer.write(this.#builder.data, this.#builder.points * POINT_FLOATS);
  }

  draw(pass: GPURenderPassEncoder): void {
    if (this.#builder.instances === 0) return;
    for (const place of [0, 1, 2, 3]) pass.setVertexBuffer(place, this.#vertices, place * STRIDE);
    for (const pipeline of [this.#hidden, this.#shown]) {
      pass.setPipeline(pipeline);
      pass.draw(4, this.#builder.instances);
    }
  }

  destroy(): void {
    this.#buffer.destroy();
  }
}
