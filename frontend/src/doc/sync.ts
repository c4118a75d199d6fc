/**
 * The document of one page: what the server confirmed, and my unconfirmed ops replayed on top (DESIGN 4).
 *
 * The server is the only one that orders, so this is all a client needs: apply confirmed ops in the order of their
 * clocks, keep my own until they are acknowledged, roll back what is refused. No I/O and no timers: the owner carries
 * `outgoing()` to the socket and messages back, and the clock is injected.
 */

import { msg, str } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import { checkOp } from "../core/wire.ts";
import {
  type Ack,
  MAX_MESSAGE_BYTES,
  MAX_OPS_PER_MESSAGE,
  MAX_OPS_PER_SECOND,
  OPS_BURST,
  type Op,
  type OpEnvelope,
  type OpsBroadcast,
  type Reject,
  type RejectCode,
  type Stroke,
  type Welcome,
} from "../generated/contract.ts";
import { apply, type Doc, Refusal } from "./apply.ts";
import { changes, isEmpty, subjectOf } from "./changes.ts";
import { fromDocument } from "./document.ts";
import { mergeOps } from "./merge.ts";
import { type UndoPlan, UndoStack } from "./undo.ts";

export interface RefusedOp {
  readonly code: RejectCode;
  readonly message: string;
  /** The refused op, where it is still known. */
  readonly op?: Op;
}

/** `skipped` holds sentences for a person: what was left alone because somebody else changed it since. */
export interface UndoResult {
  readonly done: boolean;
  readonly skipped: readonly string[];
}

interface Entry {
  readonly id: string;
  op: Op;
  readonly gesture: string | null;
  /** Under way on the present connection. */
  sent: boolean;
  /** Sent at least once: the server may know it by its id, so its content is fixed for good. */
  fixed: boolean;
  /** Committed by the server, but waiting for ops of others that come before it. */
  acked: boolean;
}

interface Confirmed {
  readonly id: string;
  readonly author: string;
  readonly op: Op;
}

/** A little below the server's own bucket, so that a burst after a reconnect is never refused. */
const RATE = 0.8 * MAX_OPS_PER_SECOND;
const BURST = 0.5 * OPS_BURST;
/** Room for the message around the ops, and for characters of several bytes. */
const MESSAGE_BYTES = MAX_MESSAGE_BYTES - 4096;

export class SyncDoc {
  readonly #client: string;
  readonly #now: () => number;
  readonly #doc = signal<Doc | null>(null);
  readonly #pending = signal(0);
  readonly #canUndo = signal(false);
  readonly #canRedo = signal(false);
  readonly #undo = new UndoStack();
  readonly #refusedListeners = new Set<(r: RefusedOp) => void>();
  readonly #divergedListeners = new Set<() => void>();
  /** Strokes whose beginning was refused: refusals of what I did to them next are no news. */
  readonly #stillborn = new Set<string>();
  #confirmed: Doc | null = null;
  /** Confirmed and unconfirmed together. */
  #present: Doc | null = null;
  /** The earlier document that is shown instead; null while the present one is. */
  #past: Doc | null = null;
  #entries: Entry[] = [];
  /** Ops whose clock is known, waiting for an earlier one. */
  #ready = new Map<number, Confirmed>();
  /** Between a welcome and the end of its connection: only then may ops be sent. */
  #welcomed = false;
  #counter: number;
  #tokens = BURST;
  #tokensAt: number;

  /**
   * `clientId` names this page towards the server. `now` gives milliseconds; op counters start from it, so that a
   * page that is loaded again under the same id never repeats the id of an earlier op.
   */
  constructor(clientId: string, now: () => number = Date.now) {
    this.#client = clientId;
    this.#now = now;
    this.#counter = Math.floor(now() / 10) % 1e12;
    this.#tokensAt = now();
  }

  /** The document to show: confirmed and unconfirmed together, or an earlier state. Null before the first welcome. */
  get doc(): ReadonlySignal<Doc | null> {
    return this.#doc;
  }

  /** Ops of mine that the server has not yet written to its journal. Zero means saved. */
  get pending(): ReadonlySignal<number> {
    return this.#pending;
  }

  get canUndo(): ReadonlySignal<boolean> {
    return this.#canUndo;
  }

  get canRedo(): ReadonlySignal<boolean> {
    return this.#canRedo;
  }

  /** Clock of the confirmed document, for the `hello` that resumes; null when a snapshot is needed. */
  get clock(): number | null {
    return this.#confirmed?.clock ?? null;
  }

  /** Shows an earlier state, which cannot be changed; null: the present again, which has gone on meanwhile. */
  lookAt(past: Doc | null): void {
    this.#past = past;
    this.#show();
  }

