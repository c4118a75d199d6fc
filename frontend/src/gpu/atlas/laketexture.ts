/**
 * The lake texture, which shaders read (water/lakes.wgsl): ground and level of each sample of the domain, rg32float, metres.
 */

import { LAKE_SIDE, type Lakes } from "../../tiles/lakes/lakes.ts";

const TEXEL_BYTES = 8;

export class LakeTexture {
  texture: GPUTexture;
  #source: Lakes | null = null;

  readonly #device: GPUDevice;

  constructor(device: GPUDevice) {
    this.#device = device;
    this.texture = this.#make(1);
  }

  /** Takes over what changed. True when the texture is another one and must be bound again. */
  update(lakes: Lakes | null): boolean {
    if (lakes === null || lakes === this.#source) return false;
    this.#source = lakes;
    const grown = this.texture.width !== LAKE_SIDE;
    if (grown) {
      this.texture.destroy();
      this.texture = this.#make(LAKE_SIDE);
    }
    this.#device.queue.writeTexture(
      { texture: this.texture },
      lakeTexels(lakes),
      { bytesPerRow: TEXEL_BYTES * LAKE_SIDE },
      [LAKE_SIDE, LAKE_SIDE],
    );
    return grown;
  }

  destroy(): void {
    this.texture.destroy();
  }

  #make(side: number): GPUTexture {
    return this.#device.createTexture({
      label: "lakes",
      format: "rg32float",
      size: [side, side],
      usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
    });
  }
}

/** Two floats a sample: ground and level. */
export function lakeTexels({ heights, levels }: Lakes): Float32Array<ArrayBuffer> {
  const out = new Float32Array(2 * levels.length);
  for (let i = 0; i < levels.length; i += 1) {
    out[2 * i] = heights[i]!;
    out[2 * i + 1] = levels[i]!;
  }
  return out;
}
