/**
 * Binary frames to exact samples (DESIGN 6). Twin of `backend/esker/tiles/{frame,decoder}.py`: both read
 * `tests/vectors/tiles.json`. A frame is decoded wholly before anything held changes.
 */

import { subDistance, subRange } from "../core/bounds.ts";
import { predictInts } from "../core/predict.ts";
import { finestLevel, quantaRatio } from "../core/streams.ts";
import { isUnderAny, keyLevel, parentKey, tileKey } from "../core/tilekey.ts";
import type { DecodedFrame, DecodedTile } from "../core/types.ts";
import {
  Channel,
  CODER_LIMIT,
  CODER_MAX_BYTES,
  Filter,
  FRAME_HEADER,
  FRAME_MAGIC,
  FRAME_SETTLED,
  FrameKind,
  PROTOCOL_VERSION,
  Predictor,
  SUBPATCHES,
  TILE_DROP,
  TILE_FILTER_BITS,
  TILE_MAX_SHIFT,
  TILE_PREDICTOR_BITS,
  TILE_SAMPLE_LIMIT,
  TILE_SAMPLES,
} from "../generated/contract.ts";
import { decodeResiduals } from "./entropy.ts";
import { isRivers, RiverError, readRivers } from "./rivers.ts";

/** A frame that is truncated, malformed or does not fit what is held. */
export class FrameError extends Error {
  override name = "FrameError";
}

const AREA = TILE_SAMPLES * TILE_SAMPLES;
const SUBS = SUBPATCHES * SUBPATCHES;
const CHANNELS = Object.keys(Channel).length;

interface Head {
  readonly kind: number;
  readonly level: number;
  readonly channel: number;
  readonly clock: number;
  readonly settled: boolean;
  readonly tiles: number;
  readonly drops: number;
}

interface TileHead {
  readonly x: number;
  readonly y: number;
  readonly predictor: number;
  readonly filter: number;
  readonly shift: number;
  readonly version: number;
  readonly baseVersion: number;
  readonly bytes: number;
}

interface Held {
  readonly version: number;
  readonly samples: Int32Array;
  /** The parent's samples when this tile was last sent or confirmed by a LEVEL frame; null at level 0. */
  readonly parentThen: Int32Array | null;
}

/** A prediction, in float64: sums of 32-bit integers stay exact. */
const base = new Float64Array(AREA);
const residual = new Float64Array(AREA);
const before = new Int32Array(AREA);
const after = new Int32Array(AREA);

type Tiles = Map<number, Held>;

/**
 * Keeps the exact samples of the tiles that the page holds, and applies frames to them in order. Each channel is a stream
 * of its own: its tiles are predicted from its own, and a drop names its own.
 */
export class FrameDecoder {
  readonly #channels: readonly Tiles[] = Array.from({ length: CHANNELS }, () => new Map());

