// SPEC U4, U5, U10, U13, U18, U20
// @vitest-environment happy-dom
import { type Signal, signal } from "@preact/signals-core";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { DecodedFrame } from "../../src/core/types.ts";
import type { ClientMessage, Hello, Role, ServerMessage, Stroke, Welcome } from "../../src/generated/contract.ts";
import { welcomeOf } from "../doc/welcome.ts";
import { SETTINGS } from "../settings.ts";

/** Stands for the websocket: the test plays the server. */
class FakeConnection {
  static last: FakeConnection;
  readonly state: Signal<string> = signal("connecting");
  readonly reason: Signal<string | null> = signal(null);
  readonly rttMs = signal(null);
  readonly sent: ClientMessage[] = [];
  readonly options: { hello(): Hello; onMessage(m: ServerMessage): void; onFrame(f: DecodedFrame): void };
  reconnects = 0;

  constructor(options: FakeConnection["options"]) {
    this.options = options;
    FakeConnection.last = this;
  }

  send(message: ClientMessage): boolean {
    if (this.state.value !== "online") return false;
    this.sent.push(structuredClone(message));
    return true;
  }

  of<T extends ClientMessage["type"]>(type: T): Extract<ClientMessage, { type: T }>[] {
    return this.sent.filter((m): m is Extract<ClientMessage, { type: T }> => m.type === type);
  }

  reconnect(): void {
    this.reconnects++;
  }
  close(): void {}
}

class FakeStage {
  static restarts = 0;
  readonly camera = {
    state: signal({ eye: [0, 0, 100], target: [10, 10, 0], fovDeg: 45, width: 800, height: 600 }),
  };
  readonly cursor = signal([1, 2, 3]);
  readonly water = { place: signal(null) };
  readonly input = { tool: signal("mountain"), drawing: signal(null), held: signal(null) };
  static told: unknown[] = [];
  readonly groundwork = { receive: (message: unknown) => FakeStage.told.push(message) };
  async start(): Promise<void> {}
  restart(): void {
    FakeStage.restarts++;
  }
  followed(): void {}
  static agrees = true;
  apply(): boolean {
    return FakeStage.agrees;
  }
  dispose(): void {}
}

vi.mock("../../src/net/connection.ts", () => ({ Connection: FakeConnection }));
vi.mock("../../src/app/view/stage.ts", () => ({ Stage: FakeStage }));

const { TerrainSession } = await import("../../src/app/session.ts");
const { recentTerrains } = await import("../../src/app/device/storage.ts");
const { fullStroke } = await import("../../src/doc/document.ts");
const { speak } = await import("../../src/core/language.ts");

function welcome(role: Role = "owner", change: Partial<Welcome> = {}): Welcome {
  return welcomeOf({
    server: "0.1.0",
    client: "c",
    role,
    colour: "#ff8000",
    clock: 3,
    document: {
      id: "t",
      clock: 3,
      settings: { ...SETTINGS, title: "Ridge" },
      strokes: [],
      deleted: [],
      layers: [],
      deleted_layers: [],
    },
    device: "numpy",
    ...change,
  });
}

/** The solver has settled everything. */
const progress = {
  type: "progress",
  clock: 3,
  level: 4,
  of: 4,
  settled: true,
  refining: 0,
  laying: false,
} as const;

const line: Stroke = fullStroke({
  id: "s1",
  kind: "profile",
  first: [0, 0, 0],
  last: [100, 0, 0],
  curve: [
    [0, 0],
    [1, 0],
  ],
});

let session: InstanceType<typeof TerrainSession>;
const server = () => FakeConnection.last;

function say(message: ServerMessage): void {
  if (message.type === "welcome") server().state.value = "online";
  server().options.onMessage(message);
}

beforeEach(() => {
  vi.useFakeTimers();
  localStorage.clear();
  FakeStage.restarts = 0;
  session = new TerrainSession("t", "secret", document.createElement("div"));
});
afterEach(() => {
  session.dispose();
  vi.useRealTimers();
});

const settle = () => vi.advanceTimersByTimeAsync(200);