  /**
   * Applies an op of mine at once and queues it. Ops with the same `gesture` are one undo step.
   * Returns the refusal when it does not apply; then nothing has changed.
   */
  submit(op: Op, gesture?: string): Refusal | null {
    const before = this.#present;
    if (before === null) return new Refusal("unavailable", msg("The terrain is still loading."));
    if (this.#past !== null)
      return new Refusal("view_only", msg("This is the past: go back to now to change the terrain."));
    const refusal = this.#enqueue(op, gesture ?? null, (id) => {
      this.#undo.record(before, op, this.#present!, gesture ?? null, id);
    });
    this.#publishCounts();
    return refusal;
  }

  /** Strokes as I see them, of which changes of mine are not in the server's journal yet. */
  unconfirmed(): Stroke[] {
    const ids = new Set(this.#entries.filter((e) => !e.acked).flatMap((e) => strokesOf(e.op)));
    return [...ids].flatMap((id) => this.#present?.strokes.get(id) ?? []);
  }

  /** Takes back my last step, as far as nobody else has changed the same fields since. */
  undo(): UndoResult {
    return this.#timeTravel((doc) => this.#undo.undo(doc));
  }

  /** Takes back my last undo, by the same rules. */
  redo(): UndoResult {
    return this.#timeTravel((doc) => this.#undo.redo(doc));
  }

  /**
   * The ops to send now, as one message's worth; they count as sent. Call it after every `submit` and at least every
   * 33 ms while `pending` is above zero: it keeps within the server's limits, so what is left goes with a later call.
   */
  outgoing(): OpEnvelope[] {
    if (!this.#welcomed) return [];
    const now = this.#now();
    this.#tokens = Math.min(BURST, this.#tokens + (Math.max(0, now - this.#tokensAt) / 1000) * RATE);
    this.#tokensAt = now;
    const out: OpEnvelope[] = [];
    let bytes = 0;
    for (const entry of this.#entries) {
      if (entry.sent) continue;
      if (out.length === MAX_OPS_PER_MESSAGE || this.#tokens < 1) break;
      bytes += sizeOf(entry.op) + entry.id.length + 20;
      if (bytes > MESSAGE_BYTES && out.length > 0) break;
      entry.sent = true;
      entry.fixed = true;
      this.#tokens -= 1;
      out.push({ id: entry.id, op: entry.op });
    }
    return out;
  }

  /** First message of a connection: a snapshot, or the ops that I missed. What is unconfirmed will be sent again. */
  welcome(message: Welcome): void {
    if (this.#welcomed) this.disconnected();
    this.#welcomed = true;
    this.#ready.clear();
    if (message.document !== null) {
      this.#confirmed = fromDocument(message.document);
    } else if (this.#confirmed === null) {
      this.#diverged();
      return;
    }
    for (const { clock, id, author, op } of message.ops ?? []) this.#order(clock, { id, author, op });
    this.#drain();
    this.#rebuild();
  }

  /** The server has committed these ops of mine. */
  ack(message: Ack): void {
    if (this.#confirmed === null) return;
    const confirmed = this.#confirmed.clock;
    let known = false;
    for (const [i, id] of message.ids.entries()) {
      const clock = message.clocks[i]!;
      const entry = this.#entries.find((e) => e.id === id);
      if (clock <= confirmed) {
        // Sent again after a cut, but the snapshot or the missed ops held it already.
        known ||= entry !== undefined;
        this.#drop(id);
        this.#undo.settle(id);
      } else if (entry !== undefined) this.#order(clock, { id, author: this.#client, op: entry.op });
      else if (!this.#ready.has(clock)) {
        this.#diverged();
        return;
      }
      if (entry !== undefined) entry.acked = true;
    }
    this.#advance(known);
  }

  /** The server has ordered these ops of others (or of mine, seen by another connection of this page). */
  ordered(message: OpsBroadcast): void {
    for (const { clock, id, author, op } of message.ops) this.#order(clock, { id, author, op });
    this.#advance();
  }

  /** The server has refused an op of mine: it is rolled back and the listeners are told why. */
  reject(message: Reject): void {
    const entry = this.#entries.find((e) => e.id === message.id);
    this.#drop(message.id);
    this.#undo.forget(message.id);
    const silent = entry !== undefined && strokesOf(entry.op).some((id) => this.#stillborn.has(id));
    if (entry?.op.type === "stroke.begin") this.#abandon(entry.op.stroke.id);
    this.#rebuild();
    if (!silent)
      for (const listener of this.#refusedListeners)
        listener({ code: message.code, message: message.message, ...(entry && { op: entry.op }) });
  }

  /** The socket is gone: whatever was sent and not acknowledged will be sent again. Ids make that harmless. */
  disconnected(): void {
    this.#welcomed = false;
    for (const entry of this.#entries) {
      entry.sent = false;
      entry.acked = false;
    }
    this.#publishCounts();
  }

  /** Calls back for each op that the server refused. Returns a function that ends it. */
  onRefused(listener: (r: RefusedOp) => void): () => void {
    this.#refusedListeners.add(listener);
    return () => this.#refusedListeners.delete(listener);
  }

  /** Calls back when a confirmed op does not apply here: the page must reconnect to get a snapshot. */
  onDiverged(listener: () => void): () => void {
    this.#divergedListeners.add(listener);
    return () => this.#divergedListeners.delete(listener);
  }

  #enqueue(op: Op, gesture: string | null, record: (id: string) => void): Refusal | null {
    const wrong = checkOp(op);
    if (wrong !== null) return new Refusal("malformed", msg(str`This cannot be done: ${wrong}.`));
    if (sizeOf(op) > MESSAGE_BYTES) return new Refusal("too_large", msg("This change is too large for one message."));
    try {
      this.#present = apply(this.#present!, op);
    } catch (error) {
      if (error instanceof Refusal) return error;
      throw error;
    }
    this.#show();
    const last = this.#entries.at(-1);
    const merged =
      last !== undefined && !last.fixed && gesture !== null && last.gesture === gesture ? mergeOps(last.op, op) : null;
    if (last !== undefined && merged !== null && sizeOf(merged) <= MESSAGE_BYTES) {
      last.op = merged;
      record(last.id);
      return null;
    }
    const id = `${this.#client}:${this.#counter++}`;
    this.#entries.push({ id, op, gesture, sent: false, fixed: false, acked: false });
    record(id);
    return null;
  }

  #timeTravel(move: (doc: Doc) => UndoPlan): UndoResult {
    const doc = this.#present;
    if (doc === null || this.#past !== null) return { done: false, skipped: [] };
    const { ops, skipped } = move(doc);
    const refused = ops.map((op) => this.#enqueue(op, null, () => {})).filter((r) => r !== null);
    this.#publishCounts();
    return { done: ops.length > refused.length, skipped: [...skipped, ...refused.map((r) => r.message)] };
  }

  #order(clock: number, confirmed: Confirmed): void {
    if (this.#confirmed !== null && clock > this.#confirmed.clock) this.#ready.set(clock, confirmed);
  }

  /** Takes over what is contiguous; the optimistic document is rebuilt only when something overtook my ops. */
  #advance(rebuild = false): void {
    if (this.#drain() || rebuild) this.#rebuild();
    else this.#publishCounts();
  }

  /** Applies ready ops in the order of their clocks. True when the optimistic document must be rebuilt. */
  #drain(): boolean {
    let overtaken = false;
    while (this.#confirmed !== null) {
      const next = this.#ready.get(this.#confirmed.clock + 1);
      if (next === undefined) break;
      this.#ready.delete(this.#confirmed.clock + 1);
      const own = next.id.startsWith(`${this.#client}:`);
      if (own) this.#undo.settle(next.id);
      if (this.#entries[0]?.id === next.id) this.#entries.shift();
      else {
        overtaken = true;
        this.#drop(next.id);
      }
      const before = this.#confirmed;
      try {
        this.#confirmed = apply(before, next.op);
        // An op that the server made in my name, at the end of an import, is mine to undo.
        const agent = next.id.split(":")[0]!;
        if (!own && next.author === this.#client && !isEmpty(changes(next.op, before, this.#confirmed)))
          this.#undo.record(before, next.op, this.#confirmed, agent);
      } catch (error) {
        if (!(error instanceof Refusal)) throw error;
        this.#diverged();
        return false;
      }
    }
    return overtaken;
  }

  #diverged(): void {
    this.#confirmed = null;
    this.#ready.clear();
    for (const listener of this.#divergedListeners) listener();
  }

  #drop(id: string): void {
    this.#entries = this.#entries.filter((e) => e.id !== id);
  }

  /** Forgets what was not sent yet about a stroke that never came to be. */
  #abandon(strokeId: string): void {
    this.#stillborn.add(strokeId);
    const lost = this.#entries.filter((e) => !e.fixed && strokesOf(e.op).includes(strokeId));
    for (const { id } of lost) {
      this.#drop(id);
      this.#undo.forget(id);
    }
  }

  /** My unconfirmed ops on top of the confirmed document; one that does not apply waits for the server's word. */
  #rebuild(): void {
    let doc = this.#confirmed;
    for (const { op } of doc === null ? [] : this.#entries) {
      try {
        doc = apply(doc!, op);
      } catch (error) {
        if (!(error instanceof Refusal)) throw error;
      }
    }
    if (doc !== null) this.#present = doc;
    this.#show();
    this.#publishCounts();
  }

  #show(): void {
    this.#doc.value = this.#past ?? this.#present;
  }

  #publishCounts(): void {
    this.#pending.value = this.#entries.filter((e) => !e.acked).length;
    this.#canUndo.value = this.#undo.canUndo;
    this.#canRedo.value = this.#undo.canRedo;
  }
}

const encoder = new TextEncoder();

/** Bytes of the op as JSON. */
function sizeOf(op: Op): number {
  return encoder.encode(JSON.stringify(op)).length;
}

function strokesOf(op: Op): string[] {
  const parts = op.type === "group" ? op.ops : [op];
  return parts.flatMap((p) => {
    if (p.type === "terrain.set") return [];
    const [kind, id] = subjectOf(p);
    return kind === "stroke" ? [id] : [];
  });
}
