/**
 * Ground as a target: all samples of a level in a text that fits a message (docs/tasks.md).
 *
 * Twin of `backend/esker/tasks/target.py`; `tests/vectors/targets.json` holds what both read alike.
 */

import { msg } from "@lit/localize";
import type { Heights } from "../../../core/difference.ts";
import {
  MAX_TARGET_CHARACTERS,
  MIN_TARGET_STEP_M,
  TASK_LEVEL,
  type Target,
  TILE_CELLS,
} from "../../../generated/contract.ts";

const FINEST_STEPS = 2048;
const COARSEST_STEPS = 256;
const MOST_STEPS = 0xffff;

/** A text that is no target, or ground that none can be made of; the message is for a person. */
export class BadTarget extends Error {}

const sideOf = (level: number): number => (TILE_CELLS << level) + 1;

/** The target that a ground of level `TASK_LEVEL` or a coarser one is: every second sample where all do not fit. */
export async function encode(heights: Heights, sizeM: number): Promise<Target> {
  let level = 0;
  while (level < TASK_LEVEL && sideOf(level) !== heights.side) level += 1;
  if (sideOf(level) !== heights.side || heights.data.some((z) => !Number.isFinite(z)))
    throw new BadTarget(msg("A target is made of ground that has been solved. Wait a moment and try again."));
  let data = heights.data;
  const low = data.reduce((a, b) => Math.min(a, b), Number.POSITIVE_INFINITY);
  const high = data.reduce((a, b) => Math.max(a, b), Number.NEGATIVE_INFINITY);
  for (let steps = FINEST_STEPS; ; ) {
    const step = Math.max((high - low) / steps, MIN_TARGET_STEP_M);
    const text = base64(await through(packed(data, sideOf(level), low, step), new CompressionStream("deflate")));
    if (text.length <= MAX_TARGET_CHARACTERS) return { size_m: sizeM, level, low_m: low, step_m: step, data: text };
    if (steps > COARSEST_STEPS) steps /= 2;
    else if (level === 0) throw new BadTarget(msg("This ground is too rough to be a target."));
    else {
      data = everySecond(data, sideOf(level));
      level -= 1;
      steps = FINEST_STEPS;
    }
  }
}

function everySecond(data: Float32Array, side: number): Float32Array {
  const half = (side + 1) / 2;
  return Float32Array.from({ length: half * half }, (_, i) => data[2 * side * Math.floor(i / half) + 2 * (i % half)]!);
}

function packed(data: Float32Array, side: number, low: number, step: number): Uint8Array<ArrayBuffer> {
  const k = Int32Array.from(data, (z) => Math.round((z - low) / step));
  const out = new Uint8Array(2 * k.length);
  for (let row = 0, i = 0; row < side; row++)
    for (let col = 0; col < side; col++, i++) {
      const west = col > 0 ? k[i - 1]! : 0;
      const south = row > 0 ? k[i - side]! : 0;
      const both = col > 0 && row > 0 ? k[i - side - 1]! : 0;
      const off = ((k[i]! - west - south + both) << 16) >> 16;
      const zigzag = (off << 1) ^ (off >> 15);
      out[i] = zigzag & 0xff;
      out[i + k.length] = (zigzag >> 8) & 0xff;
    }
  return out;
}

/** The heights of a target. Rejects with BadTarget; never unpacks more than its level holds. */
export async function decode(target: Target): Promise<Heights> {
  const side = sideOf(target.level);
  const bytes = await unpacked(target.data, 2 * side * side);
  if (bytes === null) throw new BadTarget(msg("The target of this task is damaged."));
  const k = new Int32Array(side * side);
  const data = new Float32Array(side * side);
  for (let row = 0, i = 0; row < side; row++)
    for (let col = 0; col < side; col++, i++) {
      const zigzag = bytes[i]! | (bytes[i + k.length]! << 8);
      const off = (zigzag >> 1) ^ -(zigzag & 1);
      const west = col > 0 ? k[i - 1]! : 0;
      const south = row > 0 ? k[i - side]! : 0;
      const both = col > 0 && row > 0 ? k[i - side - 1]! : 0;
      k[i] = (off + west + south - both) & MOST_STEPS;
      data[i] = target.low_m + target.step_m * k[i]!;
    }
  return { side, data };
}

/** Exactly `wanted` bytes of a text; null where it has more, fewer, or is no deflated base64. */
async function unpacked(text: string, wanted: number): Promise<Uint8Array | null> {
  const out = new Uint8Array(wanted);
  let length = 0;
  try {
    const raw = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    const reader = new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate")).getReader();
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      if (length + part.value.length > wanted) {
        await reader.cancel();
        return null;
      }
      out.set(part.value, length);
      length += part.value.length;
    }
  } catch {
    return null;
  }
  return length === wanted ? out : null;
}

async function through(bytes: Uint8Array<ArrayBuffer>, pipe: CompressionStream): Promise<Uint8Array> {
  return new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(pipe)).arrayBuffer());
}

function base64(bytes: Uint8Array): string {
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
}
