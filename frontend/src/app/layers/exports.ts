/**
 * One export of one terrain: its choices, its estimate, its progress on the server, and its file. The class knows no
 * DOM: what carries requests to the server and what saves the file are given to it.
 */

import { msg, str } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import { fixed, plain } from "../../core/language.ts";
import {
  EXPORT_LEVELS,
  EXPORT_MAP_SAMPLES,
  EXPORT_MESH_SAMPLES,
  type ExportEstimate,
  type ExportFormat,
  type ExportRequest,
  type ExportStatus,
  type ModelOptions,
  type PaperOptions,
} from "../../generated/contract.ts";
import { ApiError } from "../server/api.ts";

/** How requests reach the server. Refusals come as ApiError. */
export interface ExportTransport {
  estimate(request: ExportRequest): Promise<ExportEstimate>;
  begin(request: ExportRequest): Promise<ExportStatus>;
  status(id: string): Promise<ExportStatus>;
  file(id: string): Promise<Blob>;
  cancel(id: string): Promise<void>;
}

export type ExportPhase = "choose" | "work" | "load" | "done" | "failed";

export interface ExportChoice {
  readonly format: ExportFormat;
  readonly samples: number;
  readonly detail: boolean;
  /** Whether masks sum to one. */
  readonly weights: boolean;
  /** Options of contour maps. */
  readonly paper: Required<PaperOptions>;
  /** Options of solids for printers. */
  readonly model: Required<ModelOptions>;
}

/** A file that came, and where it lies for as long as the page is open. */
export interface ExportedFile {
  readonly name: string;
  readonly blob: Blob;
}

const POLL_MS = 400;
/** An export is given up after so many polls in a row without an answer. */
const MOST_SILENCE = 40;
const SETTLE_MS = 150;
/** Samples a side with which a solid is offered. */
const SOLID_SAMPLES = 513;

/** Contour maps on paper. */
export const isMap = (format: ExportFormat): boolean => format === "map_pdf" || format === "map_svg";

/** Samples a side that a format may have, coarse to fine. */
export function sizesOf(format: ExportFormat): readonly number[] {
  const most =
    format === "glb" || format === "stl"
      ? EXPORT_MESH_SAMPLES
      : isMap(format)
        ? EXPORT_MAP_SAMPLES
        : Number.POSITIVE_INFINITY;
  return Object.keys(EXPORT_LEVELS)
    .map(Number)
    .filter((n) => n <= most)
    .sort((a, b) => a - b);
}

/** Samples a side that only landscapes of Unreal Engine have: others have 2^n + 1. */
export const ofUnreal = (samples: number): boolean => !Number.isInteger(Math.log2(samples - 1));

