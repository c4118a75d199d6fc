/** The texture of rivers, which shaders read (water/rivers.wgsl; tiles/water/rivermap.ts makes its texels). */

import type { RiverMap } from "../../core/types.ts";
import { RIVER_COLUMNS } from "../../tiles/water/rivermap.ts";

const TEXEL_BYTES = 16;

export class RiverTexture {
  texture: GPUTexture;
  #source: RiverMap | null = null;
  readonly #device: GPUDevice;

  constructor(device: GPUDevice) {
    this.#device = device;
    this.texture = this.#make(1, 1);
  }

  /** Takes over what changed. True when the texture is another one and must be bound again. */
  update(rivers: RiverMap | null): boolean {
    if (rivers === null || rivers === this.#source) return false;
    this.#source = rivers;
    const grown = this.texture.width !== RIVER_COLUMNS || this.texture.height < rivers.rows;
    if (grown) {
      this.texture.destroy();
      this.texture = this.#make(RIVER_COLUMNS, 2 ** Math.ceil(Math.log2(rivers.rows)));
    }
    this.#device.queue.writeTexture(
      { texture: this.texture },
      rivers.texels,
      { bytesPerRow: TEXEL_BYTES * RIVER_COLUMNS },
      [RIVER_COLUMNS, rivers.rows],
    );
    return grown;
  }

  destroy(): void {
    this.texture.destroy();
  }

  #make(width: number, height: number): GPUTexture {
    return this.#device.createTexture({
      label: "rivers",
      format: "rgba32float",
      size: [width, height],
      usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
    });
  }
}
