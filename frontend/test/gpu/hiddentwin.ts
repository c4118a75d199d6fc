/** Twin of hidden/hidden.wgsl in float64, and its comparison with the device on pictures of depth made up for it (SPEC R59). */

import { eyeProjection, reversedDepth } from "../../src/core/camera/projection.ts";
import type { CameraState } from "../../src/core/types.ts";
import { MAX_SYNTHESIS_LEVEL, PATCH_CELLS, TILE_CELLS } from "../../src/generated/contract.ts";
import { StructWriter, structLayout } from "../../src/gpu/layout.ts";
import { HiddenPatches, pyramidLevels } from "../../src/gpu/passes/hidden.ts";
import { INDEX_COUNT } from "../../src/gpu/passes/patches.ts";
import { VIEW_SOURCE } from "../../src/gpu/shaders.ts";
import { FACT_WORDS, recordColumn, recordLevel, recordRow } from "../../src/tiles/patches/records.ts";
import { type Cut, Selection } from "../../src/tiles/patches/selection.ts";
import { FieldView, filteredField, lookAt, random } from "./world.ts";

const [WIDTH, HEIGHT] = [301, 203];
const SIZE = 4096;

/** Farthest depth under each texel of 4 x 4 pixels, and of each level above: all levels one after the other. */
export function pyramidTwin(depth: Float32Array, width: number, height: number): Float32Array {
  const levels = pyramidLevels(width, height);
  const [at, w, h] = levels.at(-1)!;
  const out = new Float32Array(at + w * h).fill(1);
  levels.forEach(([offset, columns], k) => {
    const pixels = 4 * 2 ** k;
    for (let y = 0; y < height; y += 1) {
      for (let x = 0; x < width; x += 1) {
        const texel = offset + Math.floor(y / pixels) * columns + Math.floor(x / pixels);
        out[texel] = Math.min(out[texel]!, depth[y * width + x]!);
      }
    }
  });
  return out;
}

/** Whether a box [low, high] over a square of the ground lies behind the depth in all pixels within `margin` of it. */
function boxHidden(
  camera: CameraState,
  box: { x: number; y: number; w: number; low: number; high: number },
  depth: Float32Array,
  margin: number,
): boolean {
  const m = reversedDepth(eyeProjection(camera));
  let [x0, y0, x1, y1, nearest] = [1e9, 1e9, -1e9, -1e9, 0];
  for (let k = 0; k < 8; k += 1) {
    const x = box.x + (k & 1 ? box.w : 0) - camera.eye[0];
    const y = box.y + (k & 2 ? box.w : 0) - camera.eye[1];
    const z = (k & 4 ? box.high : box.low) - camera.eye[2];
    const clip = (row: number): number => m[row]! * x + m[4 + row]! * y + m[8 + row]! * z + m[12 + row]!;
    const w = clip(3);
    if (w <= 0 || clip(2) >= w) return false;
    const [px, py] = [(0.5 + (0.5 * clip(0)) / w) * WIDTH, (0.5 - (0.5 * clip(1)) / w) * HEIGHT];
    [x0, y0, x1, y1] = [Math.min(x0, px), Math.min(y0, py), Math.max(x1, px), Math.max(y1, py)];
    nearest = Math.max(nearest, clip(2) / w);
  }
  nearest *= 1 + 1e-4 * margin;
  for (let y = Math.max(0, Math.floor(y0 - margin)); y < Math.min(HEIGHT, y1 + margin); y += 1)
    for (let x = Math.max(0, Math.floor(x0 - margin)); x < Math.min(WIDTH, x1 + margin); x += 1)
      if (depth[y * WIDTH + x]! < nearest) return false;
  return true;
}

