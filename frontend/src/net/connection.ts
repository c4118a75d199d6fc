/**
 * One terrain's websocket for as long as the page is open (DESIGN 8): hello, messages, tile frames, credit, liveness,
 * and reconnecting with jittered backoff. It knows nothing of documents or tiles; the owner connects it to both.
 */

import { msg, str } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import { language } from "../core/language.ts";
import type { DecodedFrame } from "../core/types.ts";
import { checkClientMessage } from "../core/wire.ts";
import type { ClientMessage, CloseCode, Hello, ServerMessage } from "../generated/contract.ts";
import { MOVED_WITHIN_MS, SUBPROTOCOL, WS_CLOSE } from "../generated/contract.ts";
import { DecodeClient } from "./decodeclient.ts";

export type ConnectionState = "connecting" | "online" | "reconnecting" | "closed";

/** The decoder of tile frames; the worker's client unless a test brings its own. */
export interface FrameSource {
  push(buffer: ArrayBuffer): void;
  onFrame(listener: (frame: DecodedFrame) => void): void;
  onError(listener: (error: Error) => void): void;
  reset(): void;
  close(): void;
}

export interface ConnectionOptions {
  readonly url: string;
  /** Makes the first message of each connection, with the clock to resume from. */
  readonly hello: () => Hello;
  readonly onMessage: (message: ServerMessage) => void;
  /** Applies a frame; credit for it is returned to the server afterwards. */
  readonly onFrame: (frame: DecodedFrame) => void;
  readonly random?: () => number;
  readonly decoder?: FrameSource;
}

const BACKOFF_FIRST_MS = 400;
const BACKOFF_MOST_MS = 15_000;
const PING_EVERY_MS = 5_000;
/** Nothing heard for this long after a ping means that the connection is dead, whatever the socket says. */
const SILENCE_MS = 12_000;
const WELCOME_WITHIN_MS = 10_000;
/** View and presence are skipped while this much is waiting in the socket; ops are not. */
const CROWDED_BYTES = 256 * 1024;

const SENTENCES: Readonly<Record<CloseCode, string>> = {
  bad_protocol: msg("The server speaks another version of Esker. Reload this page."),
  bad_hello: msg("The server did not understand this page. Reload it."),
  bad_secret: msg("This link is not valid. Ask for a new one."),
  revoked: msg("This link has been revoked. Ask for a new one."),
  no_terrain: msg("There is no such terrain on this server."),
  room_full: msg("This terrain is full at the moment. Try again later."),
  too_large: msg("This page sent a message that is too large. Reload it."),
  malformed: msg("The server did not understand this page. Reload it."),
  slow_client: msg("The connection was too slow to keep up."),
  rate_limited: msg("This page sent too much at once."),
  removed: msg("You were sent out of this terrain. Ask whoever leads it to let you in."),
  bad_origin: msg("This page does not come from the server that it talks to."),
  server_error: msg("The server had a problem."),
  shutting_down: msg("The server is restarting."),
  moved: msg("This terrain moves to another server."),
};

const SERVER_TYPES: ReadonlySet<string> = new Set<ServerMessage["type"]>([
  "welcome",
  "ack",
  "reject",
  "ordered",
  "members",
  "presences",
  "progress",
  "error",
  "pong",
  "importing",
  "lesson",
  "notice",
  "class",
  "score",
]);

/** After these codes the same page would only be refused again (contract, WS_CLOSE). */
function isFinal(code: number): boolean {
  return (code >= 4000 && code <= 4008) || code === 4011 || code === 4012;
}

export class Connection {
  readonly #options: ConnectionOptions;
  readonly #random: () => number;
  readonly #decoder: FrameSource;
  readonly #state = signal<ConnectionState>("connecting");
  readonly #reason = signal<string | null>(null);
  readonly #rttMs = signal<number | null>(null);
  #socket: WebSocket | null = null;
  /** The server's words just before it closed. */
  #lastWords: string | null = null;
  #attempt = 0;
  #retry: ReturnType<typeof setTimeout> | undefined;
  #heart: ReturnType<typeof setInterval> | undefined;
  #heardAt = 0;
  /** When the oldest ping without an answer was sent; null when nothing is awaited. */
  #askedAt: number | null = null;

