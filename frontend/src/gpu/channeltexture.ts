/** Noise amplitude and roughness over the domain as one small texture (rg8unorm; `detail_at` in terrain.wgsl reads it). */

import type { ChannelView } from "../core/types.ts";

export class ChannelTexture {
  texture: GPUTexture;
  /** Metres of amplitude that the value 1 stands for. */
  fullScale = 1;
  private source: ChannelView | null = null;
  private stamp = -1;

  constructor(private readonly device: GPUDevice) {
    this.texture = this.make(2);
  }

  /** Takes over what changed. True when the texture is another one and must be bound again. */
  update(channels: ChannelView): boolean {
    if (channels === this.source && channels.stamp === this.stamp) return false;
    this.source = channels;
    this.stamp = channels.stamp;
    const { bytes, side, fullScale } = channelTexels(channels);
    this.fullScale = fullScale;
    const resized = this.texture.width !== side;
    if (resized) {
      this.texture.destroy();
      this.texture = this.make(side);
    }
    this.device.queue.writeTexture({ texture: this.texture }, bytes, { bytesPerRow: 2 * side }, [side, side]);
    return resized;
  }

  destroy(): void {
    this.texture.destroy();
  }

  private make(side: number): GPUTexture {
    return this.device.createTexture({
      label: "channels",
      format: "rg8unorm",
      size: [side, side],
      usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
    });
  }
}

/** Both channels as bytes, amplitude in parts of its greatest value. The finer of the two grids gives the side. */
export function channelTexels({ amplitude, roughness }: ChannelView): {
  bytes: Uint8Array<ArrayBuffer>;
  side: number;
  fullScale: number;
} {
  const side = Math.max(amplitude.side, roughness.side);
  // Grids are powers of two plus one, so the coarser one's samples are some of the finer one's places; between them nearest.
  const at = (grid: typeof amplitude, row: number, col: number): number => {
    const step = (grid.side - 1) / (side - 1);
    return grid.values[Math.round(row * step) * grid.side + Math.round(col * step)]!;
  };
  let greatest = 0;
  for (const v of amplitude.values) if (v > greatest) greatest = v;
  const fullScale = Math.max(greatest, 1e-3);
  const bytes = new Uint8Array(2 * side * side);
  for (let row = 0; row < side; row += 1) {
    for (let col = 0; col < side; col += 1) {
      const to = 2 * (row * side + col);
      bytes[to] = Math.round((255 * Math.max(0, at(amplitude, row, col))) / fullScale);
      bytes[to + 1] = Math.round(255 * Math.min(1, Math.max(0, at(roughness, row, col))));
    }
  }
  return { bytes, side, fullScale };
}
