/** Frames of rivers: all lines of a terrain (twin of `backend/esker/tiles/codec/rivers.py`, both read tests/vectors/rivers.json). */

import type { RiverLine, RiverSet } from "../core/types.ts";
import {
  FRAME_HEADER,
  FRAME_MAGIC,
  FRAME_SETTLED,
  FrameKind,
  MAX_LEVEL,
  MAX_RIVER_BYTES,
  PROTOCOL_VERSION,
  RIVER_AREA_STEPS,
  RIVER_UNITS_PER_CELL,
  TILE_CELLS,
} from "../generated/contract.ts";

/** A frame that cannot be one of Esker's; the message says why. */
export class RiverError extends Error {}

const LONGEST = 5;

/** Numbers as LEB128. */
class Numbers {
  readonly #bytes: Uint8Array;

  constructor(
    bytes: Uint8Array,
    public at = 0,
  ) {
    this.#bytes = bytes;
  }

  get size(): number {
    return this.#bytes.length;
  }

  next(): number {
    let value = 0;
    for (let k = 0; k < LONGEST && this.at < this.#bytes.length; k++) {
      const byte = this.#bytes[this.at++]!;
      value += (byte & 127) * 2 ** (7 * k);
      if (byte < 128) return value;
    }
    throw new RiverError("the frame ends inside its numbers, or one of them is too long");
  }

  /** A number that may be negative. */
  signed(): number {
    const folded = this.next();
    return folded % 2 === 1 ? -(folded + 1) / 2 : folded / 2;
  }
}

/** Whether a binary frame has rivers, and no tiles. */
export function isRivers(buffer: ArrayBuffer): boolean {
  return (
    buffer.byteLength > FRAME_HEADER.kind.offset &&
    new DataView(buffer).getUint8(FRAME_HEADER.kind.offset) === FrameKind.RIVERS
  );
}

/** Takes a frame of rivers apart. Throws RiverError. */
export function readRivers(buffer: ArrayBuffer): RiverSet {
  const f = FRAME_HEADER;
  if (buffer.byteLength < f.size || buffer.byteLength > MAX_RIVER_BYTES)
    throw new RiverError(`a frame of rivers has ${f.size} to ${MAX_RIVER_BYTES} bytes, not ${buffer.byteLength}`);
  const view = new DataView(buffer);
  if (view.getUint16(f.magic.offset, true) !== FRAME_MAGIC || view.getUint8(f.kind.offset) !== FrameKind.RIVERS)
    throw new RiverError("this is no frame of rivers");
  const protocol = view.getUint8(f.protocol.offset);
  if (protocol !== PROTOCOL_VERSION) throw new RiverError(`frame protocol ${protocol} is not ${PROTOCOL_VERSION}`);
  const level = view.getUint8(f.level.offset);
  if (level > MAX_LEVEL || view.getUint8(f.channel.offset) !== 0 || view.getUint16(f.drops.offset, true) !== 0)
    throw new RiverError("a frame of rivers has a level, no channel and no dropped tiles");
  const count = view.getUint16(f.tiles.offset, true);
  const numbers = new Numbers(new Uint8Array(buffer), f.size);
  const rivers: RiverLine[] = [];
  for (let k = 0; k < count; k++) rivers.push(readRiver(numbers, k, count, level));
  if (numbers.at !== numbers.size) throw new RiverError(`${numbers.size - numbers.at} bytes follow the last river`);
  const settled = (view.getUint16(f.flags.offset, true) & FRAME_SETTLED) !== 0;
  return { clock: view.getUint32(f.clock.offset, true), level, settled, rivers };
}

function readRiver(numbers: Numbers, own: number, count: number, level: number): RiverLine {
  const size = numbers.next();
  let x = numbers.next();
  let y = numbers.next();
  const head = numbers.signed();
  const end = head + numbers.signed();
  const into = numbers.next();
  if (size < 2 || size > numbers.size)
    throw new RiverError(`a river has at least two points, and no more than its frame has bytes, not ${size}`);
  if (into > 0 && own + into >= count) throw new RiverError(`river ${own} runs into river ${own + into} of ${count}`);
  const most = TILE_CELLS * 2 ** level * RIVER_UNITS_PER_CELL;
  const cells = new Float32Array(2 * size);
  for (let k = 0; k < size; k++) {
    if (k > 0) {
      x += numbers.signed();
      y += numbers.signed();
    }
    if (x < 0 || y < 0 || x > most || y > most) throw new RiverError("a river leaves the terrain");
    cells[2 * k] = x / RIVER_UNITS_PER_CELL;
    cells[2 * k + 1] = y / RIVER_UNITS_PER_CELL;
  }
  const areasM2 = [2 ** (head / RIVER_AREA_STEPS), 2 ** (end / RIVER_AREA_STEPS)] as const;
  return { cells, areasM2, into: into > 0 ? own + into : null };
}
