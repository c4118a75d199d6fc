// SPEC HI12, HI15, HI17, HI18
import { signal } from "@preact/signals-core";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { entryAt, History, type HistoryEntry, type HistoryPage, joined } from "../../src/app/history/history.ts";
import { HistoryView, type HistoryViewHandlers } from "../../src/app/history/history-view.ts";
import { Pace, rate } from "../../src/app/history/pace.ts";
import type { Doc } from "../../src/doc/document.ts";
import { SyncDoc } from "../../src/doc/sync.ts";
import type { ClientMessage, Document, Op, Welcome } from "../../src/generated/contract.ts";
import { PROTOCOL_VERSION } from "../../src/generated/contract.ts";
import { welcomeOf } from "../doc/welcome.ts";

const entry = (first: number, last = first, author = "ana"): HistoryEntry => ({
  ...{ first, last, author, at: null, action: "draw", turn: "", text: `did ${first}` },
});
const page = (entries: HistoryEntry[], more = false): HistoryPage => ({
  ...{ clock: entries[0]?.last ?? 0, first: 0, more, entries, people: { ana: { name: "Ana", colour: "#112233" } } },
});

const settings = { size_m: 4096, title: "T" } as Document["settings"];
const title = (text: string): Op => ({ type: "terrain.set", fields: { title: text } });

function document(clock: number, text: string): Document {
  return {
    ...{ id: "t", clock, settings: { ...settings, title: text } },
    ...{ strokes: [], deleted: [], layers: [], deleted_layers: [] },
  };
}

function welcome(doc: Document): Welcome {
  return welcomeOf({ role: "view", finest: 8, clock: doc.clock, document: doc });
}

describe("the list", () => {
  const lasts = (entries: readonly HistoryEntry[]) => entries.map((e) => e.last);

  it("keeps what is known below the newest page, grown entries once", () => {
    const known = [entry(5, 9), entry(3, 4, "ben"), entry(1, 2)];
    const newer = joined(page([entry(10, 12, "ben"), entry(5, 11)], true), known, false);
    expect(lasts(newer.entries)).toEqual([12, 11, 4, 2]);
    expect(newer.more).toBe(false);
  });

  it("leaves no gap: what does not touch the newest page is asked for again", () => {
    const newer = joined(page([entry(40), entry(30)], true), [entry(1, 2)], false);
    expect(lasts(newer.entries)).toEqual([40, 30]);
    expect(newer.more).toBe(true);
  });

  it("finds what was done last at a clock", () => {
    const entries = [entry(4, 9, "ben"), entry(3, 6), entry(1, 2)];
    expect([6, 5, 2, 9, 0].map((clock) => entryAt(entries, clock)?.first ?? null)).toEqual([3, 4, 1, 4, null]);
  });

  describe("while it is read", () => {
    beforeEach(() => void vi.useFakeTimers());
    afterEach(() => void vi.useRealTimers());

    it("follows the terrain, not more often than once a second, and says when it cannot", async () => {
      let clock = 1;
      const fetch = vi.fn(async () => page([entry(clock)]));
      const history = new History(fetch);
      history.follow(1);
      await vi.advanceTimersByTimeAsync(0);
      expect([history.state.value, lasts(history.entries.value)]).toEqual(["ready", [1]]);
      expect(history.nameOf("ana")).toBe("Ana");
      for (clock = 2; clock < 6; clock++) {
        history.follow(clock);
        await vi.advanceTimersByTimeAsync(100);
      }
      expect(fetch).toHaveBeenCalledTimes(1);
      clock = 5;
      await vi.advanceTimersByTimeAsync(1000);
      expect(fetch).toHaveBeenCalledTimes(2);
      history.follow(5);
      await vi.advanceTimersByTimeAsync(5000);
      expect(fetch).toHaveBeenCalledTimes(2);
      fetch.mockRejectedValueOnce(new Error("gone"));
      history.follow(6);
      await vi.advanceTimersByTimeAsync(1000);
      expect(history.state.value).toBe("failed");
      clock = 6;
      history.retry();
      await vi.advanceTimersByTimeAsync(1000);
      expect(history.state.value).toBe("ready");
      history.follow(7);
      history.stop();
      await vi.advanceTimersByTimeAsync(3000);
      expect(fetch).toHaveBeenCalledTimes(4);
    });
  });
});

/** The test plays the server of the past. */
function looking() {
  const sent: ClientMessage[] = [];
  const shown: (number | null)[] = [];
  const lines: { state: ReturnType<typeof signal<string>>; closed: boolean; handlers: HistoryViewHandlers }[] = [];
  const calls = { restart: 0, back: 0, ended: "" };
  const historyView = new HistoryView({
    connect: (handlers) => {
      const line = { state: signal("online"), closed: false, handlers };
      lines.push(line);
      return {
        state: line.state,
        reason: signal("crowded"),
        send: (m) => sent.push(m) > 0,
        reconnect: () => {},
        close: () => {
          line.closed = true;
        },
      };
    },
    hello: () => ({ type: "hello", protocol: PROTOCOL_VERSION, terrain: "t", secret: "s", client: "me", clock: 41 }),
    show: (doc) => shown.push(doc?.clock ?? null),
    restart: () => calls.restart++,
    frame: () => true,
    progress: () => {},
    ended: (why) => {
      calls.ended = why;
    },
    back: () => calls.back++,
  });
  return { historyView, sent, shown, lines, calls };
}