describe("a session", () => {
  it("says who it is, and opens the stage when the server has answered", async () => {
    expect(server().options.hello()).toMatchObject({ type: "hello", terrain: "t", secret: "secret", clock: null });
    expect(session.stage.value).toBeNull();
    say(welcome());
    await settle();
    expect(session.stage.value).not.toBeNull();
    expect(session.status.value.text).toBe("Saved");
    expect(document.title).toBe("Ridge · Esker");
    expect(recentTerrains(localStorage)).toMatchObject([{ id: "t", title: "Ridge", secret: "secret", role: "owner" }]);
    expect(server().of("view")).toHaveLength(1);
  });

  it("sends an op at once and says Saved only after its acknowledgement", async () => {
    say(welcome());
    expect(session.submit({ type: "stroke.begin", stroke: line })).toBe(true);
    expect(session.status.value.text).toBe("Saving 1 change…");
    await settle();
    const [envelope] = server().of("ops")[0]!.ops;
    expect(envelope!.op).toMatchObject({ type: "stroke.begin" });
    expect(session.status.value.text).toBe("Saving 1 change…");
    say({ type: "ack", ids: [envelope!.id], clocks: [4] });
    expect(session.status.value.text).toBe("Saved");
    expect(session.doc.clock).toBe(4);
  });

  it("rolls a refused op back and says why", async () => {
    say(welcome());
    session.submit({ type: "stroke.begin", stroke: line });
    await settle();
    const [envelope] = server().of("ops")[0]!.ops;
    say({ type: "reject", id: envelope!.id, code: "too_many_strokes", message: "A terrain holds at most 5 strokes." });
    expect(session.doc.doc.value!.strokes.size).toBe(0);
    expect(session.toasts.list.value.map((t) => t.text)).toEqual(["A terrain holds at most 5 strokes."]);
  });

  it("says what the server refused by its code, and what the page refused in its own words (SPEC U651)", async () => {
    await speak("de");
    say(welcome());
    session.submit({ type: "stroke.begin", stroke: line });
    await settle();
    const [envelope] = server().of("ops")[0]!.ops;
    say({ type: "reject", id: envelope!.id, code: "too_many_strokes", message: "A terrain holds at most 5 strokes." });
    expect(session.submit({ type: "stroke.restore", stroke: "s9" })).toBe(false);
    await speak("en");
    expect(session.toasts.list.value.map((t) => t.text)).toEqual([
      "Dieses Gelände hat so viele Linien, wie es fasst.",
      "Es gibt keine solche gelöschte Linie, die man wiederherstellen könnte.",
    ]);
  });

  it("keeps what is unconfirmed over a cut and sends it again", async () => {
    say(welcome());
    say({
      type: "presences",
      members: [{ client: "ana", cursor: [1, 1, 1], tool: "", stroke: null, eye: null, target: null }],
    });
    session.submit({ type: "stroke.begin", stroke: line });
    await settle();
    const id = server().of("ops")[0]!.ops[0]!.id;
    server().state.value = "reconnecting";
    expect(session.status.value).toMatchObject({ tone: "warn", text: "Offline · 1 change kept" });
    expect(session.presences.value.size).toBe(0);
    server().sent.length = 0;
    session.submit({ type: "stroke.finish", stroke: "s1" });
    await settle();
    expect(server().sent).toEqual([]);
    expect(server().options.hello().clock).toBe(3);
    say(welcome("owner", { document: null, ops: [] }));
    await settle();
    expect(FakeStage.restarts).toBe(1);
    const again = server()
      .of("ops")
      .flatMap((m) => m.ops);
    expect(again[0]!.id).toBe(id);
    expect(again.map((e) => e.op.type)).toEqual(["stroke.begin", "stroke.finish"]);
  });

  it("sends a long queue in parts that the server accepts", async () => {
    say(welcome());
    for (let i = 0; i < 300; i++) session.submit({ type: "stroke.begin", stroke: { ...line, id: `s${i}` } });
    await settle();
    const first = server()
      .of("ops")
      .flatMap((m) => m.ops).length;
    expect(first).toBeLessThan(300);
    await vi.advanceTimersByTimeAsync(5000);
    expect(
      new Set(
        server()
          .of("ops")
          .flatMap((m) => m.ops.map((e) => e.id)),
      ).size,
    ).toBe(300);
  });

  it("does not draw on a link that may only look", async () => {
    say(welcome("view"));
    expect(session.submit({ type: "stroke.begin", stroke: line })).toBe(false);
    expect(session.toasts.list.value).toHaveLength(1);
    await settle();
    expect(server().of("ops")).toEqual([]);
    expect(session.status.value.text).toBe("Watching");
  });

  it("forgets a secret that the server refuses, and no other", () => {
    say(welcome());
    expect(recentTerrains(localStorage)).toHaveLength(1);
    say({ type: "error", code: "slow_client", message: "Too slow.", fatal: true, ticket: "" });
    expect(recentTerrains(localStorage)).toHaveLength(1);
    say({ type: "error", code: "revoked", message: "This link has been revoked.", fatal: true, ticket: "" });
    expect(recentTerrains(localStorage)).toEqual([]);
  });

  it("sends views at most ten times and presence at most twenty times a second, the last state included", async () => {
    say(welcome());
    await settle();
    server().sent.length = 0;
    const camera = (session.stage.value as unknown as FakeStage).camera;
    for (let i = 1; i <= 200; i++) {
      camera.state.value = { ...camera.state.value, eye: [i, 0, 100] };
      session.viewChanged();
      session.presenceChanged();
      await vi.advanceTimersByTimeAsync(5);
    }
    await settle();
    expect(server().of("view").length).toBeLessThanOrEqual(12);
    expect(server().of("view").length).toBeGreaterThanOrEqual(9);
    expect(server().of("presence").length).toBeLessThanOrEqual(22);
    expect(server().of("view").at(-1)!.eye).toEqual([200, 0, 100]);
    expect(server().of("presence").at(-1)).toMatchObject({ eye: [200, 0, 100], cursor: [1, 2, 3], tool: "mountain" });
  });

  it("lets the browser ask before the page closes with unsaved work, and only then", async () => {
    say(welcome());
    const close = () => {
      const event = new Event("beforeunload", { cancelable: true });
      window.dispatchEvent(event);
      return event.defaultPrevented;
    };
    expect(close()).toBe(false);
    session.submit({ type: "stroke.begin", stroke: line });
    expect(close()).toBe(true);
    await settle();
    say({ type: "ack", ids: [server().of("ops")[0]!.ops[0]!.id], clocks: [4] });
    expect(close()).toBe(false);
  });

  it("keeps the presence of those who are here only", () => {
    say(welcome());
    const presence = (client: string) => ({ client, cursor: null, tool: "", stroke: null, eye: null, target: null });
    const member = (client: string) => ({
      client,
      name: client,
      colour: "#123456",
      role: "edit" as const,
      person: "p",
      conducts: false,
      pen: false,
    });
    say({ type: "members", members: [member("ana"), member("bo")] });
    say({ type: "presences", members: [presence("ana"), presence("bo")] });
    say({ type: "members", members: [member("bo")] });
    expect([...session.presences.value.keys()]).toEqual(["bo"]);
  });

  it("goes on with a rotated secret in the address and in the memory of the device", () => {
    say(welcome());
    session.adoptSecret("fresh/secret");
    expect(session.secret).toBe("fresh/secret");
    expect(window.location.hash).toBe("#fresh%2Fsecret");
    expect(window.location.search).toBe("");
    expect(recentTerrains(localStorage)).toMatchObject([{ secret: "fresh/secret", role: "owner" }]);
  });

  it("keeps what the server says about its solver until it is read, and says each thing once (U18)", () => {
    say(welcome());
    say({ ...progress, note: "The graphics device is gone. Solving on the processor." });
    say({ ...progress, note: "" });
    expect(session.notice.value).toBe("The graphics device is gone. Solving on the processor.");
    session.dismissNotice();
    say({ ...progress, note: "The graphics device is gone. Solving on the processor." });
    expect(session.notice.value).toBeNull();
    say({ ...progress, note: "Too little memory for level 4. Solving to level 3." });
    expect(session.notice.value).toBe("Too little memory for level 4. Solving to level 3.");
  });

  it("connects anew when it holds more tiles than the server can have sent (U20)", () => {
    say(welcome());
    const frame = { kind: 1, level: 9, channel: 0, clock: 3, settled: true, drops: [], tiles: [], bytes: 1 };
    FakeStage.agrees = true;
    server().options.onFrame(frame);
    expect(server().reconnects).toBe(0);
    FakeStage.agrees = false;
    server().options.onFrame(frame);
    expect(server().reconnects).toBe(1);
  });
});

describe("real ground (SPEC U18, U30)", () => {
  it("the making of the base is told in the status line, not as a notice", () => {
    say(welcome());
    say({ ...progress, settled: false, note: "", laying: true });
    expect(session.baseBuilding.value).toBe(true);
    expect(session.notice.value).toBeNull();
    say({ ...progress, settled: false, note: "" });
    expect(session.baseBuilding.value).toBe(true);
    say({ ...progress, note: "" });
    expect(session.baseBuilding.value).toBe(false);
  });

  it("that others bring in reaches the page", () => {
    say(welcome());
    FakeStage.told = [];
    const status = { id: "i", stage: "reading", share: 0.45, text: "", report: null, layer: null } as const;
    say({ type: "importing", author: "Ana", file: "rainier.tif", status });
    expect(FakeStage.told).toEqual([{ type: "importing", author: "Ana", file: "rainier.tif", status }]);
  });
});
