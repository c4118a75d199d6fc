/** Frames and grounds for the store's tests. */

import type { DecodedFrame, DecodedTile, Tile, TileView } from "../../src/core/types.ts";
import { Channel, FrameKind } from "../../src/generated/contract.ts";
import { FrameDecoder } from "../../src/net/decode.ts";
import { bytesOf, vectors } from "../net-decode/vectors.ts";

export const SIZE_M = 1000;
export const LEVELS = 3;

/** All frames of one of the shared sessions, decoded. */
export function sessionFrames(name: string): DecodedFrame[] {
  const session = vectors.sessions.find((s) => s.name === name)!;
  const decoder = new FrameDecoder();
  return session.steps.map((step) => decoder.decode(bytesOf(step.frame)));
}

/** A tile of a ground given by a function of x and y in metres, in quanta of its level. */
export function tileOf(
  level: number,
  x: number,
  y: number,
  version: number,
  height: (x: number, y: number) => number,
  sizeM = SIZE_M,
): DecodedTile {
  const spacing = sizeM / (64 * 2 ** level);
  const quantum = spacing / 256;
  const samples = new Int32Array(65 * 65);
  for (let r = 0; r < 65; r++)
    for (let c = 0; c < 65; c++)
      samples[r * 65 + c] = Math.round(height((64 * x + c) * spacing, (64 * y + r) * spacing) / quantum);
  const subMin = new Int32Array(16);
  const subMax = new Int32Array(16);
  for (let s = 0; s < 16; s++) {
    let low = Number.POSITIVE_INFINITY;
    let high = Number.NEGATIVE_INFINITY;
    for (let r = 0; r <= 16; r++)
      for (let c = 0; c <= 16; c++) {
        const v = samples[(16 * (s >> 2) + r) * 65 + 16 * (s & 3) + c]!;
        low = Math.min(low, v);
        high = Math.max(high, v);
      }
    subMin[s] = low;
    subMax[s] = high;
  }
  return { x, y, version, samples, subMin, subMax, subError: new Uint32Array(16) };
}

export function frame(
  kind: "LEVEL" | "FILL",
  level: number,
  tiles: readonly DecodedTile[],
  drops: readonly { x: number; y: number }[] = [],
  channel = Channel.HEIGHT as number,
): DecodedFrame {
  return { kind: FrameKind[kind], level, channel, clock: 1, settled: false, drops, tiles, bytes: 0 };
}

/** All tiles of a level of a ground given by a function. */
export function all(level: number, version: number, height: (x: number, y: number) => number): DecodedTile[] {
  const n = 2 ** level;
  return Array.from({ length: n * n }, (_, i) => tileOf(level, i % n, Math.floor(i / n), version, height));
}

/** Every pair of neighbours on one level whose shared edge differs, as text. */
export function seams(view: TileView): string[] {
  const found: string[] = [];
  for (const t of view.tiles()) {
    const east = view.tile(t.level, t.x + 1, t.y);
    const north = view.tile(t.level, t.x, t.y + 1);
    for (let i = 0; i < 65; i++) {
      if (east && t.heights[i * 65 + 64] !== east.heights[i * 65]) found.push(`${name(t)} | ${name(east)} at ${i}`);
      if (north && t.heights[64 * 65 + i] !== north.heights[i]) found.push(`${name(t)} / ${name(north)} at ${i}`);
    }
  }
  return found;
}

function name(t: Tile): string {
  return `${t.level}:${t.x},${t.y}`;
}
