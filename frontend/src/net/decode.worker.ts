/** Decodes tile frames off the main thread. One worker a connection; frames keep their order. */

import type { DecodedFrame } from "../core/types.ts";
import type { FromWorker, ToWorker } from "./decode.protocol.ts";
import { FrameDecoder } from "./decode.ts";

interface WorkerScope {
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  postMessage(message: FromWorker, transfer: Transferable[]): void;
}

const scope = globalThis as unknown as WorkerScope;
const decoder = new FrameDecoder();

/** The decoder keeps its samples as the base of later tiles, so the page gets its own copy, transferred. */
function detached(frame: DecodedFrame): [DecodedFrame, Transferable[]] {
  const tiles = frame.tiles.map((t) => ({ ...t, samples: t.samples.slice() }));
  const buffers = tiles.flatMap((t) => [t.samples.buffer, t.subMin.buffer, t.subMax.buffer, t.subError.buffer]);
  return [{ ...frame, tiles }, buffers];
}

scope.onmessage = ({ data }) => {
  if (data.type === "reset") {
    decoder.reset();
    return;
  }
  try {
    const [frame, transfer] = detached(decoder.decode(data.buffer));
    scope.postMessage({ type: "frame", epoch: data.epoch, frame }, transfer);
  } catch (e) {
    const message = e instanceof Error ? e.message : String(e);
    scope.postMessage({ type: "error", epoch: data.epoch, message }, []);
  }
};
