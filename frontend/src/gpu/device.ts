/** Asking for a WebGPU device, with a reason a person can read when there is none. */

import { msg, str } from "@lit/localize";

/** No WebGPU here; `message` says why, in words for the page. */
export class NoWebGpu extends Error {
  override readonly name = "NoWebGpu";
}

export interface Gpu {
  readonly device: GPUDevice;
  readonly context: GPUCanvasContext;
  readonly format: GPUTextureFormat;
  readonly description: string;
  /** True for an adapter that draws on the CPU. */
  readonly software: boolean;
  /** False for devices that only have WebGPU's compatibility mode: shaders cannot read depth there. */
  readonly core: boolean;
}

/** An adapter's words for itself, shortened for the status line. */
function describe(info: GPUAdapterInfo | undefined): string {
  const words = [info?.vendor, info?.architecture, info?.device || info?.description];
  return words.filter((word) => word !== undefined && word !== "").join(" ") || "WebGPU";
}

const SOFTWARE = /swiftshader|llvmpipe|lavapipe|software|basic render/i;

async function requestAdapter(): Promise<{ adapter: GPUAdapter; core: boolean }> {
  if (!globalThis.isSecureContext) {
    throw new NoWebGpu(msg("The 3D view needs a secure page: open this terrain over https or on localhost."));
  }
  const gpu = navigator.gpu as GPU | undefined;
  if (gpu === undefined) throw new NoWebGpu(msg("This browser has no WebGPU; the map view is shown instead."));
  // Full WebGPU where it exists; else what older devices offer. Some browsers refuse the unknown option.
  for (const featureLevel of ["core", "compatibility"]) {
    try {
      const adapter = await gpu.requestAdapter({ featureLevel, powerPreference: "high-performance" });
      if (adapter !== null) return { adapter, core: featureLevel === "core" };
    } catch {
      const adapter = await gpu.requestAdapter();
      if (adapter !== null) return { adapter, core: true };
    }
  }
  throw new NoWebGpu(msg("WebGPU found no graphics device it can use; the map view is shown instead."));
}

/** Device and canvas context. Throws `NoWebGpu`. */
export async function openGpu(canvas: HTMLCanvasElement): Promise<Gpu> {
  const { adapter, core } = await requestAdapter();
  let device: GPUDevice;
  try {
    device = await adapter.requestDevice({ label: "esker" });
  } catch (error) {
    throw new NoWebGpu(msg(str`The graphics device could not be opened (${String(error)}).`));
  }
  const context = canvas.getContext("webgpu");
  if (context === null) throw new NoWebGpu(msg("The canvas cannot show WebGPU."));
  const format = navigator.gpu.getPreferredCanvasFormat();
  context.configure({
    device,
    format,
    alphaMode: "opaque",
    usage: GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_DST,
  });
  const info = adapter.info as GPUAdapterInfo | undefined;
  const description = describe(info);
  const software = info?.isFallbackAdapter === true || SOFTWARE.test(`${description} ${info?.description ?? ""}`);
  return { device, context, format, description, software, core };
}