/** Depth in blocks: walls at random distances, some holes to the sky. */
const PATTERN = /* wgsl */ `
struct Out { @builtin(frag_depth) depth: f32 };
@vertex fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
override SEED: u32 = 1u;
fn wall(p: vec2f) -> f32 {
  let b = vec2u(p / vec2f(70.0, 90.0));
  let h = (b.x * 374761393u + b.y * 668265263u + SEED * 2246822519u);
  let v = ((h ^ (h >> 13u)) * 1274126177u) >> 16u;
  return select(0.0006 * exp2(f32(v % 64u) / 12.0), 0.0, v % 7u == 0u) * (1.0 - 0.0001 * p.x);
}
@fragment fn plain(@builtin(position) p: vec4f) -> Out { return Out(wall(floor(p.xy))); }
@fragment fn sampled(@builtin(position) p: vec4f, @builtin(sample_index) k: u32) -> Out {
  return Out(wall(floor(p.xy)) * (1.0 - 0.1 * f32(k)));
}
`;

function drawDepth(device: GPUDevice, encoder: GPUCommandEncoder, samples: number, seed: number): GPUTexture {
  const module = device.createShaderModule({ code: PATTERN });
  const texture = device.createTexture({
    size: [WIDTH, HEIGHT],
    format: "depth32float",
    sampleCount: samples,
    usage: GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_SRC,
  });
  const pipeline = device.createRenderPipeline({
    layout: "auto",
    vertex: { module, entryPoint: "corner" },
    fragment: { module, entryPoint: samples > 1 ? "sampled" : "plain", constants: { SEED: seed }, targets: [] },
    depthStencil: { format: "depth32float", depthWriteEnabled: true, depthCompare: "always" },
    multisample: { count: samples },
  });
  const pass = encoder.beginRenderPass({
    colorAttachments: [],
    depthStencilAttachment: {
      view: texture.createView(),
      depthClearValue: 0,
      depthLoadOp: "clear",
      depthStoreOp: "store",
    },
  });
  pass.setPipeline(pipeline);
  pass.draw(3);
  pass.end();
  return texture;
}

