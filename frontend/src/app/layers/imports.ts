/**
 * The elevation files that I bring into one terrain: upload, the server's word on them, questions, cancel. One after the
 * other, as the server takes them. Knows no DOM; what carries it to the server is given.
 */

import { msg, str } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import { ENDED_IMPORT, type ImportAnswers, type ImportStatus, MAX_GRID_BYTES } from "../../generated/contract.ts";
import { ApiError } from "../server/api.ts";

/** How files and answers reach the server. Refusals come as ApiError. */
export interface ImportTransport {
  upload(file: File, onShare: (share: number) => void, signal: AbortSignal): Promise<ImportStatus>;
  status(id: string): Promise<ImportStatus>;
  answer(id: string, answers: ImportAnswers): Promise<ImportStatus>;
  cancel(id: string): Promise<void>;
}

/** `waiting`: for the file before it; `work`: the server reads and builds. The last four are final. */
export type ImportPhase = "waiting" | "upload" | "work" | "question" | "done" | "refused" | "cancelled" | "failed";

export interface ImportJob {
  readonly key: number;
  readonly file: string;
  readonly bytes: number;
  readonly phase: ImportPhase;
  /** While uploading: of the bytes; then of the server's work. 0..1. */
  readonly share: number;
  readonly status: ImportStatus | null;
  /** Why it was refused or failed, as a sentence. */
  readonly problem: string;
}

const POLL_MS = 250;
/** An import is given up after so many polls in a row without an answer. */
const MOST_SILENCE = 40;
/** The server may still be clearing away my file before this one: then it is asked again, so often. */
const BUSY_MS = 1500;
const MOST_BUSY = 8;

interface Running {
  readonly file: File | null;
  readonly abort: AbortController;
  timer: ReturnType<typeof setTimeout> | undefined;
  silent: number;
  busy: number;
}

/** The server's last stages, and the one in which this page gave up. */
const OVER: ReadonlySet<string> = new Set([...ENDED_IMPORT, "failed"]);

export const isOver = (phase: ImportPhase): boolean => OVER.has(phase);

export class Imports {
  readonly #jobs = signal<readonly ImportJob[]>([]);
  readonly #running = new Map<number, Running>();
  readonly #transport: ImportTransport;
  /** Called with the id of the layer when one is there. */
  readonly #onDone: (job: ImportJob) => void;
  #next = 1;

  constructor(transport: ImportTransport, onDone: (job: ImportJob) => void = () => {}) {
    this.#transport = transport;
    this.#onDone = onDone;
  }

  /** In the order in which they were dropped. */
  get jobs(): ReadonlySignal<readonly ImportJob[]> {
    return this.#jobs;
  }

  /** Ids of my imports on the server. */
  ids(): ReadonlySet<string> {
    return new Set(this.#jobs.peek().flatMap((j) => (j.status ? [j.status.id] : [])));
  }

  /** Takes files in; the first free one begins at once. */
  add(files: Iterable<File>): void {
    for (const file of files) {
      const key = this.#begin(file, file.name, file.size, "waiting");
      if (file.size > MAX_GRID_BYTES)
        this.#end(
          key,
          "refused",
          msg(str`This file is larger than ${MAX_GRID_BYTES >> 20} MB. Cut it, or make it coarser.`),
        );
      else if (file.size === 0) this.#end(key, "refused", msg("This file is empty."));
    }
    this.#startNext();
  }

  /** Goes on with an import that the server already knows, after the page was loaded anew. */
  resume(id: string, file: string): void {
    const key = this.#begin(null, file, 0, "work");
    this.#patch(key, { status: { id, stage: "reading", share: 0, text: "", report: null, layer: null } });
    void this.#poll(key);
  }

  /** Sends answers. A sentence when the server does not take them, else null. */
  async answer(key: number, answers: ImportAnswers): Promise<string | null> {
    const id = this.#job(key)?.status?.id;
    if (id === undefined) return msg("This import is over.");
    try {
      const status = await this.#transport.answer(id, answers);
      // A poll that was under way must not bring the question back.
      this.#patch(key, { phase: "work" });
      this.#take(key, status);
      return null;
    } catch (error) {
      return sentence(error);
    }
  }

  /** Stops an import wherever it stands; nothing of it stays. */
  cancel(key: number): void {
    const job = this.#job(key);
    if (job === undefined || isOver(job.phase)) return;
    const id = job.status?.id;
    this.#end(key, "cancelled", "");
    if (id !== undefined) this.#transport.cancel(id).catch(() => {});
  }

