/** The sky tables, baked on the GPU whenever the sun moves (shaders/wgsl/sky/tables.wgsl). */

import type { Vec3 } from "../../core/types.ts";
import { SOURCES } from "../shaders.ts";

const WIDTH = 64;
const HEIGHT = 48;

export class SkyTables {
  readonly radiance: GPUTexture;
  /** Eight vec4f: see bake_ambient. */
  readonly ambient: GPUBuffer;
  readonly #uniform: GPUBuffer;
  readonly #bakeSky: GPUComputePipeline;
  readonly #bakeAmbient: GPUComputePipeline;
  readonly #skyGroup: GPUBindGroup;
  readonly #ambientGroup: GPUBindGroup;
  #baked = "";

  private constructor(device: GPUDevice, bakeSky: GPUComputePipeline, bakeAmbient: GPUComputePipeline) {
    this.#bakeSky = bakeSky;
    this.#bakeAmbient = bakeAmbient;
    this.radiance = device.createTexture({
      label: "sky radiance",
      size: [WIDTH, HEIGHT],
      format: "rgba16float",
      usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.STORAGE_BINDING,
    });
    this.ambient = device.createBuffer({
      label: "skylight",
      size: 8 * 16,
      usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.STORAGE,
    });
    this.#uniform = device.createBuffer({
      label: "sky job",
      size: 16,
      usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST,
    });
    const sun = { binding: 0, resource: { buffer: this.#uniform } };
    this.#skyGroup = device.createBindGroup({
      layout: bakeSky.getBindGroupLayout(0),
      entries: [sun, { binding: 1, resource: this.radiance.createView() }],
    });
    this.#ambientGroup = device.createBindGroup({
      layout: bakeAmbient.getBindGroupLayout(0),
      entries: [
        sun,
        { binding: 2, resource: this.radiance.createView() },
        { binding: 3, resource: { buffer: this.ambient } },
      ],
    });
  }

  static async create(device: GPUDevice): Promise<SkyTables> {
    const module = device.createShaderModule({ label: "sky", code: SOURCES.sky });
    const pipeline = (entryPoint: string): Promise<GPUComputePipeline> =>
      device.createComputePipelineAsync({ label: entryPoint, layout: "auto", compute: { module, entryPoint } });
    const [sky, ambient] = await Promise.all([pipeline("bake_sky"), pipeline("bake_ambient")]);
    return new SkyTables(device, sky, ambient);
  }

  /** Bakes for this sun unless it is the one baked last. */
  bake(device: GPUDevice, encoder: GPUCommandEncoder, sun: Vec3): void {
    const key = sun.join();
    if (key === this.#baked) return;
    this.#baked = key;
    device.queue.writeBuffer(this.#uniform, 0, new Float32Array([...sun, 0]));
    const pass = encoder.beginComputePass({ label: "sky" });
    pass.setPipeline(this.#bakeSky);
    pass.setBindGroup(0, this.#skyGroup);
    pass.dispatchWorkgroups(WIDTH / 8, HEIGHT / 8);
    pass.setPipeline(this.#bakeAmbient);
    pass.setBindGroup(0, this.#ambientGroup);
    pass.dispatchWorkgroups(1);
    pass.end();
  }

  destroy(): void {
    this.radiance.destroy();
    this.ambient.destroy();
    this.#uniform.destroy();
  }
}