  /** Connects at once. */
  constructor(options: ConnectionOptions) {
    this.#options = options;
    this.#random = options.random ?? Math.random;
    this.#decoder = options.decoder ?? new DecodeClient();
    this.#decoder.onFrame((frame) => this.#frame(frame));
    this.#decoder.onError((error) => this.#broken(error.message));
    globalThis.addEventListener?.("online", this.#retryNow);
    globalThis.document?.addEventListener("visibilitychange", this.#retryNow);
    this.#open();
  }

  /** `online` begins with the server's welcome, not with the open socket. */
  get state(): ReadonlySignal<ConnectionState> {
    return this.#state;
  }

  /** Why there is no connection, as a sentence; null while online. */
  get reason(): ReadonlySignal<string | null> {
    return this.#reason;
  }

  /** Time from a ping to its pong, milliseconds. */
  get rttMs(): ReadonlySignal<number | null> {
    return this.#rttMs;
  }

  /**
   * Sends a message; false when it was not sent: not online, or (view and presence only) the socket is crowded.
   * Throws TypeError for a message that breaks the contract: the server would close the page for good.
   */
  send(message: ClientMessage): boolean {
    if (this.#state.value !== "online" || this.#socket === null) return false;
    const passing = message.type === "view" || message.type === "presence";
    if (passing && this.#socket.bufferedAmount > CROWDED_BYTES) return false;
    return this.#transmit(message);
  }

  /** Drops the present socket and connects anew, as after a document that diverged. */
  reconnect(reason = msg("The connection is being renewed.")): void {
    if (this.#state.value === "closed") return;
    this.#detach();
    this.#reconnecting(reason);
    this.#schedule(0);
  }

  /** Ends the connection for good. */
  close(): void {
    this.#finish(null);
  }

  #open(): void {
    clearTimeout(this.#retry);
    this.#retry = undefined;
    this.#decoder.reset();
    this.#lastWords = null;
    let socket: WebSocket;
    try {
      socket = new WebSocket(this.#options.url, SUBPROTOCOL);
    } catch (error) {
      this.#finish(msg(str`This address cannot be reached: ${error instanceof Error ? error.message : String(error)}`));
      return;
    }
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    this.#askedAt = null;
    this.#heardAt = performance.now();
    socket.onopen = () => {
      this.#heardAt = performance.now();
      this.#transmit(this.#options.hello());
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.#receive(event.data);
    socket.onclose = (event: CloseEvent) => this.#closed(event.code);
    this.#heart = setInterval(() => this.#beat(), PING_EVERY_MS);
  }

  #transmit(message: ClientMessage): boolean {
    const wrong = checkClientMessage(message);
    if (wrong !== null) throw new TypeError(`${message.type}: ${wrong}`);
    if (this.#socket?.readyState !== 1) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  #receive(data: string | ArrayBuffer): void {
    this.#heardAt = performance.now();
    if (typeof data !== "string") {
      this.#decoder.push(data);
      return;
    }
    let message: ServerMessage;
    try {
      message = JSON.parse(data) as ServerMessage;
      if (!SERVER_TYPES.has(message.type)) return; // a later minor version may say more than this page knows
    } catch {
      this.#broken("a message was not JSON");
      return;
    }
    if (message.type === "welcome") {
      this.#attempt = 0;
      this.#reason.value = null;
      this.#state.value = "online";
      this.#ping();
    } else if (message.type === "pong") {
      this.#rttMs.value = performance.now() - message.t;
      this.#askedAt = null;
    } else if (message.type === "error") {
      this.#lastWords = message.message;
    }
    this.#options.onMessage(message);
  }

  #frame(frame: DecodedFrame): void {
    this.#options.onFrame(frame);
    this.send({ type: "credit", bytes: frame.bytes });
  }

  #ping(): void {
    this.#askedAt ??= performance.now();
    this.#transmit({ type: "ping", t: performance.now() });
  }

  /** Every few seconds: asks for a sign of life, and gives the connection up when there was none. */
  #beat(): void {
    const now = performance.now();
    if (this.#state.value === "online") {
      if (this.#askedAt !== null && now - this.#askedAt > SILENCE_MS && now - this.#heardAt > SILENCE_MS) {
        this.reconnect(msg("The connection went silent."));
        return;
      }
      this.#ping();
    } else if (now - this.#heardAt > WELCOME_WITHIN_MS) {
      this.#detach();
      this.#reconnecting(msg("The server does not answer."));
      this.#schedule(this.#backoff());
    }
  }

  #closed(code: number): void {
    const name = (Object.keys(WS_CLOSE) as CloseCode[]).find((key) => WS_CLOSE[key] === code);
    const ours = name === undefined ? null : SENTENCES[name];
    // The server's own words know more, and are English.
    const sentence = language() === "en" ? (this.#lastWords ?? ours) : (ours ?? this.#lastWords);
    this.#detach();
    if (isFinal(code)) {
      this.#finish(sentence ?? msg(str`The server closed the connection (${code}).`));
      return;
    }
    this.#reconnecting(
      sentence ?? (this.#attempt === 0 ? msg("The connection was lost.") : msg("The server cannot be reached.")),
    );
    // Nothing is wrong: the terrain is elsewhere in a moment. Whoever comes back to where it still moves waits longer.
    const moved = code === WS_CLOSE.moved && this.#attempt === 0;
    const backoff = this.#backoff();
    this.#schedule(moved ? MOVED_WITHIN_MS * this.#random() : backoff);
  }

  /** Something came that cannot be understood: start afresh. */
  #broken(what: string): void {
    if (this.#socket === null) return;
    console.warn(`Connection reset: ${what}`);
    this.#detach();
    this.#reconnecting(msg("The connection was disturbed."));
    this.#schedule(this.#backoff());
  }

  #reconnecting(reason: string): void {
    this.#rttMs.value = null;
    this.#reason.value = reason;
    this.#state.value = "reconnecting";
  }

  /** Equal jitter: half of the doubled delay is certain, half is drawn, so a full room does not come back at once. */
  #backoff(): number {
    const most = Math.min(BACKOFF_MOST_MS, BACKOFF_FIRST_MS * 2 ** this.#attempt);
    this.#attempt += 1;
    return most / 2 + (most / 2) * this.#random();
  }

  #schedule(delayMs: number): void {
    clearTimeout(this.#retry);
    this.#retry = setTimeout(() => this.#open(), delayMs);
  }

  /** The network is back, or the page is looked at again: do not sit out the backoff. */
  readonly #retryNow = (): void => {
    if (this.#retry !== undefined && globalThis.document?.visibilityState !== "hidden") this.#open();
  };

  /** Lets go of the socket without hearing of it again. */
  #detach(): void {
    clearInterval(this.#heart);
    const socket = this.#socket;
    this.#socket = null;
    if (socket === null) return;
    socket.onopen = socket.onmessage = socket.onclose = null;
    if (socket.readyState <= 1) socket.close();
  }

  #finish(reason: string | null): void {
    if (this.#state.value === "closed") return;
    clearTimeout(this.#retry);
    this.#retry = undefined;
    this.#detach();
    this.#decoder.close();
    globalThis.removeEventListener?.("online", this.#retryNow);
    globalThis.document?.removeEventListener("visibilitychange", this.#retryNow);
    this.#rttMs.value = null;
    this.#reason.value = reason;
    this.#state.value = "closed";
  }
}
