/** SPEC T20: decoding in a worker or inline gives the same frames in the same order. */

import { createHash } from "node:crypto";
import { afterEach, describe, expect, test, vi } from "vitest";
import type { DecodedFrame } from "../../src/core/types.ts";
import type { FromWorker, ToWorker } from "../../src/net/decode.protocol.ts";
import { FrameError } from "../../src/net/decode.ts";
import { DecodeClient, type DecodeWorker } from "../../src/net/decodeclient.ts";
import { bytesOf, vectors } from "./vectors.ts";

const frames = vectors.sessions[1]!.steps.map((s) => s.frame);

/** The real worker module behind an asynchronous, structured-cloning pair of ports, as a browser gives one. */
async function workerModule(): Promise<DecodeWorker & { terminated: boolean }> {
  vi.resetModules();
  const scope = globalThis as unknown as {
    onmessage: ((event: { data: ToWorker }) => void) | null;
    postMessage: (message: FromWorker, transfer: Transferable[]) => void;
  };
  const worker: DecodeWorker & { terminated: boolean } = {
    onmessage: null,
    onerror: null,
    terminated: false,
    postMessage(message, transfer) {
      const data = structuredClone(message, { transfer });
      queueMicrotask(() => inbox?.({ data }));
    },
    terminate() {
      this.terminated = true;
    },
  };
  scope.postMessage = (message, transfer) => {
    const data = structuredClone(message, { transfer });
    queueMicrotask(() => worker.onmessage?.({ data } as MessageEvent<FromWorker>));
  };
  await import("../../src/net/decode.worker.ts");
  const inbox = scope.onmessage;
  return worker;
}

const noWorker = () => {
  throw new Error("workers are not available");
};

function collect(client: DecodeClient): { frames: DecodedFrame[]; errors: FrameError[] } {
  const got: { frames: DecodedFrame[]; errors: FrameError[] } = { frames: [], errors: [] };
  client.onFrame((f) => got.frames.push(f));
  client.onError((e) => got.errors.push(e));
  return got;
}

/** A frame with its arrays as digests: quick to compare. */
function summary(frame: DecodedFrame): unknown {
  const digest = (a: Int32Array | Uint32Array) =>
    createHash("sha256")
      .update(new Uint8Array(a.buffer, a.byteOffset, a.byteLength))
      .digest("hex");
  const tiles = frame.tiles.map((t) => [
    t.x,
    t.y,
    t.version,
    ...[t.samples, t.subMin, t.subMax, t.subError].map(digest),
  ]);
  return { ...frame, tiles };
}

const settle = () => new Promise((resolve) => setTimeout(resolve, 0));

afterEach(() => {
  const scope = globalThis as unknown as Record<string, unknown>;
  delete scope.onmessage;
  delete scope.postMessage;
});

describe("DecodeClient", () => {
  test("worker and inline decode the same frames in the same order", async () => {
    const worker = await workerModule();
    const remote = new DecodeClient(() => worker);
    const inline = new DecodeClient(noWorker);
    const a = collect(remote);
    const b = collect(inline);
    for (const frame of frames) {
      remote.push(bytesOf(frame));
      inline.push(bytesOf(frame));
    }
    await settle();
    expect(b.frames.length).toBe(frames.length);
    expect(a.frames.map(summary)).toEqual(b.frames.map(summary));
    expect(a.errors).toEqual([]);
    remote.close();
    expect(worker.terminated).toBe(true);
  });

  test("the page's copy of the samples is its own", async () => {
    const client = new DecodeClient(await workerModule().then((w) => () => w));
    const got = collect(client);
    client.push(bytesOf(frames[0]!));
    await settle();
    got.frames[0]!.tiles[0]!.samples.fill(12345);
    for (const frame of frames.slice(1)) client.push(bytesOf(frame));
    await settle();
    expect(got.errors).toEqual([]);
    expect(got.frames[1]!.tiles[0]!.samples.every((v) => Math.abs(v) < 10_000)).toBe(true);
  });

  test("after reset nothing from before comes out, and the next session starts afresh", async () => {
    const client = new DecodeClient(await workerModule().then((w) => () => w));
    const got = collect(client);
    for (const frame of frames.slice(0, 3)) client.push(bytesOf(frame));
    client.reset();
    await settle();
    expect(got.frames).toEqual([]);
    client.push(bytesOf(frames[1]!));
    await settle();
    expect(got.errors.length).toBe(1);
    expect(got.errors[0]).toBeInstanceOf(FrameError);
    client.reset();
    for (const frame of frames) client.push(bytesOf(frame));
    await settle();
    expect(got.frames.length).toBe(frames.length);
  });

  test.each(["worker", "inline"])("after an error nothing comes out until reset (%s)", async (kind) => {
    const worker = kind === "worker" ? await workerModule() : null;
    const client = new DecodeClient(worker ? () => worker : noWorker);
    const got = collect(client);
    client.push(bytesOf(frames[0]!));
    client.push(new ArrayBuffer(7));
    client.push(bytesOf(frames[1]!));
    await settle();
    client.push(bytesOf(frames[1]!));
    await settle();
    expect(got.frames.length).toBe(1);
    expect(got.errors.length).toBe(1);
    client.reset();
    client.push(bytesOf(frames[0]!));
    await settle();
    expect(got.frames.length).toBe(2);
  });

  test("a worker whose script never runs is replaced by the inline decoder, and no frame is lost", async () => {
    const dead: DecodeWorker & { terminated?: boolean } = {
      onmessage: null,
      onerror: null,
      postMessage: (message, transfer) => void structuredClone(message, { transfer }),
      terminate() {
        dead.terminated = true;
      },
    };
    const client = new DecodeClient(() => dead);
    const got = collect(client);
    for (const frame of frames.slice(0, 2)) client.push(bytesOf(frame));
    dead.onerror!({} as ErrorEvent);
    for (const frame of frames.slice(2)) client.push(bytesOf(frame));
    expect(dead.terminated).toBe(true);
    expect(got.errors).toEqual([]);
    expect(got.frames.length).toBe(frames.length);
  });

  test("a worker that stops later is an error, and reset goes on inline", async () => {
    const worker = await workerModule();
    const client = new DecodeClient(() => worker);
    const got = collect(client);
    client.push(bytesOf(frames[0]!));
    await settle();
    worker.onerror!({} as ErrorEvent);
    expect(got.errors.length).toBe(1);
    client.reset();
    for (const frame of frames) client.push(bytesOf(frame));
    expect(got.frames.length).toBe(1 + frames.length);
  });

  test("listeners can be removed", () => {
    const client = new DecodeClient(noWorker);
    const seen = vi.fn();
    client.onFrame(seen)();
    client.push(bytesOf(frames[0]!));
    expect(seen).not.toHaveBeenCalled();
  });
});
