/**
 * One small texture over the whole domain, which the ground's overlays read (rgba8unorm; `detail_at` in ground/terrain.wgsl):
 * noise amplitude, roughness, where the selected stroke is felt, a channel is painted or a watershed lies, and how far contours show.
 */

import type { ChannelGrid, ChannelView, PaintedOverlay, Scene } from "../../core/types.ts";
import { sharesOf } from "../../tiles/flat.ts";
import { LOOKS } from "../looks.ts";

const TEXEL_BYTES = 4;

const shares = new WeakMap<ChannelGrid, ChannelGrid>();

const PAINTED: readonly string[] = ["snow", "forest", "grass", "wetness", "erosion"] satisfies PaintedOverlay[];

function isPainted(overlay: Scene["overlay"]): overlay is PaintedOverlay {
  return PAINTED.includes(overlay);
}

/** The third component of the texture: influence, or a painted channel as 0.5 + bias / 2; null with other overlays. */
export function overlayGrid({ overlay, influence, channels }: Scene): ChannelGrid | null {
  if (overlay === "influence" || overlay === "watershed" || overlay === "difference") return influence ?? null;
  if (!isPainted(overlay)) return null;
  const grid = channels[overlay];
  const known = shares.get(grid);
  if (known !== undefined) return known;
  const made = { side: grid.side, values: grid.values.map((bias) => 0.5 + bias / 2) };
  shares.set(grid, made);
  return made;
}

/** How far contours show, over the domain: not on flat ground. Null where there are none to be drawn. */
export function contourShares({ tiles, overlay, settings }: Scene, everyM: number): ChannelGrid | null {
  const drawn = overlay === "contours" || LOOKS[settings.look].contours > 0;
  return drawn ? sharesOf(tiles, everyM) : null;
}

export class ChannelTexture {
  texture: GPUTexture;
  /** Metres of amplitude that the value 1 stands for. */
  fullScale = 1;
  #source: ChannelView | null = null;
  #stamp = -1;
  #influence: ChannelGrid | null = null;
  #contours: ChannelGrid | null = null;

  readonly #device: GPUDevice;

  constructor(device: GPUDevice) {
    this.#device = device;
    this.texture = this.#make(2);
  }

  /** Takes over what changed. True when the texture is another one and must be bound again. */
  update(channels: ChannelView, influence: ChannelGrid | null, contours: ChannelGrid | null = null): boolean {
    const same = channels === this.#source && channels.stamp === this.#stamp;
    if (same && influence === this.#influence && contours === this.#contours) return false;
    this.#source = channels;
    this.#stamp = channels.stamp;
    this.#influence = influence;
    this.#contours = contours;
    const { bytes, side, fullScale } = channelTexels(channels, influence, contours);
    this.fullScale = fullScale;
    const resized = this.texture.width !== side;
    if (resized) {
      this.texture.destroy();
      this.texture = this.#make(side);
    }
    this.#device.queue.writeTexture({ texture: this.texture }, bytes, { bytesPerRow: TEXEL_BYTES * side }, [
      side,
      side,
    ]);
    return resized;
  }

  destroy(): void {
    this.texture.destroy();
  }

  #make(side: number): GPUTexture {
    return this.#device.createTexture({
      label: "channels",
      format: "rgba8unorm",
      size: [side, side],
      usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
    });
  }
}

/**
 * Four bytes a sample: amplitude in parts of its greatest value, roughness, influence (0 without one), contours (all of them
 * without one). The finest of the grids gives the side.
 */
export function channelTexels(
  { amplitude, roughness }: ChannelView,
  influence: ChannelGrid | null = null,
  contours: ChannelGrid | null = null,
): { bytes: Uint8Array<ArrayBuffer>; side: number; fullScale: number } {
  const side = Math.max(amplitude.side, roughness.side, influence?.side ?? 0, contours?.side ?? 0);
  let greatest = 0;
  for (const v of amplitude.values) if (v > greatest) greatest = v;
  const fullScale = Math.max(greatest, 1e-3);
  const bytes = new Uint8Array(TEXEL_BYTES * side * side).fill(255);
  const fill = (channel: number, grid: ChannelGrid | null, scale: number): void => {
    for (let row = 0; row < side; row += 1) {
      for (let col = 0; col < side; col += 1) {
        const value = grid === null ? 0 : sampleOf(grid, row / (side - 1), col / (side - 1)) * scale;
        bytes[TEXEL_BYTES * (row * side + col) + channel] = Math.round(255 * Math.min(1, Math.max(0, value)));
      }
    }
  };
  fill(0, amplitude, 1 / fullScale);
  fill(1, roughness, 1);
  fill(2, influence, 1);
  if (contours !== null) fill(3, contours, 1);
  return { bytes, side, fullScale };
}

/** Bilinear; `v` from south to north and `u` from west to east, 0..1. */
export function sampleOf({ side, values }: ChannelGrid, v: number, u: number): number {
  const [y, x] = [v * (side - 1), u * (side - 1)];
  const j = Math.min(side - 2, Math.floor(y));
  const i = Math.min(side - 2, Math.floor(x));
  const [s, t] = [x - i, y - j];
  const k = j * side + i;
  const south = values[k]! + (values[k + 1]! - values[k]!) * s;
  const north = values[k + side]! + (values[k + side + 1]! - values[k + side]!) * s;
  return south + (north - south) * t;
}
