/**
 * All that a page does with elevation grids: files under way, the grid that is being laid, which layer is selected, and
 * what of it is drawn on the ground.
 */

import { computed, effect, type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import type { Camera } from "../core/camera.ts";
import { cornersOf, type Point, rounded } from "../core/lattice.ts";
import type { FootprintVisual, Ground, SheetVisual, Vec3 } from "../core/types.ts";
import type { SyncDoc } from "../doc/sync.ts";
import type { ImportAnswers, Importing, ImportReport, Layer } from "../generated/contract.ts";
import type { Laying } from "../input/placement.ts";
import { footprintVisuals, stemsOf } from "./footprints.ts";
import { heightRange, laidByHand, leftToAsk } from "./import-questions.ts";
import { type ImportJob, Imports, type ImportTransport, isOver } from "./imports.ts";
import type { KeptImport } from "./kept-imports.ts";
import { layerName } from "./layers.ts";
import { LayerLaying, PendingLaying, startingPlace } from "./laying.ts";
import { OtherImports } from "./others.ts";

export interface GroundworkOptions {
  readonly sizeM: number;
  readonly doc: SyncDoc;
  readonly camera: Camera;
  readonly laying: Signal<Laying | null>;
  readonly canEdit: () => boolean;
  /** The ground as drawn, held fast; a new one whenever it changes. Reading it in a computation subscribes to changes. */
  readonly ground: () => Ground;
  readonly transport: ImportTransport;
  /** Somebody draws: outlines step back. */
  readonly calm: () => boolean;
  /** Imports that were under way when the page was loaded. */
  readonly kept: readonly KeptImport[];
  /** Remembers those that are, for a page that is loaded anew. */
  readonly keep: (kept: readonly KeptImport[]) => void;
  readonly say: (text: string, tone?: "info" | "warn") => void;
  /** My name, as it travels with my imports. */
  readonly author: () => string;
}

/** A grid without a size begins as large as the terrain; one that comes on top of others as large as this share of it. */
const LATER_SHARE = 0.4;

export const VIEW_ONLY = "This link lets you look, not change. Ask for an edit link to bring in real ground.";

const NONE: readonly FootprintVisual[] = [];

export class Groundwork {
  readonly imports: Imports;
  readonly others = new OtherImports();
  /** Layers by id. */
  readonly selected = signal<string | null>(null);
  readonly hovered = signal<string | null>(null);
  readonly footprints: ReadonlySignal<readonly FootprintVisual[]>;
  readonly sheet: ReadonlySignal<SheetVisual | null>;
  /** Rises when a grid was to be placed whose questions nobody has seen: the page shows them. */
  readonly asking = signal(0);
  readonly #o: GroundworkOptions;
  readonly #read = new Set<number>();
  readonly #answers = signal<ReadonlyMap<number, Readonly<Record<string, string>>>>(new Map());
  readonly #seen = new Set<string>();
  readonly #stops: (() => void)[];

  constructor(options: GroundworkOptions) {
    this.#o = options;
    this.imports = new Imports(options.transport, (job) => this.#arrived(job));
    this.footprints = computed(() => {
      const doc = options.doc.doc.value;
      const laying = options.laying.value;
      if (!doc?.layers.size && laying === null) return NONE;
      const marks = { selected: this.selected.value, hovered: this.hovered.value, laying, calm: options.calm() };
      const ground = options.ground();
      const stems = laying instanceof PendingLaying ? stemsOf(laying, laying.sheet.value, ground) : [];
      return [...footprintVisuals(doc, marks, ground), ...stems];
    });
    this.sheet = computed(() => {
      const laying = options.laying.value;
      return laying instanceof PendingLaying ? laying.sheet.value : null;
    });
    for (const { id, file } of options.kept) this.imports.resume(id, file);
    this.#stops = [
      effect(() => this.#layWhatHasNoPlace(this.imports.jobs.value)),
      effect(() => options.keep(underWay(this.imports.jobs.value))),
      effect(() => this.#leaveWhatIsGone(options.doc.doc.value?.layers)),
    ];
  }

  dispose(): void {
    for (const stop of this.#stops) stop();
    this.imports.dispose();
    this.others.dispose();
  }

  /** Brings in files; people who may only look are told so. */
  add(files: Iterable<File>): void {
    if (this.#o.canEdit()) this.imports.add(files);
    else this.#o.say(VIEW_ONLY, "warn");
  }

  receive(message: Importing): void {
    const jobs = this.imports.jobs.peek();
    const mine = this.imports.ids().has(message.status.id);
    // The server may speak of my file before it has told me what it calls the import.
    const sending =
      message.author === this.#o.author() && jobs.some((j) => j.phase === "upload" && j.file === message.file);
    if (!mine && !sending) this.others.receive(message);
  }

  /** My answers to the questions about a file so far, defaults filled in. */
  answersTo(job: ImportJob): Readonly<Record<string, string>> {
    const given = this.#answers.value.get(job.key) ?? {};
    const questions = job.status?.report?.questions ?? [];
    return Object.fromEntries(questions.map((q) => [q.id, given[q.id] ?? q.default]));
  }

  setAnswer(job: ImportJob, question: string, answer: string): void {
    const given = { ...this.#answers.peek().get(job.key), [question]: answer };
    this.#answers.value = new Map(this.#answers.peek()).set(job.key, given);
  }

  /** A card has shown its questions. */
  questionsSeen(job: ImportJob): void {
    this.#read.add(job.key);
  }

  /** Places what was laid by hand; where there are questions that were out of sight, those come first. */
  #place(job: ImportJob): void {
    const left = leftToAsk(job.status?.report?.questions ?? [], this.answersTo(job));
    if (left.length === 0 || this.#read.has(job.key)) {
      void this.answer(job);
      return;
    }
    this.asking.value += 1;
    this.#o.say(left.length === 1 ? "One question about the file first." : "A few questions about the file first.");
  }

  /** Sends the answers, with the place where the grid is laid by hand. */
  async answer(job: ImportJob): Promise<void> {
    const laying = this.#o.laying.peek();
    const byHand = laying instanceof PendingLaying && laying.id === layingId(job);
    const answers: ImportAnswers = { answers: this.answersTo(job) };
    if (byHand) {
      const place = rounded(laying.place.peek());
      Object.assign(answers, { ...place, anchor: [...place.anchor], spacing_m: [...place.spacing_m] });
      this.#o.laying.value = null;
    }
    const refusal = await this.imports.answer(job.key, answers);
    if (refusal !== null) {
      this.#o.say(refusal, "warn");
      if (byHand && this.imports.jobs.peek().find((j) => j.key === job.key)?.phase === "question")
        this.#o.laying.value = laying;
    }
  }

  /** Takes a layer in hand, to be moved on the ground; again: lets it go. */
  toggleLaying(layer: Layer): void {
    const { laying, doc, say } = this.#o;
    if (laying.peek()?.id === layer.id) {
      laying.value = null;
      return;
    }
    this.selected.value = layer.id;
    laying.value = new LayerLaying(
      layer,
      doc,
      (op, gesture) => {
        const refusal = doc.submit(op, gesture);
        return refusal === null ? null : refusal.message;
      },
      () => {
        laying.value = null;
        say(`“${layerName(layer)}” stays here.`);
      },
    );
  }

  /** Brings a layer into view. */
  reveal(layer: Layer): void {
    const ground = this.#o.ground();
    const corners = cornersOf(layer.facts, layer);
    const inside = (v: number): number => Math.min(Math.max(v, 0), this.#o.sizeM);
    const points = corners.map(([x, y]): Vec3 => [inside(x), inside(y), ground.heightAt(x, y)]);
    this.#o.camera.frame(points);
  }

  #arrived(job: ImportJob): void {
    const id = job.status?.layer ?? null;
    if (id === null) return;
    const notes = job.status?.report?.notes ?? [];
    this.#o.say(`${job.file} is part of the ground now.`);
    if (notes.length === 0) this.imports.dismiss(job.key);
  }

  /** A file that is to be laid by hand takes the pointer, until it is placed or its import is over. */
  #layWhatHasNoPlace(jobs: readonly ImportJob[]): void {
    const { laying } = this.#o;
    const held = laying.peek();
    const job = jobs.find((j) => j.phase === "question" && j.status?.report && isByHand(j, this.answersTo(j)));
    if (job?.status?.report) {
      if (held instanceof PendingLaying && held.id === layingId(job)) return;
      laying.value = this.#pending(job, job.status.report);
    } else if (held instanceof PendingLaying) laying.value = null;
  }

  #pending(job: ImportJob, report: ImportReport): PendingLaying {
    const { sizeM } = this.#o;
    const first = !this.#o.doc.doc.peek()?.layers.size;
    const ground = first ? 0 : this.#o.ground().heightAt(sizeM / 2, sizeM / 2);
    const range = computed(
      (): Point => heightRange(this.answersTo(job).range) ?? [report.low_m ?? 0, report.high_m ?? 0],
    );
    const current = (): ImportJob => this.imports.jobs.peek().find((j) => j.key === job.key) ?? job;
    return new PendingLaying(
      layingId(job),
      report,
      range,
      startingPlace(report, sizeM, first ? 1 : LATER_SHARE, ground),
      () => this.#place(current()),
      () => {
        this.imports.cancel(job.key);
        this.#o.say(`${job.file} was not laid. Drop it again to begin anew.`);
      },
    );
  }

  /** Somebody may delete a layer that I have in hand. */
  #leaveWhatIsGone(layers: ReadonlyMap<string, Layer> | undefined): void {
    const held = this.#o.laying.peek();
    if (held instanceof LayerLaying && !layers?.has(held.id)) this.#o.laying.value = null;
    // A layer of mine may be told of before it has come.
    const selected = this.selected.peek();
    if (selected !== null && layers !== undefined && this.#seen.has(selected) && !layers.has(selected))
      this.selected.value = null;
    for (const id of layers?.keys() ?? []) this.#seen.add(id);
    this.others.leaveOut(this.imports.ids());
  }
}

function underWay(jobs: readonly ImportJob[]): KeptImport[] {
  return jobs.flatMap((j) => (j.status && !isOver(j.phase) ? [{ id: j.status.id, file: j.file }] : []));
}

const layingId = (job: ImportJob): string => `import-${job.key}`;

function isByHand(job: ImportJob, answers: Readonly<Record<string, string>>): boolean {
  return (job.status?.report?.questions ?? []).some((q) => laidByHand(q, answers[q.id] ?? ""));
}
