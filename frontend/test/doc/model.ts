/** A tiny server that orders ops, and a network of unreliable wires with a seeded clock: the model of the sync tests. */

import { apply, type Doc, Refusal } from "../../src/doc/apply.ts";
import { fromDocument, toDocument } from "../../src/doc/document.ts";
import { SyncDoc } from "../../src/doc/sync.ts";
import type {
  Document,
  Op,
  OpEnvelope,
  OrderedOp,
  ServerMessage,
  Stroke,
  Welcome,
} from "../../src/generated/contract.ts";
import { SETTINGS } from "../settings.ts";
import { welcomeOf } from "./welcome.ts";

/** Mulberry32: a small seeded generator of numbers in [0, 1). */
export function random(seed: number): () => number {
  let a = seed >>> 0;
  return () => {
    a = (a + 0x6d2b79f5) >>> 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

export const EMPTY: Document = {
  id: "t1",
  clock: 0,
  settings: SETTINGS,
  strokes: [],
  deleted: [],
  layers: [],
  deleted_layers: [],
};

export function ridge(id: string, over: Partial<Stroke> = {}): Stroke {
  return {
    id,
    author: "a",
    kind: "profile",
    first: [100, 100, 0],
    last: [900, 100, 0],
    curve: [],
    left: null,
    right: null,
    plateau_radius_m: 0,
    amplitude_m: 0,
    roughness: 0.5,
    yields: 0,
    paint: null,
    course: null,
    locked: false,
    hidden: false,
    label: "",
    finished: false,
    ...over,
  };
}

export class ServerModel {
  doc: Doc = fromDocument(EMPTY);
  readonly journal: OrderedOp[] = [];
  readonly #clocks = new Map<string, number>();
  readonly links = new Set<Link>();
  /** Resumes farther back than this get a snapshot. */
  keep = 30;

  receive(from: Link, ops: readonly OpEnvelope[]): void {
    for (const { id, op } of ops) {
      const known = this.#clocks.get(id);
      if (known !== undefined) {
        from.deliver({ type: "ack", ids: [id], clocks: [known] });
        continue;
      }
      try {
        this.doc = apply(this.doc, op);
      } catch (error) {
        if (!(error instanceof Refusal)) throw error;
        from.deliver({ type: "reject", id, code: error.code, message: error.message });
        continue;
      }
      const ordered: OrderedOp = { clock: this.doc.clock, id, author: "x", op };
      this.journal.push(ordered);
      this.#clocks.set(id, this.doc.clock);
      for (const link of this.links)
        link.deliver(
          link === from ? { type: "ack", ids: [id], clocks: [this.doc.clock] } : { type: "ordered", ops: [ordered] },
        );
    }
  }

  /** An op of the server's own, in the name of a client. */
  perform(op: Op, id: string, author: string): void {
    this.doc = apply(this.doc, op);
    const ordered: OrderedOp = { clock: this.doc.clock, id, author, op };
    this.journal.push(ordered);
    for (const link of this.links) link.deliver({ type: "ordered", ops: [ordered] });
  }

  welcome(clock: number | null): Welcome {
    const resume = clock !== null && this.doc.clock - clock <= this.keep;
    return welcomeOf({
      server: "model",
      client: "c",
      clock: this.doc.clock,
      document: resume ? null : toDocument(this.doc),
      ops: resume ? this.journal.filter((o) => o.clock > clock) : null,
      device: "model",
    });
  }
}

/** One client's wire: messages arrive in order, later; a cut loses what is under way in both directions. */
export class Link {
  readonly sync: SyncDoc;
  readonly #server: ServerModel;
  up = false;
  #toClient: { at: number; message: ServerMessage }[] = [];
  #toServer: { at: number; ops: OpEnvelope[] }[] = [];
  readonly #delay: () => number;
  readonly #now: () => number;

  constructor(server: ServerModel, client: string, now: () => number, delay: () => number) {
    this.#server = server;
    this.#delay = delay;
    this.#now = now;
    this.sync = new SyncDoc(client, now);
  }

  connect(): void {
    if (this.up) return;
    this.up = true;
    this.deliver(this.#server.welcome(this.sync.clock));
    this.#server.links.add(this);
  }

  cut(): void {
    this.up = false;
    this.#toClient = [];
    this.#toServer = [];
    this.#server.links.delete(this);
    this.sync.disconnected();
  }

  deliver(message: ServerMessage): void {
    const last = this.#toClient.at(-1)?.at ?? 0;
    this.#toClient.push({ at: Math.max(last, this.#now() + this.#delay()), message: structuredClone(message) });
  }

  /** Sends what is due and delivers what has arrived. */
  pump(): void {
    if (this.up && this.sync.doc.value !== null) {
      const ops = this.sync.outgoing();
      const last = this.#toServer.at(-1)?.at ?? 0;
      if (ops.length > 0)
        this.#toServer.push({ at: Math.max(last, this.#now() + this.#delay()), ops: structuredClone(ops) });
    }
    while (this.#toServer[0] !== undefined && this.#toServer[0].at <= this.#now())
      this.#server.receive(this, this.#toServer.shift()!.ops);
    while (this.#toClient[0] !== undefined && this.#toClient[0].at <= this.#now())
      this.#take(this.#toClient.shift()!.message);
  }

  get idle(): boolean {
    return this.#toClient.length === 0 && this.#toServer.length === 0 && this.sync.pending.value === 0;
  }

  #take(message: ServerMessage): void {
    if (message.type === "welcome") this.sync.welcome(message);
    else if (message.type === "ack") this.sync.ack(message);
    else if (message.type === "reject") this.sync.reject(message);
    else if (message.type === "ordered") this.sync.ordered(message);
  }
}
