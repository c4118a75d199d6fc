/**
 * Noise of the synthesis: an integer hash of the global sample index, the same bits on every device
 * (docs/synthesis.md, "Noise"). Twin of `backend/esker/synthesis/hash.py`. Numbers hold uint32.
 */

import {
  SYNTH_HASH_MULTIPLIER_1,
  SYNTH_HASH_MULTIPLIER_2,
  SYNTH_HASH_STEP,
  SYNTH_HASH_STREAMS,
} from "../../generated/contract.ts";

/** C. Wellons' `lowbias32`: a bijection of uint32 in which every input bit moves about half of the output bits. */
export function mixBits(x: number): number {
  let v = x ^ (x >>> 16);
  v = Math.imul(v, SYNTH_HASH_MULTIPLIER_1);
  v ^= v >>> 15;
  v = Math.imul(v, SYNTH_HASH_MULTIPLIER_2);
  return (v ^ (v >>> 16)) >>> 0;
}

/**
 * Returns the part of the hash that all samples of a stream of a level share; `row` and `column` of a sample follow.
 */
export function streamStart(seed: number, level: number, stream: number): number {
  return mixBits((seed + Math.imul(SYNTH_HASH_STEP, SYNTH_HASH_STREAMS * level + stream)) >>> 0);
}

/** The part of the hash that the samples of a row (global index j, maybe negative) have in common. */
export function rowStart(stream: number, j: number): number {
  return mixBits((stream + j) >>> 0);
}

/** The hash of the sample in column i of a row. */
export function hashAt(row: number, i: number): number {
  return mixBits((row + i) >>> 0);
}

/** Uniform in [-1, 1): 24 bits. */
export function full(word: number): number {
  return (word >>> 8) * 2 ** -23 - 1;
}

/** Uniform in (-1, 1) and symmetric: the low half. */
export function low(word: number): number {
  return (word & 0xffff) * 2 ** -15 - (1 - 2 ** -16);
}

/** Returns a number of the same distribution as `low` from the high half. */
export function high(word: number): number {
  return (word >>> 16) * 2 ** -15 - (1 - 2 ** -16);
}
