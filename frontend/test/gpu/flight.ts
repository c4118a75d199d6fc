/** A flight low over endless ground: that memory stays bounded, and that a picture at rest does not flicker (SPEC R49, R56). */

import type { CameraState, FrameStats, Scene, TileView, Vec3 } from "../../src/core/types.ts";
import type { GpuRenderer } from "../../src/gpu/renderer.ts";
import { lookAt } from "./world.ts";

/** What the page holds on the device, bytes. */
export class Tally {
  bytes = 0;

  /** Counts what is made on a device from now on, until it is destroyed. */
  constructor(device: GPUDevice) {
    const buffer = device.createBuffer.bind(device);
    device.createBuffer = (d) => this.keep(buffer(d), d.size);
    const texture = device.createTexture.bind(device);
    device.createTexture = (d) => {
      const made = texture(d);
      const texels = made.width * made.height * made.depthOrArrayLayers;
      return this.keep(made, texels * made.sampleCount * texelBytes(made.format));
    };
  }

  private keep<T extends { destroy(): undefined }>(made: T, bytes: number): T {
    this.bytes += bytes;
    const destroy = made.destroy.bind(made);
    let alive = true;
    made.destroy = () => {
      if (alive) this.bytes -= bytes;
      alive = false;
      return destroy();
    };
    return made;
  }
}

/** Bytes of a texel of the formats that the renderer uses, from their names. */
function texelBytes(format: GPUTextureFormat): number {
  const bits = Number(/\d+/.exec(format)?.[0] ?? 32);
  const channels = format.startsWith("depth") ? 1 : /^[rgba]+/.exec(format)![0].length;
  return (bits / 8) * channels;
}

export interface Moment {
  readonly frame: number;
  readonly seconds: number;
  readonly patches: number;
  readonly uploads: number;
  /** Bytes on the device and in the page's heap (0 where the browser does not tell). */
  readonly deviceBytes: number;
  readonly heapBytes: number;
}

/** The camera of a frame: round the middle of the terrain, `up` metres over the ground, looking ahead. */
export function flightCamera(
  view: TileView,
  frame: number,
  stepM: number,
  up: number,
  size: [number, number],
): CameraState {
  const middle = view.sizeM / 2;
  const radius = 0.3 * view.sizeM;
  const angle = (frame * stepM) / radius;
  const at = (a: number): [number, number] => [middle + radius * Math.cos(a), middle + radius * Math.sin(a)];
  const [x, y] = at(angle);
  const [tx, ty] = at(angle + 200 / radius);
  const eye: Vec3 = [x, y, groundBelow(view, x, y) + up];
  return lookAt(eye, [tx, ty, groundBelow(view, tx, ty)], size[0], size[1], 50, 0.2, 60_000);
}

/** Highest sample of the finest level that is held everywhere, within a cell. */
function groundBelow(view: TileView, x: number, y: number): number {
  const level = view.solved;
  const last = 2 ** level - 1;
  const w = view.sizeM / 2 ** level;
  const tx = Math.min(last, Math.floor(x / w));
  const ty = Math.min(last, Math.floor(y / w));
  const { heights } = view.tile(level, tx, ty)!;
  const c = Math.min(63, Math.floor(((x - tx * w) / w) * 64));
  const r = Math.min(63, Math.floor(((y - ty * w) / w) * 64));
  const k = r * 65 + c;
  return Math.max(heights[k]!, heights[k + 1]!, heights[k + 65]!, heights[k + 66]!);
}

/** Flies for so many frames, or so many seconds where that is longer; a moment now and then. */
export async function fly(
  renderer: GpuRenderer,
  device: GPUDevice,
  tally: Tally,
  sceneAt: (frame: number) => Scene,
  { frames, seconds, moments }: { frames: number; seconds: number; moments: number },
): Promise<Moment[]> {
  const out: Moment[] = [];
  const began = performance.now();
  let uploads = 0;
  let counted = 0;
  for (let frame = 0; ; frame += 1) {
    const stats: FrameStats = renderer.render(sceneAt(frame));
    await device.queue.onSubmittedWorkDone();
    uploads += stats.uploads;
    counted += 1;
    const passed = (performance.now() - began) / 1000;
    const share = Math.min(frame / Math.max(1, frames - 1), seconds > 0 ? passed / seconds : 1);
    if (share * (moments - 1) < out.length && share < 1) continue;
    out.push({
      frame,
      seconds: passed,
      patches: stats.patches,
      uploads: uploads / counted,
      deviceBytes: tally.bytes,
      heapBytes: heapBytes(),
    });
    uploads = 0;
    counted = 0;
    if (share >= 1) return out;
  }
}

function heapBytes(): number {
  const page = globalThis as { gc?: () => void };
  page.gc?.();
  const memory = (performance as { memory?: { usedJSHeapSize: number } }).memory;
  return memory?.usedJSHeapSize ?? 0;
}