  /** Forgets everything, as after a reconnect. */
  reset(): void {
    for (const held of this.#channels) held.clear();
  }

  /** Tiles of the heights held now. */
  get size(): number {
    return this.sizeOf(Channel.HEIGHT);
  }

  /** Tiles of a channel held now. */
  sizeOf(channel: number): number {
    return this.#channels[channel]?.size ?? 0;
  }

  /** Decodes and applies one frame. Throws FrameError, and then changes nothing that is held. */
  decode(buffer: ArrayBuffer): DecodedFrame {
    if (isRivers(buffer)) return riversOf(buffer);
    const view = new DataView(buffer);
    const head = readHead(view);
    const drops = readDrops(view, head);
    const dropped = new Set(drops.map((d) => tileKey(head.level, d.x, d.y)));
    const held = this.#channels[head.channel]!;
    const tiles: DecodedTile[] = [];
    const seen = new Set<number>();
    const reader = new TileReader(view, FRAME_HEADER.size + head.drops * TILE_DROP.size);
    for (let i = 0; i < head.tiles; i++) {
      const tile = reader.tile(head.level);
      const key = tileKey(head.level, tile.x, tile.y);
      if (seen.has(key)) throw new FrameError("a tile occurs twice");
      if (dropped.has(key)) throw new FrameError("a tile is both sent and dropped");
      seen.add(key);
      tiles.push(decodeTile(held, head, tile, reader.payload(tile.bytes)));
    }
    const left = buffer.byteLength - reader.at;
    if (left > 0) throw new FrameError(`${left} bytes follow the last tile`);
    commit(held, head, dropped, tiles);
    const { kind, level, channel, clock, settled } = head;
    return { kind, level, channel, clock, settled, drops, tiles, bytes: buffer.byteLength };
  }
}

function riversOf(buffer: ArrayBuffer): DecodedFrame {
  try {
    const rivers = readRivers(buffer);
    const { level, clock, settled } = rivers;
    const head = { kind: FrameKind.RIVERS, level, channel: Channel.HEIGHT, clock, settled };
    return { ...head, drops: [], tiles: [], bytes: buffer.byteLength, rivers };
  } catch (e) {
    throw e instanceof RiverError ? new FrameError(e.message) : e;
  }
}

function commit(held: Tiles, head: Head, dropped: ReadonlySet<number>, tiles: readonly DecodedTile[]): void {
  if (dropped.size > 0) for (const key of held.keys()) if (isUnderAny(key, dropped, head.level)) held.delete(key);
  for (const { x, y, version, samples } of tiles) {
    const key = tileKey(head.level, x, y);
    held.set(key, { version, samples, parentThen: parentSamples(held, key) });
  }
  if (head.kind !== FrameKind.LEVEL) return;
  for (const [key, tile] of held) {
    if (keyLevel(key) === head.level) held.set(key, { ...tile, parentThen: parentSamples(held, key) });
  }
}

function parentSamples(held: Tiles, key: number): Int32Array | null {
  return keyLevel(key) > 0 ? (held.get(parentKey(key))?.samples ?? null) : null;
}

function decodeTile(held: Tiles, head: Head, tile: TileHead, payload: Uint8Array): DecodedTile {
  const key = tileKey(head.level, tile.x, tile.y);
  const ratio = quantaRatio(head.channel);
  const samples = new Int32Array(AREA);
  const parent = parentSamples(held, key);
  if (tile.predictor === Predictor.PARENT) predictFromParent(held, key, tile, ratio);
  else if (tile.predictor !== Predictor.ZERO) predictFromHeld(held, key, tile, parent, ratio);
  else base.fill(0);
  readResidual(payload, tile);
  undoFilter(tile.filter);
  addResidual(samples);
  const subMin = new Int32Array(SUBS);
  const subMax = new Int32Array(SUBS);
  const subError = new Uint32Array(SUBS);
  subRange(samples, subMin, subMax);
  if (parent) {
    const distance = new Float64Array(SUBS);
    subDistance(samples, parent, ratio, tile.x, tile.y, distance);
    for (let i = 0; i < SUBS; i++) subError[i] = Math.ceil(distance[i]! / 2);
  }
  return { x: tile.x, y: tile.y, version: tile.version, samples, subMin, subMax, subError };
}

function predictFromParent(held: Tiles, key: number, tile: TileHead, ratio: 1 | 2): void {
  const parent = keyLevel(key) > 0 ? held.get(parentKey(key)) : undefined;
  if (!parent) throw new FrameError("a tile is predicted from a parent that is not held");
  if (parent.version !== tile.baseVersion)
    throw new FrameError(`a tile is predicted from version ${tile.baseVersion}, not ${parent.version}, of its parent`);
  predictInts(parent.samples, tile.x, tile.y, after, ratio);
  base.set(after);
}

/** The tile as it was; for `PREVIOUS` moved along with its parent since then. */
function predictFromHeld(held: Tiles, key: number, tile: TileHead, parent: Int32Array | null, ratio: 1 | 2): void {
  const own = held.get(key);
  if (!own) throw new FrameError("a tile is predicted from itself but not held");
  if (own.version !== tile.baseVersion)
    throw new FrameError(`a tile is predicted from its version ${tile.baseVersion}, not from ${own.version}`);
  base.set(own.samples);
  const then = own.parentThen;
  if (tile.predictor === Predictor.HELD || !then || !parent || then === parent) return;
  predictInts(then, tile.x, tile.y, before, ratio);
  predictInts(parent, tile.x, tile.y, after, ratio);
  for (let i = 0; i < AREA; i++) base[i]! += after[i]! - before[i]!;
}

function readHead(view: DataView): Head {
  const f = FRAME_HEADER;
  if (view.byteLength < f.size) throw new FrameError("the frame ends inside its header");
  if (view.getUint16(f.magic.offset, true) !== FRAME_MAGIC) throw new FrameError("this is not an Esker frame");
  const protocol = view.getUint8(f.protocol.offset);
  if (protocol !== PROTOCOL_VERSION) throw new FrameError(`frame protocol ${protocol} is not ${PROTOCOL_VERSION}`);
  const kind = view.getUint8(f.kind.offset);
  if (kind !== FrameKind.LEVEL && kind !== FrameKind.FILL) throw new FrameError(`unknown frame kind ${kind}`);
  const channel = view.getUint8(f.channel.offset);
  if (channel >= CHANNELS) throw new FrameError(`unknown channel ${channel}`);
  const level = view.getUint8(f.level.offset);
  const finest = finestLevel(channel);
  if (level > finest) throw new FrameError(`level ${level} is above ${finest}`);
  return {
    kind,
    level,
    channel,
    clock: view.getUint32(f.clock.offset, true),
    settled: (view.getUint16(f.flags.offset, true) & FRAME_SETTLED) !== 0,
    tiles: view.getUint16(f.tiles.offset, true),
    drops: view.getUint16(f.drops.offset, true),
  };
}

function readDrops(view: DataView, head: Head): { x: number; y: number }[] {
  const end = FRAME_HEADER.size + head.drops * TILE_DROP.size;
  if (view.byteLength < end) throw new FrameError("the frame ends inside its list of dropped tiles");
  const drops: { x: number; y: number }[] = [];
  for (let at: number = FRAME_HEADER.size; at < end; at += TILE_DROP.size) {
    const x = view.getUint16(at + TILE_DROP.x.offset, true);
    const y = view.getUint16(at + TILE_DROP.y.offset, true);
    checkPlace(head.level, x, y);
    drops.push({ x, y });
  }
  return drops;
}

/** Reads tiles, whose versions are differences to those of the tile before. */
class TileReader {
  #version = 0;
  #base = 0;

