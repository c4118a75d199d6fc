// Confirmed and unconfirmed state of one page, against a model of the server (SPEC P, SPEC I20-I25).
import { describe, expect, it } from "vitest";
import { apply } from "../../src/doc/apply.ts";
import { toDocument } from "../../src/doc/document.ts";
import { fullLayer } from "../../src/doc/layers.ts";
import { mergeOps } from "../../src/doc/merge.ts";
import type { Op, Stroke } from "../../src/generated/contract.ts";
import { Link, random, ridge, ServerModel } from "./model.ts";

const append = (stroke: string, start: number, points: [number, number][]): Op => ({
  type: "stroke.append",
  stroke,
  start,
  points,
  last: [900, 100, 0],
});

class World {
  time = 1_000_000;
  readonly server = new ServerModel();
  readonly links: Link[] = [];

  client(name: string, delay: () => number = () => 0): Link {
    const link = new Link(this.server, name, () => this.time, delay);
    this.links.push(link);
    link.connect();
    link.pump();
    return link;
  }

  run(ms: number, step = 10): void {
    for (const end = this.time + ms; this.time < end; this.time += step) for (const link of this.links) link.pump();
  }
}

describe("one client", () => {
  it("shows an op at once, counts it, and is saved after the ack (SPEC I20)", () => {
    const world = new World();
    const a = world.client("a", () => 50);
    world.run(200);
    expect(a.sync.submit({ type: "stroke.begin", stroke: ridge("s") })).toBeNull();
    expect(a.sync.doc.value!.strokes.has("s")).toBe(true);
    expect(a.sync.pending.value).toBe(1);
    expect(a.sync.clock).toBe(0);
    world.run(200);
    expect(a.sync.pending.value).toBe(0);
    expect(a.sync.clock).toBe(1);
  });

  it("refuses before sending what cannot apply or is malformed", () => {
    const world = new World();
    const a = world.client("a");
    expect(a.sync.submit(append("none", 0, []))?.code).toBe("unknown_stroke");
    expect(a.sync.submit({ type: "stroke.begin", stroke: ridge("s", { first: [Number.NaN, 0, 0] }) })?.code).toBe(
      "malformed",
    );
    const huge = ridge("h", {
      curve: Array.from({ length: 4000 }, (_, i): [number, number] => [i / 7919, Math.PI * i]),
    });
    expect(a.sync.submit({ type: "stroke.begin", stroke: huge })?.code).toBe("too_large");
    expect(a.sync.outgoing()).toEqual([]);
    expect(a.sync.canUndo.value).toBe(false);
  });

  it("merges consecutive unsent appends of one gesture, and never touches what was sent (SPEC I21)", () => {
    const world = new World();
    const a = world.client("a");
    a.sync.submit({ type: "stroke.begin", stroke: ridge("s") }, "g");
    a.sync.submit(append("s", 0, [[0, 0]]), "g");
    a.sync.submit(append("s", 1, [[0.5, 9]]), "g");
    const out = a.sync.outgoing();
    expect(out.map((e) => e.op.type)).toEqual(["stroke.begin", "stroke.append"]);
    expect(out[1]!.op).toEqual(
      append("s", 0, [
        [0, 0],
        [0.5, 9],
      ]),
    );
    a.sync.submit(append("s", 1, [[0.6, 1]]), "g");
    expect(a.sync.outgoing().map((e) => e.op)).toEqual([append("s", 1, [[0.6, 1]])]);
    expect(a.sync.outgoing()).toEqual([]);
  });

  it("what was sent once keeps its content for good: after a cut it is sent again as it was", () => {
    const world = new World();
    const a = world.client("a");
    a.sync.submit({ type: "stroke.begin", stroke: ridge("s") }, "g");
    a.sync.submit(append("s", 0, [[0, 0]]), "g");
    const sent = structuredClone(a.sync.outgoing());
    a.sync.disconnected();
    a.sync.submit(append("s", 1, [[0.5, 9]]), "g");
    a.sync.submit(append("s", 2, [[1, 0]]), "g");
    expect(a.sync.outgoing()).toEqual([]); // nobody is there
    a.sync.welcome(world.server.welcome(0));
    const again = a.sync.outgoing();
    expect(again.slice(0, 2)).toEqual(sent);
    expect(again.slice(2).map((e) => e.op)).toEqual([
      append("s", 1, [
        [0.5, 9],
        [1, 0],
      ]),
    ]);
  });

  it("keeps within the server's rate and message size", () => {
    const world = new World();
    const a = world.client("a");
    for (let i = 0; i < 300; i++) a.sync.submit({ type: "stroke.begin", stroke: ridge(`s${i}`) });
    let sent = 0;
    for (let batch = a.sync.outgoing(); batch.length > 0; batch = a.sync.outgoing()) {
      expect(JSON.stringify({ type: "ops", ops: batch }).length).toBeLessThan(65536);
      sent += batch.length;
    }
    expect(sent).toBe(120);
    world.time += 1000;
    expect(a.sync.outgoing().length).toBe(96);
  });

  it("rolls back a refused op and tells why, once for a stroke that never began (SPEC I22)", () => {
    const world = new World();
    const a = world.client("a");
    const b = world.client("b", () => 100);
    const said: string[] = [];
    b.sync.onRefused((r) => said.push(r.code));
    world.run(300);
    b.sync.submit({ type: "stroke.begin", stroke: ridge("s", { label: "b" }) }, "g");
    b.sync.submit(append("s", 0, [[0, 1]]), "g");
    b.pump();
    b.sync.submit(append("s", 1, [[1, 1]]), "g");
    a.sync.submit({ type: "stroke.begin", stroke: ridge("s", { label: "a", locked: true }) });
    world.run(600);
    expect(said).toEqual(["duplicate_stroke"]);
    expect(b.sync.doc.value!.strokes.get("s")!.label).toBe("a");
    expect(b.sync.pending.value).toBe(0);
    expect(b.sync.canUndo.value).toBe(false);
  });

  it("undoes only its own work and reports what it kept (SPEC I23)", () => {
    const world = new World();
    const a = world.client("a");
    const b = world.client("b");
    a.sync.submit({ type: "stroke.begin", stroke: ridge("s") });
    world.run(50);
    a.sync.submit({ type: "stroke.set", stroke: "s", fields: { label: "mine", roughness: 1 } });
    world.run(50);
    b.sync.submit({ type: "stroke.set", stroke: "s", fields: { label: "theirs" } });
    world.run(50);
    const result = a.sync.undo();
    expect(result.done).toBe(true);
    expect(result.skipped).toEqual(["Somebody else has changed the label of this stroke since; that was kept."]);
    world.run(50);
    for (const link of world.links) {
      const s = link.sync.doc.value!.strokes.get("s")!;
      expect([s.label, s.roughness]).toEqual(["theirs", 0.5]);
    }
    expect(a.sync.canRedo.value).toBe(true);
    expect(a.sync.redo().done).toBe(true);
    expect(a.sync.doc.value!.strokes.get("s")!.roughness).toBe(1);
  });

  it("takes what the server did in my name into my undo, also when I was away (SPEC D31)", () => {
    const world = new World();
    const a = world.client("a");
    const b = world.client("b");
    const grid = (id: string): Op => ({
      type: "layer.add",
      layer: fullLayer({
        id,
        content: "0".repeat(64),
        facts: { rows: 9, cols: 9, low_m: 0, high_m: 9, valid: 1, geo: false, crs: "", format: "", file: "", edge: [] },
        anchor: [0, 0],
        spacing_m: [1, 1],
        accuracy_m: 1,
      }),
    });
    a.cut();
    world.server.perform(grid("v"), "import-1:0", "a");
    world.run(50);
    expect(a.sync.canUndo.value).toBe(false);
    a.connect();
    world.run(50);
    expect([a.sync.canUndo.value, b.sync.canUndo.value]).toEqual([true, false]);
    expect(a.sync.submit({ type: "layer.set", layer: "v", fields: { lift_m: 5 } })).toBeNull();
    world.run(50);
    expect(b.sync.doc.value!.layers.get("v")!.lift_m).toBe(5);
    a.sync.undo();
    expect(a.sync.undo()).toEqual({ done: true, skipped: [] });
    world.run(50);
    expect([...b.sync.doc.value!.layers.keys(), ...b.sync.doc.value!.deletedLayers.keys()]).toEqual(["v"]);
    expect(b.sync.doc.value!.layers.size).toBe(0);
    a.sync.redo();
    world.run(50);
    expect(b.sync.doc.value!.layers.has("v")).toBe(true);
  });

  it("one gesture is one undo step", () => {
    const world = new World();
    const a = world.client("a");
    a.sync.submit({ type: "stroke.begin", stroke: ridge("s") }, "draw");
    a.sync.submit(
      append("s", 0, [
        [0, 0],
        [1, 0],
      ]),
      "draw",
    );
    a.sync.submit({ type: "stroke.finish", stroke: "s" }, "draw");
    world.run(50);
    for (let i = 1; i <= 5; i++) {
      a.sync.submit({ type: "stroke.anchor", stroke: "s", which: "last", to: [900 + i, 100, 0] }, "drag");
      world.run(50);
    }
    a.sync.undo();
    expect(a.sync.doc.value!.strokes.get("s")!.last[0]).toBe(900);
    a.sync.undo();
    expect(a.sync.doc.value!.strokes.size).toBe(0);
    expect(a.sync.undo()).toEqual({ done: false, skipped: [] });
  });

  it("an op in doubt at a cut is not applied twice (SPEC I24)", () => {
    const world = new World();
    const a = world.client("a");
    a.sync.submit({ type: "stroke.begin", stroke: ridge("s") });
    const lost = a.sync.outgoing();
    world.server.receive(a, lost);
    a.cut();
    expect(a.sync.pending.value).toBe(1);
    expect(a.sync.doc.value!.strokes.size).toBe(1);
    world.server.keep = -1;
    a.connect();
    world.run(50);
    expect(a.sync.pending.value).toBe(0);
    expect(world.server.journal.length).toBe(1);
    expect(toDocument(a.sync.doc.value!)).toEqual(toDocument(world.server.doc));
  });

  it("ops wait for earlier ones, whichever message comes first", () => {
    const world = new World();
    const a = world.client("a");
    a.sync.submit({ type: "stroke.begin", stroke: ridge("mine") });
    const [mine] = a.sync.outgoing();
    a.sync.ack({ type: "ack", ids: [mine!.id], clocks: [2] });
    expect(a.sync.clock).toBe(0);
    expect(a.sync.pending.value).toBe(0);
    expect(a.sync.doc.value!.strokes.has("mine")).toBe(true);
    const op: Op = { type: "stroke.begin", stroke: ridge("theirs") };
    a.sync.ordered({ type: "ordered", ops: [{ clock: 1, id: "z:1", author: "z", op }] });
    expect(a.sync.clock).toBe(2);
    expect([...a.sync.doc.value!.strokes.keys()]).toEqual(["theirs", "mine"]);
  });

  it("asks for a snapshot when a confirmed op does not apply", () => {
    const world = new World();
    const a = world.client("a");
    let diverged = 0;
    a.sync.onDiverged(() => diverged++);
    a.sync.ordered({ type: "ordered", ops: [{ clock: 1, id: "z:1", author: "z", op: append("none", 0, []) }] });
    expect(diverged).toBe(1);
    expect(a.sync.clock).toBeNull();
  });
});

