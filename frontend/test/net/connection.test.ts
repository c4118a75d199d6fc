// @vitest-environment happy-dom
// The life of a connection against a socket that the test plays (SPEC I30-I34).
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { DecodedFrame } from "../../src/core/types.ts";
import type { ServerMessage } from "../../src/generated/contract.ts";
import { MOVED_WITHIN_MS, PROTOCOL_VERSION, SUBPROTOCOL } from "../../src/generated/contract.ts";
import { Connection, type FrameSource } from "../../src/net/connection.ts";

class FakeSocket {
  static all: FakeSocket[] = [];
  readonly sent: Record<string, unknown>[] = [];
  readyState = 0;
  bufferedAmount = 0;
  binaryType = "blob";
  onopen: (() => void) | null = null;
  onmessage: ((e: { data: unknown }) => void) | null = null;
  onclose: ((e: { code: number }) => void) | null = null;

  constructor(
    readonly url: string,
    readonly protocol: string,
  ) {
    FakeSocket.all.push(this);
  }

  send(text: string): void {
    this.sent.push(JSON.parse(text) as Record<string, unknown>);
  }

  close(): void {
    this.readyState = 3;
  }

  open(): void {
    this.readyState = 1;
    this.onopen?.();
  }

  say(message: unknown): void {
    this.onmessage?.({ data: typeof message === "string" ? message : JSON.stringify(message) });
  }

  die(code = 1006): void {
    this.readyState = 3;
    this.onclose?.({ code });
  }

  static get last(): FakeSocket {
    return FakeSocket.all.at(-1)!;
  }
}

class FakeDecoder implements FrameSource {
  resets = 0;
  #frame: (f: DecodedFrame) => void = () => {};
  #error: (e: Error) => void = () => {};
  push(buffer: ArrayBuffer): void {
    if (buffer.byteLength === 1) this.#error(new Error("truncated"));
    else this.#frame({ bytes: buffer.byteLength } as DecodedFrame);
  }
  onFrame(listener: (f: DecodedFrame) => void): void {
    this.#frame = listener;
  }
  onError(listener: (e: Error) => void): void {
    this.#error = listener;
  }
  reset(): void {
    this.resets++;
  }
  close(): void {}
}

const WELCOME = { type: "welcome", token: "", clock: 0, members: [] };
let decoder: FakeDecoder;
let messages: ServerMessage[];
let frames: { bytes: number; sent: number }[];
let open: Connection[];

function connect(random = () => 0.5): Connection {
  decoder = new FakeDecoder();
  messages = [];
  frames = [];
  const connection = new Connection({
    url: "ws://localhost/ws",
    hello: () => ({ type: "hello", protocol: PROTOCOL_VERSION, terrain: "t", secret: "s", client: "c", clock: null }),
    onMessage: (m) => messages.push(m),
    onFrame: (f) => frames.push({ bytes: f.bytes, sent: FakeSocket.last.sent.length }),
    random,
    decoder,
  });
  open.push(connection);
  return connection;
}

function online(connection = connect()): Connection {
  FakeSocket.last.open();
  FakeSocket.last.say(WELCOME);
  return connection;
}

beforeEach(() => {
  FakeSocket.all = [];
  open = [];
  vi.useFakeTimers();
  vi.stubGlobal("WebSocket", FakeSocket);
});

