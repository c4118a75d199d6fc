/**
 * The terrain as it was (docs/decisions/0021-history.md): a second connection to a room of one's own, whose document and
 * tiles are shown instead of the present ones. The live connection stays: what others do goes on behind it.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { DecodedFrame } from "../../core/types.ts";
import { apply, Refusal } from "../../doc/apply.ts";
import { type Doc, fromDocument } from "../../doc/document.ts";
import type { ClientMessage, Hello, OpsBroadcast, Progress, ServerMessage, Welcome } from "../../generated/contract.ts";
import { MAX_SEEKS_PER_SECOND } from "../../generated/contract.ts";

/** The connection as it is needed here (`net/connection.ts`). */
export interface HistoryViewLine {
  readonly state: ReadonlySignal<string>;
  readonly reason: ReadonlySignal<string | null>;
  send(message: ClientMessage): boolean;
  reconnect(reason?: string): void;
  close(): void;
}

export interface HistoryViewHandlers {
  readonly hello: () => Hello;
  readonly onMessage: (message: ServerMessage) => void;
  readonly onFrame: (frame: DecodedFrame) => void;
}

export interface HistoryViewOptions {
  readonly connect: (handlers: HistoryViewHandlers) => HistoryViewLine;
  /** The hello of the live connection. */
  readonly hello: () => Hello;
  /** Shows another document, or the present again. */
  readonly show: (doc: Doc | null) => void;
  /** New tiles come, of this connection or, when it has ended, of the live one. */
  readonly restart: () => void;
  /** False when tiles have gone astray. */
  readonly frame: (frame: DecodedFrame) => boolean | undefined;
  readonly progress: (progress: Progress) => void;
  /** The server ended it, with a sentence. */
  readonly ended: (why: string) => void;
  /** The present is to be shown again. */
  readonly back: () => void;
}

/** A little slower than the server allows. */
const STEP_MS = 1000 / (0.8 * MAX_SEEKS_PER_SECOND);

export class HistoryView {
  readonly #options: HistoryViewOptions;
  readonly #active = signal(false);
  readonly #shown = signal<number | null>(null);
  readonly #wanted = signal<number | null>(null);
  #line: HistoryViewLine | null = null;
  #doc: Doc | null = null;
  #welcomed = false;
  /** A seek is under way. */
  #asked = false;
  #askedAt = Number.NEGATIVE_INFINITY;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(options: HistoryViewOptions) {
    this.#options = options;
  }

  /** Whether an earlier clock is shown, or about to be. */
  get active(): ReadonlySignal<boolean> {
    return this.#active;
  }

  /** Clock of the document that is shown; null in the present, and until the first one has come. */
  get shown(): ReadonlySignal<number | null> {
    return this.#shown;
  }

  /** The clock that was asked for last. */
  get wanted(): ReadonlySignal<number | null> {
    return this.#wanted;
  }

  /** Shows the terrain as it was at a clock. Of many calls in a row the last one counts. */
  look(clock: number): void {
    this.#wanted.value = clock;
    this.#active.value = true;
    if (this.#line === null) this.#open();
    else this.#seek();
  }

  /** Back to now. */
  leave(): void {
    if (!this.#active.peek()) return;
    this.#end();
    this.#options.back();
  }

  /** Tells the server where one looks; false when there is nobody to tell. */
  send(message: ClientMessage): boolean {
    return this.#line?.send(message) ?? false;
  }

  dispose(): void {
    if (this.#active.peek()) this.#end();
  }

  #open(): void {
    this.#welcomed = false;
    this.#asked = true;
    const line = this.#options.connect({
      hello: () => {
        this.#welcomed = false;
        return { ...this.#options.hello(), clock: null, at: this.#wanted.peek() ?? 0 };
      },
      onMessage: (message) => this.#receive(message),
      onFrame: (frame) => {
        if (this.#options.frame(frame) === false) this.#line?.reconnect();
      },
    });
    this.#line = line;
    // A connection that has ended for good says so by its state alone.
    const stop = line.state.subscribe((state) => {
      if (state !== "closed" || this.#line !== line) return;
      const why = line.reason.peek();
      queueMicrotask(() => {
        stop();
        if (this.#line !== line) return;
        this.leave();
        if (why !== null) this.#options.ended(why);
      });
    });
  }

  #end(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    const line = this.#line;
    this.#line = null;
    this.#doc = null;
    this.#asked = false;
    this.#active.value = false;
    this.#shown.value = null;
    this.#wanted.value = null;
    this.#options.show(null);
    line?.close();
  }

  #receive(message: ServerMessage): void {
    if (this.#line === null) return;
    if (message.type === "welcome") this.#welcome(message);
    else if (message.type === "ordered") this.#ordered(message);
    else if (message.type === "progress") this.#options.progress(message);
  }

  #welcome(message: Welcome): void {
    if (message.document === null) return;
    // The first of a connection; later ones answer a seek and go on with the same tiles.
    if (!this.#welcomed) this.#options.restart();
    this.#welcomed = true;
    this.#arrived(fromDocument(message.document));
  }

  #ordered({ ops }: OpsBroadcast): void {
    let doc = this.#doc;
    try {
      for (const { op, clock } of ops) if (doc !== null && clock === doc.clock + 1) doc = apply(doc, op);
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      this.#line?.reconnect();
      return;
    }
    if (doc !== null) this.#arrived(doc);
  }

  #arrived(doc: Doc): void {
    this.#doc = doc;
    this.#asked = false;
    this.#options.show(doc);
    this.#shown.value = doc.clock;
    this.#seek();
  }

  /** Asks for what is wanted, one step at a time. */
  #seek(): void {
    const wanted = this.#wanted.peek();
    if (this.#asked || wanted === null || wanted === this.#shown.peek() || !this.#welcomed) return;
    const wait = this.#askedAt + STEP_MS - performance.now();
    if (wait > 0) {
      this.#timer ??= setTimeout(() => {
        this.#timer = undefined;
        this.#seek();
      }, wait);
      return;
    }
    this.#asked = this.#line?.send({ type: "seek", clock: wanted }) ?? false;
    this.#askedAt = performance.now();
  }
}