  /** Takes an import that is over from the list. */
  dismiss(key: number): void {
    this.#jobs.value = this.#jobs.value.filter((j) => j.key !== key || !isOver(j.phase));
  }

  dispose(): void {
    for (const key of [...this.#running.keys()]) this.#stop(key);
  }

  #begin(file: File | null, name: string, bytes: number, phase: ImportPhase): number {
    const key = this.#next++;
    this.#running.set(key, { file, abort: new AbortController(), timer: undefined, silent: 0, busy: 0 });
    const job: ImportJob = { key, file: name, bytes, phase, share: 0, status: null, problem: "" };
    this.#jobs.value = [...this.#jobs.value, job];
    return key;
  }

  #job(key: number): ImportJob | undefined {
    return this.#jobs.peek().find((j) => j.key === key);
  }

  #patch(key: number, change: Partial<ImportJob>): void {
    this.#jobs.value = this.#jobs.value.map((j) => (j.key === key ? { ...j, ...change } : j));
  }

  #stop(key: number): void {
    const running = this.#running.get(key);
    this.#running.delete(key);
    clearTimeout(running?.timer);
    running?.abort.abort();
  }

  #end(key: number, phase: ImportPhase, problem: string): void {
    this.#stop(key);
    this.#patch(key, { phase, problem });
    this.#startNext();
  }

  /** The server takes one file of a person at a time. */
  #startNext(): void {
    const jobs = this.#jobs.peek();
    if (jobs.some((j) => j.phase === "upload" || j.phase === "work" || j.phase === "question")) return;
    const next = jobs.find((j) => j.phase === "waiting");
    if (next !== undefined) void this.#upload(next.key);
  }

  async #upload(key: number): Promise<void> {
    const running = this.#running.get(key);
    if (!running?.file) return;
    this.#patch(key, { phase: "upload", share: 0 });
    try {
      const status = await this.#transport.upload(
        running.file,
        (share) => this.#patch(key, { share }),
        running.abort.signal,
      );
      if (this.#running.has(key)) {
        this.#patch(key, { phase: "work" });
        this.#take(key, status);
      } else await this.#transport.cancel(status.id);
    } catch (error) {
      if (!this.#running.has(key)) return;
      if (error instanceof ApiError && error.code === "busy" && running.busy++ < MOST_BUSY) {
        this.#patch(key, { phase: "waiting", share: 0 });
        running.timer = setTimeout(() => this.#startNext(), BUSY_MS);
      } else this.#end(key, "failed", sentence(error));
    }
  }

  /** The server's word on where an import stands. */
  #take(key: number, status: ImportStatus): void {
    const running = this.#running.get(key);
    if (running === undefined) return;
    running.silent = 0;
    this.#patch(key, { status, share: status.share, phase: phaseOf(status) });
    const problem = status.report?.refusal || status.text;
    if (status.stage === "done") {
      this.#end(key, "done", "");
      this.#onDone(this.#job(key)!);
    } else if (status.stage === "refused")
      this.#end(key, "refused", problem || msg("The server could not use this file."));
    else if (status.stage === "cancelled") this.#end(key, "cancelled", status.text);
    else {
      clearTimeout(running.timer);
      // A person answers, not the server: then it is asked less often.
      running.timer = setTimeout(() => void this.#poll(key), status.stage === "question" ? 8 * POLL_MS : POLL_MS);
    }
  }

  async #poll(key: number): Promise<void> {
    const running = this.#running.get(key);
    const asked = this.#job(key);
    const id = asked?.status?.id;
    if (running === undefined || id === undefined) return;
    clearTimeout(running.timer);
    try {
      const status = await this.#transport.status(id);
      // An answer went out meanwhile: this word is older.
      if (asked?.phase === this.#job(key)?.phase) this.#take(key, status);
    } catch (error) {
      running.silent += 1;
      const final = error instanceof ApiError && error.code !== "unreachable" && !error.code.startsWith("5");
      if (!this.#running.has(key)) return;
      if (final || running.silent > MOST_SILENCE) this.#end(key, "failed", sentence(error));
      else running.timer = setTimeout(() => void this.#poll(key), POLL_MS * Math.min(8, 1 + running.silent));
    }
  }
}

function phaseOf({ stage }: ImportStatus): ImportPhase {
  if (stage === "question" || stage === "done" || stage === "refused" || stage === "cancelled") return stage;
  return "work";
}

function sentence(error: unknown): string {
  return error instanceof ApiError ? error.message : msg("Something went wrong. Drop the file again.");
}
