/** What of the ground's surface is drawn is a choice of the device: what is off costs nothing (SPEC R614). */

import { beforeAll, describe, expect, it } from "vitest";
import type { Scene, SurfaceChoice } from "../../src/core/types.ts";
import type { Atlas } from "../../src/gpu/atlas/atlas.ts";
import type { FrameBindings } from "../../src/gpu/frame.ts";
import type { InstancePass } from "../../src/gpu/passes/instances.ts";
import type { Clothes, PatchPasses } from "../../src/gpu/passes/patches.ts";
import type { PassContext } from "../../src/gpu/passes/pipeline.ts";
import { SurfaceParts } from "../../src/gpu/surface.ts";

beforeAll(() => {
  const flags = new Proxy({}, { get: () => 1 });
  Object.assign(globalThis, { GPUTextureUsage: flags, GPUBufferUsage: flags, GPUShaderStage: flags });
});

/** The parts on an adapter whose device only writes down of which shaders and textures it was asked. */
class Adapter {
  readonly shaders: string[] = [];
  readonly textures: string[] = [];
  readonly parts: SurfaceParts;

  constructor(software: boolean) {
    const made = { destroy: () => undefined };
    const device = {
      queue: { writeBuffer: () => undefined, writeTexture: () => undefined },
      createBuffer: () => made,
      createTexture: ({ label }: GPUTextureDescriptor) => {
        this.textures.push(String(label));
        return made;
      },
      createShaderModule: ({ label }: GPUShaderModuleDescriptor) => {
        this.shaders.push(String(label));
        return {};
      },
      createBindGroupLayout: () => ({}),
      createPipelineLayout: () => ({}),
      createComputePipelineAsync: async () => ({}),
      createRenderPipelineAsync: async () => ({}),
    };
    const context = { device, frameLayout: {}, format: "bgra8unorm", samples: 1, detail: "plain" };
    const frame = { useStones: () => undefined, bindGroup: {} };
    this.parts = new SurfaceParts(context as unknown as PassContext, frame as unknown as FrameBindings, software);
  }

  /** One frame: what the ground wears in it, and what stands on it. */
  draw(surface?: SurfaceChoice): { worn: Clothes; planted: InstancePass | null } {
    const scene = { surface, settings: { look: "natural" }, tiles: { sizeM: 4096 } } as unknown as Scene;
    const patches = { dress: (wanted: Clothes) => wanted, records: { buffer: null, count: 0 } };
    const worn = this.parts.dress(scene, patches as unknown as PatchPasses);
    const encoder = {} as GPUCommandEncoder;
    return { worn, planted: this.parts.plant(encoder, scene, {} as Atlas, patches as unknown as PatchPasses) };
  }

  /** Two frames with time between them in which pipelines are made. */
  async drawTwice(surface?: SurfaceChoice): Promise<{ worn: Clothes; planted: InstancePass | null }> {
    this.draw(surface);
    await new Promise((resolve) => setTimeout(resolve));
    return this.draw(surface);
  }
}

describe("R614: trees, rocks, tufts and rich materials", () => {
  const off: SurfaceChoice = { materials: false, shade: true, instances: false };
  const on: SurfaceChoice = { materials: true, shade: true, instances: true };

  it("that somebody turned off are not drawn, and no shader of them is made", async () => {
    const adapter = new Adapter(false);
    const { worn, planted } = await adapter.drawTwice(off);
    expect(worn.detail).toBe("plain");
    expect(planted).toBeNull();
    expect(adapter.shaders).toEqual([]);
    expect(adapter.parts.due).toBe(false);
  });

  it("are on where nobody chose, if the adapter is a graphics device", async () => {
    const adapter = new Adapter(false);
    const { worn, planted } = await adapter.drawTwice();
    expect(worn.detail).toBe("rich");
    expect(planted).not.toBeNull();
    expect(adapter.shaders).toEqual(["scatter", "tree", "impostor", "rock", "tuft"]);
    expect(adapter.parts.due).toBe(false);
  });

  it("are off where nobody chose, if the processor draws", async () => {
    const adapter = new Adapter(true);
    const { worn, planted } = await adapter.drawTwice();
    expect(worn.detail).toBe("plain");
    expect(planted).toBeNull();
    expect([adapter.shaders, adapter.textures]).toEqual([[], []]);
  });

  it("come where somebody asks for them, also of a processor, and go again", async () => {
    const adapter = new Adapter(true);
    adapter.draw(on);
    expect(adapter.parts.due).toBe(true); // the shaders of what stands there are still being made
    const { worn, planted } = await adapter.drawTwice(on);
    expect(worn.detail).toBe("rich");
    expect(planted).not.toBeNull();
    expect(adapter.textures).toEqual(["stones"]);
    expect(adapter.draw(off).planted).toBeNull();
    expect(adapter.draw(off).worn.detail).toBe("plain");
  });
});
