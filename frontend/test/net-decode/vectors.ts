/** Reads `tests/vectors/tiles.json`, which the Python tests read too. */

import { readFileSync } from "node:fs";
import { resolve } from "node:path";

export interface TileVector {
  readonly x: number;
  readonly y: number;
  readonly version: number;
  readonly samples: string;
  readonly corners: readonly number[];
  readonly sub_min: readonly number[];
  readonly sub_max: readonly number[];
  readonly sub_error: readonly number[];
}

export interface StepVector {
  readonly frame: string;
  readonly decoded: {
    readonly kind: number;
    readonly level: number;
    readonly clock: number;
    readonly settled: boolean;
    readonly drops: readonly (readonly [number, number])[];
    readonly tiles: readonly TileVector[];
    readonly held: number;
  };
}

export interface TileVectors {
  readonly sessions: readonly { readonly name: string; readonly steps: readonly StepVector[] }[];
  readonly malformed: readonly { readonly name: string; readonly frame: string }[];
}

const path = resolve(import.meta.dirname, "../../../tests/vectors/tiles.json");
export const vectors = JSON.parse(readFileSync(path, "utf8")) as TileVectors;

export function bytesOf(base64: string): ArrayBuffer {
  return new Uint8Array(Buffer.from(base64, "base64")).buffer;
}
