/**
 * Residuals of a tile out of their adaptive binary arithmetic code (DESIGN 6). Twin of `backend/esker/tiles/codec/entropy.py`,
 * which says what is coded and why; both read `tests/vectors/tiles.json`. All numbers are integers below 2^48, exact in
 * float64.
 */

import {
  LATTICE_CLASSES,
  LATTICE_WEIGHTS,
  CODER_LIMIT as LIMIT,
  CODER_MAX_EXPONENT as MAX_EXPONENT,
  CODER_NODES as NODES,
  CODER_PLACES as PLACES,
  CODER_SIZES as SIZES,
  CODER_SLOWEST as SLOWEST,
  CODER_SURE as SURE,
  TILE_SAMPLES,
} from "../generated/contract.ts";

/** The tile with two rows to the south and two columns to the west and east, of zeros. */
const STRIDE = TILE_SAMPLES + 4;
const known = new Float64Array((TILE_SAMPLES + 2) * STRIDE);
const odds = new Uint16Array(PLACES * SIZES * NODES);
const seen = new Uint8Array(PLACES * SIZES * NODES);
const RATES = Int32Array.from({ length: SLOWEST + 1 }, (_, n) => Math.floor(65536 / (n + 3) + 0.5));
/** Per class and place, steps to ten neighbours in `AROUND`'s order, in 64ths. */
const WEIGHTS = Int16Array.from(LATTICE_WEIGHTS.split(" "), Number);
const AROUND = [
  [0, -1],
  [-1, 0],
  [-1, -1],
  [-1, 1],
  [0, -2],
  [-2, 0],
  [-1, -2],
  [-2, -1],
  [-2, 1],
  [-1, 2],
].map(([row, col]) => row! * STRIDE + col!);
const [W, S, SW, SE, WW, SS] = AROUND as [number, number, number, number, number, number];

/** The coder's interval and what lies in it of the payload. Kept in variables such large numbers are a new object each. */
const state = new Uint32Array(3);
const LOW = 0;
const HIGH = 1;
const CODE = 2;
let data: Uint8Array = new Uint8Array(0);
let read = 0;

/** 0 for 0, then two classes an octave. */
function sizeClass(total: number): number {
  if (total <= 0) return 0;
  // Numbers from 2^15.5 on are of the last class, whatever their size.
  const whole = Math.min(total, 0x7fffffff);
  const exponent = 31 - Math.clz32(whole);
  const half = exponent > 0 ? (whole >>> (exponent - 1)) & 1 : 0;
  return Math.min(1 + 2 * exponent + half, SIZES - 1);
}

/** The next byte of the payload, zeros after its end, moves into the interval. */
function shiftIn(): void {
  state[CODE] = (state[CODE]! << 8) | (read < data.length ? data[read]! : 0);
  read++;
}

/** Decodes one decision whose odds of a 1 are given in 65,536ths. */
function getBit(chance: number): 0 | 1 {
  const sure = Math.min(Math.max(chance, SURE), 65536 - SURE);
  let low = state[LOW]!;
  let high = state[HIGH]!;
  const range = high - low;
  // The 65,536th part of `range * sure`, in halves: integers of 32 bits are faster than float64.
  const middle = (low + Math.imul(range >>> 16, sure) + (Math.imul(range & 0xffff, sure) >>> 16)) >>> 0;
  const bit = state[CODE]! <= middle ? 1 : 0;
  if (bit) high = middle;
  else low = middle + 1;
  while (((low ^ high) & 0xff000000) === 0) {
    low = (low << 8) >>> 0;
    high = ((high << 8) | 255) >>> 0;
    shiftIn();
  }
  state[LOW] = low;
  state[HIGH] = high;
  return bit;
}

/** Decodes a decision in a context, which learns from it. */
function decide(at: number): 0 | 1 {
  const chance = odds[at]!;
  const bit = getBit(chance);
  const n = seen[at]!;
  odds[at] = chance + (Math.imul((bit ? 65535 : 0) - chance, RATES[n]!) >> 16);
  if (n < SLOWEST) seen[at] = n + 1;
  return bit;
}

/** Decodes a number in the contexts from `first` on. */
function getNumber(first: number): number {
  if (!decide(first)) return 0;
  let exponent = 0;
  while (exponent < MAX_EXPONENT && decide(first + 2 + exponent)) exponent++;
  const negative = decide(first + 1);
  let size = 1;
  if (exponent > 0) {
    size = 2 + decide(first + 36 + Math.min(exponent, 11));
    for (let i = 1; i < exponent; i++) size = 2 * size + getBit(32768);
  }
  return negative ? -size : size;
}

/** Returns how large the known residuals around a place are. */
function sizeAround(at: number, place: number): number {
  const w = Math.abs(known[at + W]!);
  const s = Math.abs(known[at + S]!);
  const ww = Math.abs(known[at + WW]!);
  const ss = Math.abs(known[at + SS]!);
  if (place === 4) return 3 * w + 3 * s + ww + ss;
  const diagonal = Math.abs(known[at + SW]!) + Math.abs(known[at + SE]!);
  if (place === 0) return 2 * w + 2 * s + diagonal + ww + ss;
  return place === 2 ? 3 * s + 2 * ww + ss + diagonal : 3 * w + diagonal + ss + ww;
}

/** Returns the residual that is expected between samples of the parent. */
function expected(at: number, place: number, size: number): number {
  const first = (Math.min(size, LATTICE_CLASSES - 1) * 3 + place - 2) * AROUND.length;
  let sum = 32;
  for (let i = 0; i < AROUND.length; i++) sum += WEIGHTS[first + i]! * known[at + AROUND[i]!]!;
  return Math.floor(sum / 64);
}

/** Decodes a payload into 65x65 residuals. False for what no encoder writes: larger numbers, or bytes left over. */
export function decodeResiduals(payload: Uint8Array, lattice: boolean, out: Float64Array): boolean {
  data = payload;
  state.set([0, 0xffffffff, 0]);
  read = 0;
  for (let i = 0; i < 4; i++) shiftIn();
  known.fill(0);
  odds.fill(32768);
  seen.fill(0);
  for (let row = 0; row < TILE_SAMPLES; row++) {
    for (let col = 0; col < TILE_SAMPLES; col++) {
      const at = (row + 2) * STRIDE + col + 2;
      const place = lattice ? 1 + 2 * (row & 1) + (col & 1) : 0;
      // On a sample of the parent rounding is all that there is.
      const size = place === 1 ? 0 : sizeClass(sizeAround(at, place));
      const value = getNumber((place * SIZES + size) * NODES) + (place > 1 ? expected(at, place, size) : 0);
      if (Math.abs(value) >= LIMIT) return false;
      known[at] = value;
      out[row * TILE_SAMPLES + col] = value;
    }
  }
  return data.length <= read;
}
