/** A wall: what the server tells of the copies of a class, and the ground of each, through one socket. */

import { msg } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import {
  type ErrorMessage,
  PROTOCOL_VERSION,
  SUBPROTOCOL,
  WALL_CLOSE_LEVEL,
  WALL_HEADER,
  WALL_LEVEL,
  type Wall,
  type WallCopy,
  WS_CLOSE,
} from "../../../generated/contract.ts";
import { FrameDecoder } from "../../../net/decode.ts";
import { TileStore } from "../../../tiles/store.ts";
import { refusalWords } from "../../words/refusals.ts";

const RETRY_MS = [500, 1000, 2000, 5000] as const;

/** The class without its copies. */
export type WallState = Omit<Wall, "copies">;

/** The ground of one copy. */
class CopyGround {
  readonly store: TileStore;
  readonly #decoder = new FrameDecoder();

  constructor(sizeM: number) {
    this.store = new TileStore(sizeM, WALL_CLOSE_LEVEL, WALL_LEVEL);
  }

  clear(): void {
    this.#decoder.reset();
    this.store.clear();
  }

  apply(buffer: ArrayBuffer): void {
    this.store.apply(this.#decoder.decode(buffer));
  }
}

export interface WallOptions {
  readonly terrain: string;
  readonly secret: string;
  readonly lesson: string;
  readonly url: string;
}

export class WallConnection {
  readonly #options: WallOptions;
  readonly #state = signal<WallState | null>(null);
  readonly #copies = signal<ReadonlyMap<number, WallCopy>>(new Map());
  readonly #problem = signal<string | null>(null);
  readonly #over = signal(false);
  readonly #grounds = new Map<number, CopyGround>();
  /** Copies whose ground has changed since somebody last took this. */
  readonly #changed = signal<ReadonlySet<number>>(new Set());
  #socket: WebSocket | null = null;
  #tries = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #focus: readonly number[] = [];
  #codeEnds = 0;

  constructor(options: WallOptions) {
    this.#options = options;
    this.#open();
  }

  get state(): ReadonlySignal<WallState | null> {
    return this.#state;
  }

  get copies(): ReadonlySignal<ReadonlyMap<number, WallCopy>> {
    return this.#copies;
  }

  /** Why nothing comes; null while all is well. */
  get problem(): ReadonlySignal<string | null> {
    return this.#problem;
  }

  /** Whether it is closed for good. */
  get over(): ReadonlySignal<boolean> {
    return this.#over;
  }

  get changed(): ReadonlySignal<ReadonlySet<number>> {
    return this.#changed;
  }

  /** When the code ends, milliseconds since 1970. */
  get codeEnds(): number {
    return this.#codeEnds;
  }

  /** The ground of a copy, empty until it has come; undefined where there is no such copy. */
  ground(number: number): TileStore | undefined {
    return this.#groundOf(number)?.store;
  }

  /** Takes the copies whose ground has changed. */
  take(): ReadonlySet<number> {
    const taken = this.#changed.peek();
    this.#changed.value = new Set();
    return taken;
  }

  /** These copies come finer. */
  focus(numbers: readonly number[]): void {
    this.#focus = numbers;
    if (this.#socket?.readyState === 1 && this.#state.peek() !== null)
      this.#socket.send(JSON.stringify({ type: "focus", numbers }));
  }

  close(): void {
    clearTimeout(this.#timer);
    this.#over.value = true;
    if (this.#socket) this.#socket.onclose = this.#socket.onmessage = null;
    this.#socket?.close();
  }

  #open(): void {
    const { url, terrain, secret, lesson } = this.#options;
    const socket = new WebSocket(url, SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    let told = false;
    socket.onopen = () =>
      socket.send(JSON.stringify({ type: "wall", protocol: PROTOCOL_VERSION, terrain, secret, lesson }));
    socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      if (typeof data !== "string") {
        this.#frame(data);
        return;
      }
      const message = JSON.parse(data) as Wall | ErrorMessage;
      if (message.type === "error") this.#problem.value = refusalWords(message.code, message.message);
      else if (message.type === "wall") {
        this.#receive(message, !told);
        told = true;
      }
    };
    socket.onclose = ({ code }: CloseEvent) => this.#closed(code);
  }

  #receive(message: Wall, first: boolean): void {
    const { copies, ...state } = message;
    this.#tries = 0;
    this.#problem.value = null;
    this.#codeEnds = Date.now() + 1000 * state.expires_s;
    this.#state.value = state;
    if (copies.length > 0 || first) {
      const next = first ? new Map<number, WallCopy>() : new Map(this.#copies.peek());
      for (const copy of copies) next.set(copy.number, copy);
      this.#copies.value = next;
    }
    if (first && this.#focus.length > 0) this.focus(this.#focus);
  }

  #frame(data: ArrayBuffer): void {
    const view = new DataView(data);
    const number = view.getUint16(WALL_HEADER.number.offset, true);
    const ground = this.#groundOf(number);
    if (ground === undefined) return;
    if (view.getUint8(WALL_HEADER.fresh.offset) === 1) ground.clear();
    try {
      ground.apply(data.slice(WALL_HEADER.size));
    } catch (error) {
      console.warn(`Wall reset: ${error}`);
      this.#socket?.close();
      return;
    }
    this.#changed.value = new Set([...this.#changed.peek(), number]);
  }

  #groundOf(number: number): CopyGround | undefined {
    const known = this.#grounds.get(number);
    const sizeM = this.#copies.peek().get(number)?.settings.size_m;
    if (known !== undefined || sizeM === undefined) return known;
    const ground = new CopyGround(sizeM);
    this.#grounds.set(number, ground);
    return ground;
  }

  #closed(code: number): void {
    const final = [WS_CLOSE.bad_protocol, WS_CLOSE.bad_secret, WS_CLOSE.revoked, WS_CLOSE.no_terrain] as number[];
    if (final.includes(code)) {
      this.#problem.value ??= msg("This wall was closed.");
      this.#over.value = true;
      return;
    }
    this.#problem.value ??= msg("The connection was lost. The wall comes back by itself.");
    const wait = RETRY_MS[Math.min(this.#tries, RETRY_MS.length - 1)]!;
    this.#tries += 1;
    this.#timer = setTimeout(() => this.#open(), wait * (0.75 + 0.5 * Math.random()));
  }
}