export class Exporter {
  readonly #choice = signal<ExportChoice>({
    format: "png16",
    samples: 1025,
    detail: true,
    weights: false,
    paper: { size: "a4", scale: 0, interval_m: 0 },
    model: { width_mm: 150, base_mm: 3, exaggeration: 1 },
  });
  readonly #estimate = signal<ExportEstimate | null>(null);
  readonly #phase = signal<ExportPhase>("choose");
  readonly #status = signal<ExportStatus | null>(null);
  readonly #problem = signal("");
  readonly #file = signal<ExportedFile | null>(null);
  readonly #transport: ExportTransport;
  readonly #save: (file: ExportedFile) => void;
  /** The clock that is shown where that is not now. */
  readonly #at: () => number | null;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #asking: ReturnType<typeof setTimeout> | undefined;
  /** Counts exports and estimates: what comes for an earlier one is late. */
  #run = 0;
  #asked = 0;
  #silent = 0;

  constructor(transport: ExportTransport, save: (file: ExportedFile) => void, at: () => number | null = () => null) {
    this.#transport = transport;
    this.#save = save;
    this.#at = at;
  }

  get choice(): ReadonlySignal<ExportChoice> {
    return this.#choice;
  }
  /** The estimate of the choice, null until the server has given it. */
  get estimate(): ReadonlySignal<ExportEstimate | null> {
    return this.#estimate;
  }
  get phase(): ReadonlySignal<ExportPhase> {
    return this.#phase;
  }
  get status(): ReadonlySignal<ExportStatus | null> {
    return this.#status;
  }
  /** Why there is no file, or no estimate, as a sentence. */
  get problem(): ReadonlySignal<string> {
    return this.#problem;
  }
  get file(): ReadonlySignal<ExportedFile | null> {
    return this.#file;
  }

  /** Changes what is asked for; samples that the format does not have become the most that it has. */
  choose(fields: Partial<ExportChoice>): void {
    const before = this.#choice.peek();
    const next = { ...before, ...fields };
    // Printers lay down tenths of a millimetre: more samples make large files for nothing. They may still be chosen.
    if (next.format === "stl" && before.format !== "stl" && fields.samples === undefined)
      next.samples = Math.min(next.samples, SOLID_SAMPLES);
    const sizes = sizesOf(next.format);
    this.#choice.value = sizes.includes(next.samples) ? next : { ...next, samples: sizes.at(-1)! };
    this.ask();
  }

  /** Asks what the choice would cost, once hands rest. */
  ask(): void {
    clearTimeout(this.#asking);
    const asked = ++this.#asked;
    this.#estimate.value = null;
    this.#asking = setTimeout(async () => {
      try {
        const found = await this.#transport.estimate(this.#request());
        if (asked === this.#asked) this.#estimate.value = found;
      } catch {
        // The estimate is a help only: beginning the export says what is wrong.
      }
    }, SETTLE_MS);
  }

  async begin(): Promise<void> {
    if (this.#phase.peek() === "work" || this.#phase.peek() === "load") return;
    const run = ++this.#run;
    this.#silent = 0;
    this.#problem.value = "";
    this.#file.value = null;
    this.#status.value = null;
    this.#phase.value = "work";
    try {
      const status = await this.#transport.begin(this.#request());
      if (run === this.#run) this.#take(run, status);
      else await this.#transport.cancel(status.id);
    } catch (error) {
      if (run === this.#run) this.#fail(error);
    }
  }

  /** Stops the export; nothing of it stays. */
  cancel(): void {
    const id = this.#status.peek()?.id;
    this.#leave();
    this.#phase.value = "choose";
    if (id !== undefined) this.#transport.cancel(id).catch(() => {});
  }

  /** Back to the choice, after an end. */
  again(): void {
    const phase = this.#phase.peek();
    if (phase !== "done" && phase !== "failed") return;
    this.#leave();
    this.#phase.value = "choose";
    this.ask();
  }

  /** Hands the file out once more. */
  save(): void {
    const file = this.#file.peek();
    if (file) this.#save(file);
  }

  dispose(): void {
    this.#leave();
    clearTimeout(this.#asking);
  }

  #request(): ExportRequest {
    const { weights, paper, model, ...choice } = this.#choice.peek();
    const own = {
      ...(weights && choice.format === "masks" ? { weights } : {}),
      ...(isMap(choice.format) ? { paper } : {}),
      ...(choice.format === "stl" ? { model } : {}),
    };
    return { ...choice, ...own, at: this.#at() };
  }

  #leave(): void {
    this.#run += 1;
    clearTimeout(this.#timer);
    this.#status.value = null;
    this.#file.value = null;
    this.#problem.value = "";
  }

  #fail(error: unknown): void {
    clearTimeout(this.#timer);
    this.#problem.value = error instanceof ApiError ? error.message : msg("Something went wrong. Export again.");
    this.#phase.value = "failed";
  }

  #take(run: number, status: ExportStatus): void {
    this.#silent = 0;
    this.#status.value = status;
    if (status.stage === "done") void this.#load(run, status);
    else if (status.stage === "failed" || status.stage === "cancelled")
      this.#fail(new ApiError(status.stage, status.text));
    else this.#timer = setTimeout(() => void this.#poll(run, status.id), POLL_MS);
  }

  async #poll(run: number, id: string): Promise<void> {
    try {
      const status = await this.#transport.status(id);
      if (run === this.#run) this.#take(run, status);
    } catch (error) {
      if (run !== this.#run) return;
      this.#silent += 1;
      // A server that is started anew knows nothing of it: that is final. One that does not answer may come back.
      const final = error instanceof ApiError && error.code !== "unreachable" && !error.code.startsWith("5");
      if (final || this.#silent > MOST_SILENCE) this.#fail(error);
      else this.#timer = setTimeout(() => void this.#poll(run, id), POLL_MS * Math.min(8, 1 + this.#silent));
    }
  }

  async #load(run: number, status: ExportStatus): Promise<void> {
    this.#phase.value = "load";
    try {
      const blob = await this.#transport.file(status.id);
      if (run !== this.#run) return;
      this.#file.value = { name: status.file, blob };
      this.#phase.value = "done";
      this.save();
    } catch (error) {
      if (run === this.#run) this.#fail(error);
    }
  }
}

/** The work as a person reads it. */
export function exportWords(phase: ExportPhase, status: ExportStatus | null): string {
  if (phase === "load") return msg("Downloading the file…");
  const per = ` ${Math.round(100 * (status?.share ?? 0))} %`;
  switch (status?.stage) {
    case "solving":
      return msg(str`Computing the ground…${per}`);
    case "detail":
      return msg(str`Adding the fine detail…${per}`);
    case "writing":
      return msg(str`Writing the file…${per}`);
    default:
      return status?.text || msg("Waiting for the server…");
  }
}

/** Bytes with two digits or so: "1.7 MB". */
export function bytesWords(bytes: number): string {
  if (bytes < 1e6) return `${Math.max(1, Math.round(bytes / 1e3))} kB`;
  const mega = bytes / 1e6;
  return `${fixed(mega, mega < 10 ? 1 : 0)} MB`;
}

/** A wait in seconds, roughly. */
export function waitWords(seconds: number): string {
  if (seconds < 8) return msg("a few seconds");
  if (seconds < 55) return msg(str`${Math.round(seconds / 5) * 5} seconds`);
  const minutes = Math.round(seconds / 60);
  return minutes <= 1 ? msg("a minute") : msg(str`${minutes} minutes`);
}

/** How engines are to be set so that a heightmap of 16 bits has its true size: see docs/exporting.md. */
export function engineWords({ low_m, high_m, spacing_m }: ExportStatus, samples: number): readonly string[] {
  const across = trim(spacing_m * 100, 4);
  const width = trim(spacing_m * (samples - 1), 2);
  return [
    msg(str`0 is ${trim(low_m, 3)} m, 65535 is ${trim(high_m, 3)} m; north is up`),
    msg(str`Unreal: scale ${across}, ${across}, ${trim((100 * (high_m - low_m) * 128) / 65535, 4)}`),
    msg(str`Unity: width and length ${width}, height ${trim(high_m - low_m, 3)}, position y ${trim(low_m, 3)}`),
  ];
}

const trim = (x: number, digits: number): string => plain(Number(x.toFixed(digits)));
