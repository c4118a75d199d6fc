/**
 * The tiling noise texture that all materials read (shaders/wgsl/material/noise.wgsl). Gradient noise after Perlin, "Improving
 * Noise" (2002), on a periodic lattice with an integer hash, so it is the same everywhere.
 */

export const NOISE_SIZE = 256;
const GRADIENT_RANGE = 8;

/** 32 bits for a lattice point. */
export function hash(x: number, y: number, seed: number): number {
  let h = (Math.imul(x, 0x27d4eb2d) ^ Math.imul(y, 0x165667b1) ^ Math.imul(seed, 0x9e3779b1)) >>> 0;
  h = Math.imul(h ^ (h >>> 15), 0x85ebca6b) >>> 0;
  h = Math.imul(h ^ (h >>> 13), 0xc2b2ae35) >>> 0;
  return (h ^ (h >>> 16)) >>> 0;
}

/** Lattice gradients of one octave: cos, sin per cell of a period x period lattice. */
function lattice(period: number, seed: number): Float32Array {
  const out = new Float32Array(period * period * 2);
  for (let i = 0; i < period * period; i += 1) {
    const angle = (hash(i % period, Math.floor(i / period), seed) / 2 ** 32) * 2 * Math.PI;
    out[2 * i] = Math.cos(angle);
    out[2 * i + 1] = Math.sin(angle);
  }
  return out;
}

/** Adds one octave to `out` (NOISE_SIZE squared), shaped by `shape`. */
function addOctave(out: Float32Array, period: number, seed: number, gain: number, shape: (v: number) => number): void {
  const grads = lattice(period, seed);
  const cell = NOISE_SIZE / period;
  for (let row = 0; row < NOISE_SIZE; row += 1) {
    const y = row / cell;
    const j = Math.floor(y);
    const fy = y - j;
    const wy = fy * fy * fy * (fy * (fy * 6 - 15) + 10);
    for (let col = 0; col < NOISE_SIZE; col += 1) {
      const x = col / cell;
      const i = Math.floor(x);
      const fx = x - i;
      const wx = fx * fx * fx * (fx * (fx * 6 - 15) + 10);
      const corner = (di: number, dj: number): number => {
        const k = 2 * (((j + dj) % period) * period + ((i + di) % period));
        return grads[k]! * (fx - di) + grads[k + 1]! * (fy - dj);
      };
      const south = corner(0, 0) + (corner(1, 0) - corner(0, 0)) * wx;
      const north = corner(0, 1) + (corner(1, 1) - corner(0, 1)) * wx;
      out[row * NOISE_SIZE + col]! += gain * shape(south + (north - south) * wy);
    }
  }
}

/** Scales to mean 0.5 and standard deviation 0.19, so that thresholds in the materials mean the same for each kind. */
function normalise(field: Float32Array): void {
  let mean = 0;
  for (const v of field) mean += v;
  mean /= field.length;
  let variance = 0;
  for (const v of field) variance += (v - mean) ** 2;
  const scale = 0.19 / Math.sqrt(variance / field.length);
  for (let i = 0; i < field.length; i += 1) field[i] = Math.min(1, Math.max(0, 0.5 + (field[i]! - mean) * scale));
}

/** RGBA8 levels of the mipmap, finest first: r fbm, g ridged fbm, ba gradient of r per texture width. */
export function noiseMipmaps(): Uint8Array[] {
  const smooth = new Float32Array(NOISE_SIZE * NOISE_SIZE);
  const ridged = new Float32Array(NOISE_SIZE * NOISE_SIZE);
  for (let octave = 0; octave < 6; octave += 1) {
    addOctave(smooth, 4 << octave, 11 + octave, 0.55 ** octave, (v) => v);
    addOctave(ridged, 3 << octave, 31 + octave, 0.58 ** octave, (v) => -Math.abs(v));
  }
  normalise(smooth);
  normalise(ridged);
  const texels = new Float32Array(NOISE_SIZE * NOISE_SIZE * 4);
  const mask = NOISE_SIZE - 1;
  for (let row = 0; row < NOISE_SIZE; row += 1) {
    for (let col = 0; col < NOISE_SIZE; col += 1) {
      const at = (r: number, c: number): number => smooth[(r & mask) * NOISE_SIZE + (c & mask)]!;
      const k = 4 * (row * NOISE_SIZE + col);
      const slope = (a: number, b: number): number => ((a - b) / 2) * NOISE_SIZE * (1 / (2 * GRADIENT_RANGE)) * 0.5;
      texels[k] = at(row, col);
      texels[k + 1] = ridged[row * NOISE_SIZE + col]!;
      texels[k + 2] = 0.5 + slope(at(row, col + 1), at(row, col - 1));
      texels[k + 3] = 0.5 + slope(at(row + 1, col), at(row - 1, col));
    }
  }
  return mipmaps(texels, NOISE_SIZE);
}

/** RGBA8 levels of a texture of `size` texels a side, 0..1, finest first, each the mean of the one before. */
export function mipmaps(finest: Float32Array, size: number): Uint8Array[] {
  const levels: Uint8Array[] = [];
  let current = finest;
  for (let side = size; side >= 1; side /= 2) {
    levels.push(Uint8Array.from(current, (v) => Math.round(Math.min(1, Math.max(0, v)) * 255)));
    if (side === 1) break;
    const half = side / 2;
    const next = new Float32Array(half * half * 4);
    for (let row = 0; row < half; row += 1) {
      for (let col = 0; col < half; col += 1) {
        for (let ch = 0; ch < 4; ch += 1) {
          const at = (r: number, c: number): number => current[4 * ((2 * row + r) * side + 2 * col + c) + ch]!;
          next[4 * (row * half + col) + ch] = (at(0, 0) + at(0, 1) + at(1, 0) + at(1, 1)) / 4;
        }
      }
    }
    current = next;
  }
  return levels;
}

/** The texture on the device. */
export function createNoiseTexture(device: GPUDevice): GPUTexture {
  return upload(device, "noise", noiseMipmaps());
}

/** An rgba8 texture of all its levels, finest first. */
export function upload(device: GPUDevice, label: string, levels: readonly Uint8Array[]): GPUTexture {
  const size = 1 << (levels.length - 1);
  const texture = device.createTexture({
    label,
    format: "rgba8unorm",
    size: [size, size],
    mipLevelCount: levels.length,
    usage: GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST,
  });
  levels.forEach((data, mipLevel) => {
    const side = size >> mipLevel;
    device.queue.writeTexture({ texture, mipLevel }, data as Uint8Array<ArrayBuffer>, { bytesPerRow: side * 4 }, [
      side,
      side,
    ]);
  });
  return texture;
}
