/**
 * The tiling texture of stones that near ground is made of (shaders/wgsl/material/stones_rich.wgsl): cells of scattered points
 * after Worley, "A Cellular Texture Basis Function" (1996), with integer hashes, so it is the same everywhere.
 */

import { hash, mipmaps, upload } from "../synthesis/noise.ts";

export const STONES_SIZE = 512;
/** Stones side by side until the texture repeats; STONES_PERIOD of stones_rich.wgsl. */
export const STONES_PERIOD = 24;
/** Distance between the nearest and the second nearest point, in cells, at which a stone is at its highest. */
const EDGE = 0.55;
const GRADIENT_RANGE = 8;
/** The steepest lean of a stone's back: texture units, of 2 * GRADIENT_RANGE slopes. */
const LEAN = 0.16;
const SEED = 71;

interface Cells {
  /** 0 at the edge of a stone, 1 in its middle, per texel. */
  readonly inside: Float32Array;
  /** The stone's own number. */
  readonly own: Float32Array;
  /** How its back leans, as a part of the gradient in the texture. */
  readonly east: Float32Array;
  readonly north: Float32Array;
}

function scatter(): { readonly x: Float32Array; readonly y: Float32Array; readonly own: Float32Array } {
  const count = STONES_PERIOD * STONES_PERIOD;
  const [x, y, own] = [new Float32Array(count), new Float32Array(count), new Float32Array(count)];
  for (let k = 0; k < count; k += 1) {
    const [i, j] = [k % STONES_PERIOD, Math.floor(k / STONES_PERIOD)];
    x[k] = hash(i, j, SEED) / 2 ** 32;
    y[k] = hash(i, j, SEED + 1) / 2 ** 32;
    own[k] = hash(i, j, SEED + 2) / 2 ** 32;
  }
  return { x, y, own };
}

function cells(): Cells {
  const points = scatter();
  const inside = new Float32Array(STONES_SIZE * STONES_SIZE);
  const [own, east, north] = [
    new Float32Array(inside.length),
    new Float32Array(inside.length),
    new Float32Array(inside.length),
  ];
  const pitch = STONES_PERIOD / STONES_SIZE;
  for (let row = 0; row < STONES_SIZE; row += 1) {
    const y = row * pitch;
    for (let col = 0; col < STONES_SIZE; col += 1) {
      const x = col * pitch;
      let [near, second, of] = [9, 9, 0];
      for (let dj = -2; dj <= 2; dj += 1) {
        for (let di = -2; di <= 2; di += 1) {
          const [i, j] = [Math.floor(x) + di, Math.floor(y) + dj];
          const k = ((j + STONES_PERIOD) % STONES_PERIOD) * STONES_PERIOD + ((i + STONES_PERIOD) % STONES_PERIOD);
          const [ex, ey] = [i + points.x[k]! - x, j + points.y[k]! - y];
          const d = Math.sqrt(ex * ex + ey * ey);
          if (d < near) [near, second, of] = [d, near, k];
          else if (d < second) second = d;
        }
      }
      inside[row * STONES_SIZE + col] = Math.min(1, (second - near) / EDGE);
      own[row * STONES_SIZE + col] = points.own[of]!;
      // The point's place in its cell is as random as any other number.
      east[row * STONES_SIZE + col] = (points.x[of]! - 0.5) * LEAN;
      north[row * STONES_SIZE + col] = (points.y[of]! - 0.5) * LEAN;
    }
  }
  return { inside, own, east, north };
}

/** (STONES_SIZE², 4), 0..1: inside, own number, gradient of the leaning, rounded relief per cell (0.5 = none). */
export function stoneTexels(): Float32Array {
  const { inside, own, east, north } = cells();
  // A rounded back: steep at the edge, level in the middle.
  const relief = Float32Array.from(inside, (e) => Math.sqrt(e * (2 - e)));
  const texels = new Float32Array(STONES_SIZE * STONES_SIZE * 4);
  const mask = STONES_SIZE - 1;
  const slope = STONES_SIZE / STONES_PERIOD / 2 / (4 * GRADIENT_RANGE);
  for (let row = 0; row < STONES_SIZE; row += 1) {
    for (let col = 0; col < STONES_SIZE; col += 1) {
      const at = (r: number, c: number): number => relief[(r & mask) * STONES_SIZE + (c & mask)]!;
      const k = row * STONES_SIZE + col;
      texels[4 * k] = inside[k]!;
      texels[4 * k + 1] = own[k]!;
      texels[4 * k + 2] = 0.5 + (at(row, col + 1) - at(row, col - 1)) * slope + east[k]!;
      texels[4 * k + 3] = 0.5 + (at(row + 1, col) - at(row - 1, col)) * slope + north[k]!;
    }
  }
  return texels;
}

/** The texture on the device; a texel of middling stone on adapters that draw on the CPU, whose shaders do not read it. */
export function createStonesTexture(device: GPUDevice, software: boolean): GPUTexture {
  const texels = software ? Float32Array.of(0.5, 0.5, 0.5, 0.5) : stoneTexels();
  return upload(device, "stones", mipmaps(texels, Math.sqrt(texels.length / 4)));
}
