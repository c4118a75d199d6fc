/** The main thread's side of tile decoding: a worker where there is one, else the same decoder inline. */

import type { DecodedFrame } from "../core/types.ts";
import type { FromWorker, ToWorker } from "./decode.protocol.ts";
import { FrameDecoder, FrameError } from "./decode.ts";

type FrameListener = (frame: DecodedFrame) => void;
type ErrorListener = (error: FrameError) => void;

/** The part of `Worker` that is used; tests pass their own. */
export interface DecodeWorker {
  postMessage(message: ToWorker, transfer: Transferable[]): void;
  terminate(): void;
  onmessage: ((event: MessageEvent<FromWorker>) => void) | null;
  onerror: ((event: ErrorEvent) => void) | null;
}

function startWorker(): DecodeWorker {
  return new Worker(new URL("./decode.worker.ts", import.meta.url), { type: "module" });
}

/**
 * Frames go in by `push` in the order received and come out decoded, in the same order, to every `onFrame` listener.
 * After an error nothing more comes out until `reset`, as later frames may build on the lost one: reconnect then.
 */
export class DecodeClient {
  #worker: DecodeWorker | null = null;
  #inline: FrameDecoder | null = null;
  #epoch = 0;
  #failed = false;
  /** Frames given to a worker that has not answered yet, kept until it proves that it runs. */
  #unproven: ArrayBuffer[] | null = [];
  readonly #frameListeners = new Set<FrameListener>();
  readonly #errorListeners = new Set<ErrorListener>();

  constructor(start: () => DecodeWorker = startWorker) {
    try {
      this.#worker = start();
      this.#worker.onmessage = ({ data }) => this.#receive(data);
      this.#worker.onerror = () => this.#workerDied();
    } catch {
      this.#fallBack();
    }
  }

  /** Decodes a frame. The buffer may be transferred away: do not use it afterwards. */
  push(buffer: ArrayBuffer): void {
    if (this.#failed) return;
    if (this.#worker) {
      this.#unproven?.push(buffer.slice(0));
      this.#worker.postMessage({ type: "frame", epoch: this.#epoch, buffer }, [buffer]);
    } else this.#decodeInline(buffer);
  }

  /** Calls back with every decoded frame; returns the function that stops it. */
  onFrame(listener: FrameListener): () => void {
    this.#frameListeners.add(listener);
    return () => this.#frameListeners.delete(listener);
  }

  /** Calls back when a frame could not be decoded; returns the function that stops it. */
  onError(listener: ErrorListener): () => void {
    this.#errorListeners.add(listener);
    return () => this.#errorListeners.delete(listener);
  }

  /** Forgets all tiles, as the server does on a new connection. Frames still under way are discarded. */
  reset(): void {
    this.#epoch++;
    this.#failed = false;
    if (this.#unproven) this.#unproven = [];
    this.#worker?.postMessage({ type: "reset", epoch: this.#epoch }, []);
    this.#inline?.reset();
  }

  /** Ends the worker. */
  close(): void {
    this.#worker?.terminate();
    this.#worker = null;
    this.#failed = true;
  }

  #receive(message: FromWorker): void {
    this.#unproven = null;
    if (message.epoch !== this.#epoch || this.#failed) return;
    if (message.type === "frame") this.#deliver(message.frame);
    else this.#fail(new FrameError(message.message));
  }

  /** A worker that never ran (blocked, or its script did not load) is replaced; one that broke later is an error. */
  #workerDied(): void {
    const waiting = this.#unproven;
    this.#worker?.terminate();
    this.#fallBack();
    if (waiting) for (const buffer of waiting) this.#decodeInline(buffer);
    else this.#fail(new FrameError("the decoding worker stopped"));
  }

  #fallBack(): void {
    this.#worker = null;
    this.#unproven = null;
    this.#inline = new FrameDecoder();
  }

  #decodeInline(buffer: ArrayBuffer): void {
    if (!this.#inline || this.#failed) return;
    let frame: DecodedFrame;
    try {
      frame = this.#inline.decode(buffer);
    } catch (e) {
      this.#fail(e instanceof FrameError ? e : new FrameError(String(e)));
      return;
    }
    this.#deliver(frame);
  }

  #deliver(frame: DecodedFrame): void {
    for (const listener of this.#frameListeners) listener(frame);
  }

  #fail(error: FrameError): void {
    this.#failed = true;
    for (const listener of this.#errorListeners) listener(error);
  }
}