  readonly #view: DataView;

  constructor(
    view: DataView,
    public at: number,
  ) {
    this.#view = view;
  }

  /** The numbers of the next tile. */
  tile(level: number): TileHead {
    const x = this.#number();
    const y = this.#number();
    checkPlace(level, x, y);
    const coding = this.#number();
    const filterBits = 2 ** TILE_PREDICTOR_BITS;
    const shiftBits = filterBits * 2 ** TILE_FILTER_BITS;
    const shift = Math.floor(coding / shiftBits);
    if (shift > TILE_MAX_SHIFT)
      throw new FrameError(`residuals are shifted by ${TILE_MAX_SHIFT} bits at most, not ${shift}`);
    this.#version = this.#versionAfter(this.#version);
    this.#base = this.#versionAfter(this.#base);
    const bytes = this.#number();
    if (bytes > CODER_MAX_BYTES) throw new FrameError(`a tile payload of ${bytes} bytes is too large`);
    return {
      x,
      y,
      predictor: coding % filterBits,
      filter: Math.floor(coding / filterBits) % 2 ** TILE_FILTER_BITS,
      shift,
      version: this.#version,
      baseVersion: this.#base,
      bytes,
    };
  }

  /** The bytes that follow the numbers, as a view. */
  payload(bytes: number): Uint8Array {
    const { buffer, byteOffset, byteLength } = this.#view;
    if (this.at + bytes > byteLength) throw new FrameError("the frame ends inside a tile payload");
    const out = new Uint8Array(buffer, byteOffset + this.at, bytes);
    this.at += bytes;
    return out;
  }

  /** LEB128: seven bits a byte, the lowest first; 35 bits at most. */
  #number(): number {
    let value = 0;
    for (let scale = 1; scale < 2 ** 35 && this.at < this.#view.byteLength; scale *= 128) {
      const byte = this.#view.getUint8(this.at++);
      value += (byte & 127) * scale;
      if (byte < 128) return value;
    }
    throw new FrameError("the frame ends inside a tile's numbers, or one of them is too long");
  }

  #versionAfter(last: number): number {
    const folded = this.#number();
    const version = last + (folded % 2 > 0 ? -(folded + 1) / 2 : folded / 2);
    if (version < 0 || version > 0xffffffff) throw new FrameError(`version ${version} has more than 32 bits`);
    return version;
  }
}

function checkPlace(level: number, x: number, y: number): void {
  if (x >= 1 << level || y >= 1 << level) throw new FrameError(`a tile lies outside level ${level}`);
}

/** The residuals as coded, in `residual`. */
function readResidual(payload: Uint8Array, tile: TileHead): void {
  residual.fill(0);
  if (payload.length === 0) return;
  const limit = CODER_LIMIT / 2 ** tile.shift;
  const fits = decodeResiduals(payload, tile.filter === Filter.LATTICE, residual);
  if (!fits || residual.some((v) => Math.abs(v) >= limit))
    throw new FrameError("a tile payload has bytes left over or numbers that are too large");
  if (tile.shift > 0) for (let i = 0; i < AREA; i++) residual[i]! *= 2 ** tile.shift;
}

/** Adds up the differences in `residual`. Sums of 4,225 numbers of 32 bits are exact in float64. */
function undoFilter(filter: number): void {
  if (filter === Filter.NONE || filter === Filter.LATTICE) return;
  const across = filter === Filter.ROW ? 1 : TILE_SAMPLES;
  for (let row = 1; row < TILE_SAMPLES; row++)
    for (let i = row * TILE_SAMPLES; i < row * TILE_SAMPLES + across; i++) residual[i]! += residual[i - TILE_SAMPLES]!;
  for (let i = 0; i < AREA; i++) if (i % TILE_SAMPLES > 0) residual[i]! += residual[i - 1]!;
}

/** The prediction in `base` plus the residual. */
function addResidual(samples: Int32Array): void {
  for (let i = 0; i < AREA; i++) {
    const value = base[i]! + residual[i]!;
    if (value > TILE_SAMPLE_LIMIT || value < -TILE_SAMPLE_LIMIT) throw new FrameError("a tile sample is out of range");
    samples[i] = value;
  }
}