describe("the past", () => {
  beforeEach(() => void vi.useFakeTimers());
  afterEach(() => void vi.useRealTimers());

  it("opens at a clock and goes to the last one that was asked for, one step at a time", async () => {
    const { historyView, sent, shown, lines, calls } = looking();
    historyView.look(7);
    expect(lines[0]!.handlers.hello()).toMatchObject({ at: 7, clock: null });
    historyView.look(8);
    historyView.look(9);
    expect(sent).toEqual([]);
    lines[0]!.handlers.onMessage(welcome(document(7, "seven")));
    await vi.advanceTimersByTimeAsync(200);
    expect(sent).toEqual([{ type: "seek", clock: 9 }]);
    historyView.look(3);
    await vi.advanceTimersByTimeAsync(200);
    expect(sent.length).toBe(1);
    const ops = [8, 9].map((clock) => ({ clock, id: `c:${clock}`, author: "c", op: title(`${clock}`) }));
    lines[0]!.handlers.onMessage({ type: "ordered", ops });
    await vi.advanceTimersByTimeAsync(200);
    expect(sent.at(-1)).toEqual({ type: "seek", clock: 3 });
    lines[0]!.handlers.onMessage(welcome(document(3, "three")));
    expect(shown).toEqual([7, 9, 3]);
    expect(historyView.shown.value).toBe(3);
    expect(calls.restart).toBe(1);
  });

  it("does not ask for more clocks a second than the server takes", async () => {
    const { historyView, sent, lines } = looking();
    historyView.look(0);
    lines[0]!.handlers.onMessage(welcome(document(0, "")));
    for (let clock = 1; clock <= 100; clock++) {
      historyView.look(clock);
      await vi.advanceTimersByTimeAsync(10);
      const last = sent.at(-1);
      if (last?.type === "seek" && last.clock !== historyView.shown.peek())
        lines[0]!.handlers.onMessage(welcome(document(last.clock, "")));
    }
    expect(sent.length).toBeGreaterThan(8);
    expect(sent.length).toBeLessThanOrEqual(13);
  });

  it("goes back to now, by itself where the server ends it", async () => {
    const { historyView, shown, lines, calls } = looking();
    historyView.look(2);
    lines[0]!.handlers.onMessage(welcome(document(2, "")));
    historyView.leave();
    expect([historyView.active.value, shown.at(-1), lines[0]!.closed, calls.back]).toEqual([false, null, true, 1]);
    lines[0]!.handlers.onMessage(welcome(document(1, "late")));
    expect(shown.at(-1)).toBe(null);
    historyView.look(2);
    lines[1]!.state.value = "closed";
    await vi.advanceTimersByTimeAsync(0);
    expect([historyView.active.value, calls.ended, calls.back]).toEqual([false, "crowded", 2]);
  });
});

describe("the document", () => {
  it("of now goes on behind the past, and takes nothing new", () => {
    const sync = new SyncDoc("me");
    const old: Doc[] = [];
    const seen = () => sync.doc.value?.settings.title;
    sync.welcome(welcome(document(0, "old")));
    old.push(sync.doc.value!);
    sync.submit(title("mine"));
    sync.lookAt(old[0]!);
    expect(seen()).toBe("old");
    expect(sync.submit(title("no"))?.code).toBe("view_only");
    expect(sync.undo()).toEqual({ done: false, skipped: [] });
    expect(sync.outgoing().map((e) => e.op)).toEqual([title("mine")]);
    sync.ordered({ type: "ordered", ops: [{ clock: 1, id: "other:1", author: "other", op: title("theirs") }] });
    expect([seen(), sync.clock, sync.pending.value]).toEqual(["old", 1, 1]);
    sync.lookAt(null);
    expect(seen()).toBe("mine");
  });
});

describe("the time lapse", () => {
  it("draws as fast as it was drawn, and takes half a minute at most", () => {
    expect([rate(10), rate(900), rate(90_000)]).toEqual([30, 30, 3000]);
    const timeLapse = new Pace();
    timeLapse.start(0);
    const clocks = Array.from({ length: 300 }, () => timeLapse.advance(0.1, 90_000, 1));
    expect(clocks[99]).toBe(30_000);
    expect(clocks.at(-1)).toBe(90_000);
    timeLapse.start(10);
    expect([timeLapse.advance(0.1, 100, 2), timeLapse.advance(9, 100, 0.5)]).toEqual([16, 100]);
  });
});
