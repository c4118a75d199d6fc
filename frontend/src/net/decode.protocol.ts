/** Messages between the page and its decoding worker. */

import type { DecodedFrame } from "../core/types.ts";

export type ToWorker =
  | { readonly type: "frame"; readonly epoch: number; readonly buffer: ArrayBuffer }
  | { readonly type: "reset"; readonly epoch: number };

export type FromWorker =
  | { readonly type: "frame"; readonly epoch: number; readonly frame: DecodedFrame }
  | { readonly type: "error"; readonly epoch: number; readonly message: string };
