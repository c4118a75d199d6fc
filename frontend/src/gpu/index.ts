/** Makes the renderers of the page: the 3D view, and the map for browsers without WebGPU. */

import type { SceneRenderer } from "../core/types.ts";
import { NoWebGpu, openGpu } from "./device.ts";
import { createMapRenderer } from "./map/map.ts";
import { GpuRenderer } from "./renderer.ts";

export { createMapRenderer, NoWebGpu };

/** The WebGPU renderer on this canvas. Throws `NoWebGpu` with a reason a person can read. */
export async function createRenderer(canvas: HTMLCanvasElement): Promise<SceneRenderer> {
  const gpu = await openGpu(canvas);
  try {
    return await GpuRenderer.create(canvas, gpu);
  } catch (error) {
    gpu.device.destroy();
    throw error;
  }
}