afterEach(() => {
  for (const connection of open) connection.close();
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

describe("opening", () => {
  it("says hello first and is online with the welcome (SPEC I30)", () => {
    const c = connect();
    expect(FakeSocket.last.protocol).toBe(SUBPROTOCOL);
    expect(FakeSocket.last.binaryType).toBe("arraybuffer");
    expect(c.send({ type: "credit", bytes: 1 })).toBe(false);
    FakeSocket.last.open();
    expect(FakeSocket.last.sent.map((m) => m.type)).toEqual(["hello"]);
    expect(c.state.value).toBe("connecting");
    expect(c.send({ type: "credit", bytes: 1 })).toBe(false);
    FakeSocket.last.say(WELCOME);
    expect(c.state.value).toBe("online");
    expect(c.send({ type: "credit", bytes: 1 })).toBe(true);
    expect(messages.map((m) => m.type)).toEqual(["welcome"]);
  });

  it("gives up on a server that opens and says nothing", () => {
    const c = connect();
    FakeSocket.last.open();
    vi.advanceTimersByTime(16_000);
    expect(c.state.value).toBe("reconnecting");
    expect(FakeSocket.all.length).toBe(2);
  });
});

describe("messages and frames", () => {
  it("returns credit after the frame was applied (SPEC I31)", () => {
    online();
    const before = FakeSocket.last.sent.length;
    FakeSocket.last.onmessage?.({ data: new ArrayBuffer(1234) });
    expect(frames).toEqual([{ bytes: 1234, sent: before }]);
    expect(FakeSocket.last.sent.at(-1)).toEqual({ type: "credit", bytes: 1234 });
  });

  it("never sends what the contract forbids", () => {
    const c = online();
    expect(() => c.send({ type: "view", eye: [Number.NaN, 0, 0], target: [0, 0, 0] })).toThrow(TypeError);
    expect(FakeSocket.last.sent.filter((m) => m.type === "view")).toEqual([]);
  });

  it("skips views and presence, never ops, while the socket is crowded", () => {
    const c = online();
    FakeSocket.last.bufferedAmount = 1 << 20;
    expect(c.send({ type: "presence" })).toBe(false);
    expect(c.send({ type: "ops", ops: [{ id: "c:1", op: { type: "stroke.finish", stroke: "s" } }] })).toBe(true);
  });

  it("ignores message types that it does not know, and starts afresh after garbage", () => {
    const c = online();
    FakeSocket.last.say({ type: "weather", sun: true });
    expect(c.state.value).toBe("online");
    vi.spyOn(console, "warn").mockImplementation(() => {});
    FakeSocket.last.say("{");
    expect(c.state.value).toBe("reconnecting");
  });

  it("measures the round trip", () => {
    const c = online();
    const ping = FakeSocket.last.sent.find((m) => m.type === "ping")!;
    vi.advanceTimersByTime(80);
    FakeSocket.last.say({ type: "pong", t: ping.t });
    expect(c.rttMs.value).toBeCloseTo(80, 0);
  });
});

describe("losing the connection", () => {
  it("reconnects with growing, jittered delays and a fresh decoder (SPEC I32)", () => {
    const c = online(connect(() => 1));
    const delays: number[] = [];
    for (let i = 0; i < 8; i++) {
      const count = FakeSocket.all.length;
      FakeSocket.last.die();
      expect(c.state.value).toBe("reconnecting");
      let waited = 0;
      for (; FakeSocket.all.length === count; waited += 50) vi.advanceTimersByTime(50);
      delays.push(waited);
    }
    expect(delays).toEqual([400, 800, 1600, 3200, 6400, 12800, 15000, 15000]);
    expect(decoder.resets).toBe(9);
    FakeSocket.last.open();
    FakeSocket.last.say(WELCOME);
    expect(c.state.value).toBe("online");
    expect(c.reason.value).toBeNull();
  });

  it("jitter spreads a room over half of the delay", () => {
    online(connect(() => 0));
    FakeSocket.last.die();
    vi.advanceTimersByTime(199);
    expect(FakeSocket.all.length).toBe(1);
    vi.advanceTimersByTime(2);
    expect(FakeSocket.all.length).toBe(2);
  });

  it.each([4000, 4001, 4003, 4004, 4005, 4006, 4007, 4008, 4011])("close code %i is final (SPEC I33)", (code) => {
    const c = online();
    FakeSocket.last.die(code);
    expect(c.state.value).toBe("closed");
    expect(c.reason.value).toMatch(/\.$/);
    vi.advanceTimersByTime(60_000);
    expect(FakeSocket.all.length).toBe(1);
  });

  it.each([1000, 1001, 1006, 1011, 4009, 4010, 4500, 4501, 4502])("close code %i is not final", (code) => {
    const c = online();
    FakeSocket.last.die(code);
    expect(c.state.value).toBe("reconnecting");
    vi.advanceTimersByTime(1000);
    expect(FakeSocket.all.length).toBe(2);
  });

  it("whoever is told that the terrain moves comes back within a time that it draws (SPEC P582)", () => {
    const c = online(connect(() => 0.5));
    FakeSocket.last.die(4502);
    expect(c.reason.value).toBe("This terrain moves to another server.");
    vi.advanceTimersByTime(MOVED_WITHIN_MS / 2 - 1);
    expect(FakeSocket.all.length).toBe(1);
    vi.advanceTimersByTime(1);
    expect(FakeSocket.all.length).toBe(2);
    FakeSocket.last.open();
    FakeSocket.last.die(4502); // it moves still: one of the growing delays
    vi.advanceTimersByTime(599);
    expect(FakeSocket.all.length).toBe(2);
    vi.advanceTimersByTime(1);
    expect(FakeSocket.all.length).toBe(3);
  });

  it("the server's own sentence is the reason", () => {
    const c = online();
    FakeSocket.last.say({ type: "error", code: "revoked", message: "Ada has revoked this link.", fatal: true });
    FakeSocket.last.die(4004);
    expect(c.reason.value).toBe("Ada has revoked this link.");
  });

  it("a frame that does not decode starts afresh", () => {
    vi.spyOn(console, "warn").mockImplementation(() => {});
    const c = online();
    FakeSocket.last.onmessage?.({ data: new ArrayBuffer(1) });
    expect(c.state.value).toBe("reconnecting");
  });

  it("a silent connection is given up, one that answers is kept (SPEC I34)", () => {
    const c = online();
    for (let i = 0; i < 10; i++) {
      vi.advanceTimersByTime(5000);
      FakeSocket.last.say({ type: "pong", t: performance.now() });
    }
    expect(FakeSocket.all.length).toBe(1);
    vi.advanceTimersByTime(20_100);
    expect(c.reason.value).toBe("The connection went silent.");
    expect(FakeSocket.all.length).toBe(2);
  });

  it("the browser's online event retries at once", () => {
    online();
    FakeSocket.last.die();
    globalThis.dispatchEvent(new Event("online"));
    expect(FakeSocket.all.length).toBe(2);
    globalThis.dispatchEvent(new Event("online"));
    expect(FakeSocket.all.length).toBe(2);
  });

  it("close is final and silent", () => {
    const c = online();
    c.close();
    expect(c.state.value).toBe("closed");
    expect(c.reason.value).toBeNull();
    globalThis.dispatchEvent(new Event("online"));
    vi.advanceTimersByTime(60_000);
    expect(FakeSocket.all.length).toBe(1);
    expect(c.send({ type: "credit", bytes: 1 })).toBe(false);
  });

  it("an old socket that still talks is not heard", () => {
    online();
    const old = FakeSocket.last;
    old.die();
    vi.advanceTimersByTime(1000);
    const count = messages.length;
    old.say({ type: "ack", ids: [], clocks: [] });
    expect(messages.length).toBe(count);
  });
});
