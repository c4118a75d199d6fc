/** The dense reference: every triangle of a grid, gradients by central differences, the plain shading. */

import type { CameraState, Vec3 } from "../../src/core/types.ts";
import { LAMBERT } from "./lambert.ts";

export interface DenseGround {
  /** (side)² heights, row 0 south, metres. */
  readonly heights: Float32Array;
  readonly side: number;
  readonly sizeM: number;
  readonly width: number;
  readonly height: number;
  readonly sun: Vec3;
  readonly camera: CameraState;
}

const CODE = /* wgsl */ `
struct Dense { proj: mat4x4f, sun: vec4f, side: u32, cell: f32 };
@group(0) @binding(0) var<uniform> dense: Dense;
@group(0) @binding(1) var<storage, read> grid: array<f32>;
@group(0) @binding(2) var gradients: texture_2d<f32>;
@group(0) @binding(3) var smooth_clamp: sampler;

struct DenseVertex { @builtin(position) position: vec4f, @location(0) uv: vec2f };

@vertex
fn dense_vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) row: u32) -> DenseVertex {
  // Six vertices a cell, cut from its south-east to its north-west corner.
  let corner = array(vec2u(0, 0), vec2u(1, 0), vec2u(0, 1), vec2u(0, 1), vec2u(1, 0), vec2u(1, 1))[index % 6u];
  let at = vec2u(index / 6u, row) + corner;
  let place = vec3f(vec2f(at) * dense.cell, grid[at.y * dense.side + at.x]);
  return DenseVertex(dense.proj * vec4f(place, 1.0), (vec2f(at) + 0.5) / f32(dense.side));
}

@fragment
fn dense_fragment(v: DenseVertex) -> @location(0) vec4f {
  return lambert(textureSampleLevel(gradients, smooth_clamp, v.uv, 0.0).xy, dense.sun.xyz);
}
`;

/** (dz/dx, dz/dy) at every sample as half floats, one-sided on the border. */
function gradients({ heights, side, sizeM }: DenseGround): Uint16Array<ArrayBuffer> {
  const cell = sizeM / (side - 1);
  const out = new Float16Array(2 * side * side);
  for (let j = 0; j < side; j += 1) {
    for (let i = 0; i < side; i += 1) {
      const [w, e] = [Math.max(0, i - 1), Math.min(side - 1, i + 1)];
      const [s, n] = [Math.max(0, j - 1), Math.min(side - 1, j + 1)];
      const k = 2 * (j * side + i);
      out[k] = (heights[j * side + e]! - heights[j * side + w]!) / ((e - w) * cell);
      out[k + 1] = (heights[n * side + i]! - heights[s * side + i]!) / ((n - s) * cell);
    }
  }
  return new Uint16Array(out.buffer);
}

function bind(device: GPUDevice, ground: DenseGround, layout: GPUBindGroupLayout): GPUBindGroup {
  const { side, heights, sizeM, sun, camera } = ground;
  const uniform = device.createBuffer({ size: 96, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
  const words = new ArrayBuffer(96);
  const length = Math.hypot(...sun);
  new Float32Array(words).set([...camera.viewProj, ...sun.map((v) => v / length), 0]);
  new Uint32Array(words)[20] = side;
  new Float32Array(words)[21] = sizeM / (side - 1);
  device.queue.writeBuffer(uniform, 0, words);
  const grid = device.createBuffer({
    size: heights.byteLength,
    usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST,
  });
  device.queue.writeBuffer(grid, 0, heights as Float32Array<ArrayBuffer>);
  const slope = device.createTexture({
    size: [side, side],
    format: "rg16float",
    usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
  });
  device.queue.writeTexture({ texture: slope }, gradients(ground), { bytesPerRow: 4 * side }, [side, side]);
  const resources = [
    { buffer: uniform },
    { buffer: grid },
    slope.createView(),
    device.createSampler({ magFilter: "linear", minFilter: "linear" }),
  ];
  return device.createBindGroup({ layout, entries: resources.map((resource, binding) => ({ binding, resource })) });
}

/** The picture as a PNG data URL. */
export async function drawReference(ground: DenseGround): Promise<string> {
  const { width, height, side } = ground;
  const device = await (await navigator.gpu.requestAdapter())!.requestDevice();
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const context = canvas.getContext("webgpu")!;
  const format = navigator.gpu.getPreferredCanvasFormat();
  context.configure({ device, format, alphaMode: "opaque" });
  const module = device.createShaderModule({ code: LAMBERT.shading + CODE });
  const pipeline = await device.createRenderPipelineAsync({
    layout: "auto",
    vertex: { module },
    fragment: { module, targets: [{ format }] },
    depthStencil: { format: "depth32float", depthWriteEnabled: true, depthCompare: "less" },
  });
  const depth = device.createTexture({
    size: [width, height],
    format: "depth32float",
    usage: GPUTextureUsage.RENDER_ATTACHMENT,
  });
  const encoded = (v: number): number => 1.055 * v ** (1 / 2.4) - 0.055;
  const encoder = device.createCommandEncoder();
  const pass = encoder.beginRenderPass({
    colorAttachments: [
      {
        view: context.getCurrentTexture().createView(),
        clearValue: [encoded(0.6), encoded(0.75), encoded(0.9), 1],
        loadOp: "clear",
        storeOp: "store",
      },
    ],
    depthStencilAttachment: {
      view: depth.createView(),
      depthClearValue: 1,
      depthLoadOp: "clear",
      depthStoreOp: "discard",
    },
  });
  pass.setPipeline(pipeline);
  pass.setBindGroup(0, bind(device, ground, pipeline.getBindGroupLayout(0)));
  pass.draw(6 * (side - 1), side - 1);
  pass.end();
  device.queue.submit([encoder.finish()]);
  const url = canvas.toDataURL("image/png");
  device.destroy();
  return url;
}