async function read(device: GPUDevice, source: GPUBuffer): Promise<ArrayBuffer> {
  const into = device.createBuffer({ size: source.size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
  const encoder = device.createCommandEncoder();
  encoder.copyBufferToBuffer(source, 0, into, 0, source.size);
  device.queue.submit([encoder.finish()]);
  await into.mapAsync(GPUMapMode.READ);
  const out = into.getMappedRange().slice(0);
  into.destroy();
  return out;
}

function viewBuffer(device: GPUDevice, camera: CameraState): GPUBuffer {
  const writer = new StructWriter(structLayout(VIEW_SOURCE, "View"));
  const cell = SIZE / (TILE_CELLS << MAX_SYNTHESIS_LEVEL);
  const whole = [camera.eye[0], camera.eye[1]].map((v) => Math.floor(v / cell));
  writer.set("eye_proj", reversedDepth(eyeProjection(camera)));
  writer.set("eye", [...camera.eye, 0]);
  writer.set("eye_low", [...camera.eye.map((v) => v - Math.fround(v)), 0]);
  writer.set("eye_cell", whole);
  writer.set("eye_part", [camera.eye[0] - whole[0]! * cell, camera.eye[1] - whole[1]! * cell]);
  writer.set("finest_cell", cell);
  const usage = GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST;
  const buffer = device.createBuffer({ size: writer.layout.size, usage });
  device.queue.writeBuffer(buffer, 0, writer.buffer);
  return buffer;
}

/** The depth of the pattern, the farthest of a pixel's samples, by the twin's own arithmetic in float32. */
async function depthOf(device: GPUDevice, seed: number): Promise<Float32Array> {
  const encoder = device.createCommandEncoder();
  const texture = drawDepth(device, encoder, 1, seed);
  const pitch = Math.ceil((4 * WIDTH) / 256) * 256;
  const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.COPY_SRC;
  const buffer = device.createBuffer({ size: pitch * HEIGHT, usage });
  encoder.copyTextureToBuffer({ texture, aspect: "depth-only" }, { buffer, bytesPerRow: pitch }, [WIDTH, HEIGHT]);
  device.queue.submit([encoder.finish()]);
  const rows = new Float32Array(await read(device, buffer));
  const out = new Float32Array(WIDTH * HEIGHT);
  for (let y = 0; y < HEIGHT; y += 1) out.set(rows.subarray((y * pitch) / 4, (y * pitch) / 4 + WIDTH), y * WIDTH);
  return out;
}

export interface HiddenReport {
  patches: number;
  hidden: number;
  /** Largest difference of a texel of the pyramid, relative. */
  pyramid: number;
  /** Patches left out that a box without any margin shows; must be 0. */
  lost: number;
  /** Patches drawn that are hidden with room to spare. */
  missed: number;
  /** Patches that neither round, or both, should have. */
  misplaced: number;
}

function boxOf(cut: Cut, bounds: Float32Array, i: number): Parameters<typeof boxHidden>[1] {
  const cell = SIZE / (TILE_CELLS << recordLevel(cut.records, i));
  return {
    x: recordColumn(cut.records, i) * cell,
    y: recordRow(cut.records, i) * cell,
    w: PATCH_CELLS * cell,
    low: bounds[FACT_WORDS * i]!,
    high: bounds[FACT_WORDS * i + 1]!,
  };
}

/** Runs both rounds on made-up depths, twice: with nothing known, then with what the first run found. */
export async function hiddenTwin(seed: number, samples: 1 | 4): Promise<HiddenReport> {
  const device = await (await navigator.gpu.requestAdapter())!.requestDevice();
  device.addEventListener("uncapturederror", (event) => {
    throw new Error(event.error.message);
  });
  const next = random(seed);
  const view = new FieldView(SIZE, 3, filteredField(seed, 300));
  const selection = new Selection(3);
  for (const tile of view.tiles()) selection.tree.setUsable(tile.level, tile.x, tile.y, true);
  const eye = [600 + 900 * next(), 600 + 900 * next(), 420] as const;
  const camera = lookAt([...eye], [eye[0] + 1, eye[1] + 0.8, 419.8], WIDTH, HEIGHT, 55);
  selection.occlusion = false;
  const cut = selection.select(view, camera, 1, { slot: () => 0, touch: () => {} });
  const bounds = new Float32Array(cut.facts.buffer);
  const hidden = await HiddenPatches.create(device, viewBuffer(device, camera), samples, INDEX_COUNT);
  const report: HiddenReport = { patches: 0, hidden: 0, pyramid: 0, lost: 0, missed: 0, misplaced: 0 };
  let seen: boolean[] = Array.from({ length: cut.count }, (_, i) => i < Math.ceil(cut.count / 3));
  for (let run = 0; run < 2; run += 1) {
    const drawn = await depthOf(device, seed + run);
    // In float32 as the shader: the farthest of the samples.
    const depth = samples === 1 ? drawn : drawn.map((d) => Math.fround(d * 0.7));
    const encoder = device.createCommandEncoder();
    const texture = drawDepth(device, encoder, samples, seed + run);
    hidden.update(cut, selection.tree.capacity * 16, WIDTH, HEIGHT);
    hidden.first(encoder);
    hidden.second(encoder, texture.createView());
    device.queue.submit([encoder.finish()]);
    const { state } = hidden;
    const pyramid = new Float32Array(await read(device, state.pyramid));
    const bits = new Uint32Array(await read(device, state.bits));
    pyramidTwin(depth, WIDTH, HEIGHT).forEach((d, k) => {
      report.pyramid = Math.max(report.pyramid, Math.abs(d - pyramid[k]!) / Math.max(d, 1e-6));
    });
    const marked = (list: number, i: number): boolean => (bits[list * state.words + (i >> 5)]! & (1 << (i & 31))) !== 0;
    for (let i = 0; i < cut.count; i += 1) {
      const [first, second] = [marked(0, i), marked(1, i)];
      const box = boxOf(cut, bounds, i);
      if (first !== seen[i] || (first && second)) report.misplaced += 1;
      report.patches += 1;
      if (first) continue;
      if (!second) {
        report.hidden += 1;
        if (!boxHidden(camera, box, depth, 0)) report.lost += 1;
      } else if (boxHidden(camera, box, depth, 40)) report.missed += 1;
    }
    const known = new Uint32Array(await read(device, hidden.state.known));
    seen = Array.from({ length: cut.count }, (_, i) => known[cut.facts[FACT_WORDS * i + 2]!] === 2);
  }
  device.destroy();
  return report;
}