describe("merging", () => {
  it("is equivalent to both ops in a row", () => {
    const next = random(5);
    for (let i = 0; i < 300; i++) {
      const curve = (n: number): [number, number][] => Array.from({ length: n }, () => [next(), next()]);
      const start = new ServerModel().doc;
      const base = apply(start, { type: "stroke.begin", stroke: ridge("s", { curve: curve(5) }) });
      const a = append("s", Math.floor(next() * 6), curve(Math.floor(next() * 4)));
      const mid = apply(base, a);
      const b = append(
        "s",
        Math.floor(next() * (mid.strokes.get("s")!.curve.length + 1)),
        curve(Math.floor(next() * 4)),
      );
      const merged = mergeOps(a, b);
      expect(merged).not.toBeNull();
      expect(apply(base, merged!).strokes).toEqual(apply(mid, b).strokes);
    }
  });
});

/** A random thing that a person might do. */
function act(link: Link, next: () => number, count: number): void {
  const doc = link.sync.doc.value;
  if (doc === null) return;
  const strokes = [...doc.strokes.keys()];
  const pick = <T>(from: readonly T[]): T => from[Math.floor(next() * from.length)]!;
  const kind = next();
  const id = strokes.length > 0 ? pick(strokes) : "none";
  const set = (fields: Partial<Stroke>): void =>
    void link.sync.submit({ type: "stroke.set", stroke: id, fields }, pick(["p", "q"]));
  if (kind < 0.2) {
    const name = next() < 0.1 ? "clash" : `s${count}`;
    link.sync.submit({ type: "stroke.begin", stroke: ridge(name) }, `draw${count}`);
    link.sync.submit(
      append(name, 0, [
        [0, 1],
        [0.5, count],
      ]),
      `draw${count}`,
    );
    link.sync.submit(
      append(name, 1, [
        [0.25, 7],
        [1, 1],
      ]),
      `draw${count}`,
    );
  } else if (kind < 0.3) link.sync.submit({ type: "stroke.delete", stroke: id });
  else if (kind < 0.38) link.sync.submit({ type: "stroke.restore", stroke: pick([...doc.deleted.keys(), "none"]) });
  else if (kind < 0.5)
    link.sync.submit({ type: "stroke.anchor", stroke: id, which: "last", to: [count, 5, 6] }, "drag");
  else if (kind < 0.62) set({ label: `l${count}` });
  else if (kind < 0.68) set({ locked: next() < 0.4 });
  else if (kind < 0.74)
    link.sync.submit({ type: "terrain.set", fields: { seed: count, sea_level_m: next() < 0.5 ? null : count } });
  else if (kind < 0.8)
    link.sync.submit({
      type: "group",
      ops: [
        { type: "stroke.set", stroke: id, fields: { roughness: next() } },
        { type: "stroke.finish", stroke: id },
      ],
    });
  else if (kind < 0.92) link.sync.undo();
  else link.sync.redo();
}

describe("seeded simulation (SPEC I25)", () => {
  it.each(Array.from({ length: 200 }, (_, i) => i))("seed %i: all pages converge to the server's document", (seed) => {
    const next = random(seed);
    const world = new World();
    const links = ["a", "b", "c", "d"].map((name) => world.client(name, () => next() * 120));
    for (const link of links) link.sync.onDiverged(() => expect.unreachable("diverged"));
    for (let i = 0; i < 120; i++) {
      const link = links[Math.floor(next() * links.length)]!;
      if (next() < 0.04) link.cut();
      else if (!link.up && next() < 0.3) link.connect();
      else act(link, next, i);
      world.run(20);
    }
    for (const link of links) link.connect();
    for (let i = 0; i < 100 && !links.every((l) => l.idle); i++) world.run(50);
    for (const link of links) {
      expect(link.idle).toBe(true);
      expect(toDocument(link.sync.doc.value!)).toEqual(toDocument(world.server.doc));
    }
    expect(new Set(world.server.journal.map((o) => o.id)).size).toBe(world.server.journal.length);
  });
});
