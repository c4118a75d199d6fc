/**
 * All that a page does with elevation grids: files under way, the grid that is being placed, which layer is selected, and
 * what of it is drawn on the ground.
 */

import { msg, str } from "@lit/localize";
import { computed, effect, type ReadonlySignal, type Signal, signal } from "@preact/signals-core";
import type { Camera } from "../../core/camera/camera.ts";
import { cornersOf, type Point, rounded } from "../../core/lattice.ts";
import type { FootprintVisual, Ground, PlacingVisual, Vec3 } from "../../core/types.ts";
import type { SyncDoc } from "../../doc/sync.ts";
import type { ImportAnswers, Importing, ImportReport, Layer, Progress } from "../../generated/contract.ts";
import type { Placing } from "../../input/tools/placement.ts";
import type { KeptImport } from "../device/kept-imports.ts";
import { footprintVisuals, stemsOf } from "./footprints.ts";
import { heightRange, laidByHand, leftToAsk, reliefRange, SIZE_QUESTION } from "./import-questions.ts";
import { type ImportJob, Imports, type ImportTransport, isOver } from "./imports.ts";
import { layerName } from "./layers.ts";
import { OtherImports } from "./others.ts";
import { LayerPlacing, PendingPlacing, startingPlace } from "./placing.ts";

export interface GroundworkOptions {
  readonly sizeM: number;
  readonly doc: SyncDoc;
  readonly camera: Camera;
  readonly placing: Signal<Placing | null>;
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
  /** Where the server's solver stands. */
  readonly progress: ReadonlySignal<Progress | null>;
  /** My name, as it travels with my imports. */
  readonly author: () => string;
}

/** A grid without a size begins as large as the terrain; one that comes on top of others as large as this share of it. */
const LATER_SHARE = 0.4;

export const VIEW_ONLY = msg("This link lets you look, not change. Ask for an edit link to bring in real ground.");

const NONE: readonly FootprintVisual[] = [];

export class Groundwork {
  readonly imports: Imports;
  readonly others = new OtherImports();
  /** Layers by id. */
  readonly selected = signal<string | null>(null);
  readonly hovered = signal<string | null>(null);
  readonly footprints: ReadonlySignal<readonly FootprintVisual[]>;
  readonly visual: ReadonlySignal<PlacingVisual | null>;
  /** Rises when a grid was to be placed whose questions nobody has seen: the page shows them. */
  readonly asking = signal(0);
  readonly #arriving = signal<{ readonly file: string; readonly clock: number } | null>(null);
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
      const placing = options.placing.value;
      if (!doc?.layers.size && placing === null) return NONE;
      const marks = { selected: this.selected.value, hovered: this.hovered.value, placing, calm: options.calm() };
      const ground = options.ground();
      const stems = placing instanceof PendingPlacing ? stemsOf(placing, placing.visual.value, ground) : [];
      return [...footprintVisuals(doc, marks, ground), ...stems];
    });
    this.visual = computed(() => {
      const placing = options.placing.value;
      return placing instanceof PendingPlacing ? placing.visual.value : null;
    });
    for (const { id, file } of options.kept) this.imports.resume(id, file);
    this.#stops = [
      effect(() => this.#layWhatHasNoPlace(this.imports.jobs.value)),
      effect(() => this.#seeArrive(options.progress.value)),
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
    const answers = Object.fromEntries(questions.map((q) => [q.id, given[q.id] ?? q.default]));
    // Nobody knows what the file's numbers mean or where it lies: its heights then follow its size.
    const sized = !questions.some((q) => q.id === SIZE_QUESTION);
    if (!sized && given.range === undefined && "range" in answers) answers.range = reliefRange(this.#side());
    return answers;
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
    this.#o.say(
      left.length === 1 ? msg("One question about the file first.") : msg("A few questions about the file first."),
    );
  }

  /** Sends the answers, with the place where the grid is laid by hand. */
  async answer(job: ImportJob): Promise<void> {
    const placing = this.#o.placing.peek();
    const byHand = placing instanceof PendingPlacing && placing.id === placingId(job);
    const answers: ImportAnswers = { answers: this.answersTo(job) };
    if (byHand) {
      const place = rounded(placing.place.peek());
      Object.assign(answers, { ...place, anchor: [...place.anchor], spacing_m: [...place.spacing_m] });
      this.#o.placing.value = null;
    }
    const refusal = await this.imports.answer(job.key, answers);
    if (refusal !== null) {
      this.#o.say(refusal, "warn");
      if (byHand && this.imports.jobs.peek().find((j) => j.key === job.key)?.phase === "question")
        this.#o.placing.value = placing;
    }
  }

  /** Takes a layer in hand, to be moved on the ground; again: lets it go. */
  togglePlacing(layer: Layer): void {
    const { placing, doc, say } = this.#o;
    if (placing.peek()?.id === layer.id) {
      placing.value = null;
      return;
    }
    this.selected.value = layer.id;
    placing.value = new LayerPlacing(
      layer,
      doc,
      (op, gesture) => {
        const refusal = doc.submit(op, gesture);
        return refusal === null ? null : refusal.message;
      },
      () => {
        placing.value = null;
        say(msg(str`“${layerName(layer)}” stays here.`));
      },
    );
  }

  /** Shows a grid that has come to hand whole, as it stands. */
  #frame(pending: PendingPlacing): void {
    const place = pending.place.peek();
    const low = place.scale * pending.low_m + place.lift_m;
    const high = place.scale * pending.high_m + place.lift_m;
    const corners = cornersOf(pending, place);
    this.#o.camera.frame(
      corners.flatMap(([x, y]): Vec3[] => [
        [x, y, low],
        [x, y, high],
      ]),
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
    this.#arriving.value = { file: job.file, clock: this.#o.doc.clock ?? 0 };
    if (notes.length === 0) this.imports.dismiss(job.key);
  }

  /** The layer is laid, but its ground has still to be made and sent: it is there when the solver is past its clock. */
  #seeArrive(progress: Progress | null): void {
    const arriving = this.#arriving.peek();
    if (arriving === null || progress === null || !progress.settled || progress.clock < arriving.clock) return;
    this.#arriving.value = null;
    this.#o.say(msg(str`${arriving.file} is part of the ground now.`));
  }

  /** A sentence about my import that is on its way, until its ground is there; null without one. */
  get onItsWay(): string | null {
    const job = this.imports.jobs.value.find((j) => j.phase === "upload" || j.phase === "work");
    if (job) return msg(str`${job.file} is on its way, ${Math.round(100 * job.share)} %`);
    const arriving = this.#arriving.value;
    return arriving && msg(str`The ground of ${arriving.file} is on its way…`);
  }

  /** A file that is to be laid by hand takes the pointer, until it is placed or its import is over. */
  #layWhatHasNoPlace(jobs: readonly ImportJob[]): void {
    const { placing } = this.#o;
    const held = placing.peek();
    const job = jobs.find((j) => j.phase === "question" && j.status?.report && isByHand(j, this.answersTo(j)));
    if (job?.status?.report) {
      if (held instanceof PendingPlacing && held.id === placingId(job)) return;
      const pending = this.#pending(job, job.status.report);
      placing.value = pending;
      this.#frame(pending);
    } else if (held instanceof PendingPlacing) placing.value = null;
  }

  /** How long a grid without a size is when it begins, metres. */
  #side(): number {
    return this.#o.sizeM * (this.#o.doc.doc.peek()?.layers.size ? LATER_SHARE : 1);
  }

  #pending(job: ImportJob, report: ImportReport): PendingPlacing {
    const { sizeM } = this.#o;
    const first = !this.#o.doc.doc.peek()?.layers.size;
    const ground = first ? 0 : this.#o.ground().heightAt(sizeM / 2, sizeM / 2);
    const range = computed(
      (): Point => heightRange(this.answersTo(job).range) ?? [report.low_m ?? 0, report.high_m ?? 0],
    );
    const current = (): ImportJob => this.imports.jobs.peek().find((j) => j.key === job.key) ?? job;
    return new PendingPlacing(
      placingId(job),
      report,
      range,
      startingPlace(report, sizeM, first ? 1 : LATER_SHARE, ground),
      () => this.#place(current()),
      () => {
        this.imports.cancel(job.key);
        this.#o.say(msg(str`${job.file} was not laid. Drop it again to begin anew.`));
      },
    );
  }

  /** Somebody may delete a layer that I have in hand. */
  #leaveWhatIsGone(layers: ReadonlyMap<string, Layer> | undefined): void {
    const held = this.#o.placing.peek();
    if (held instanceof LayerPlacing && !layers?.has(held.id)) this.#o.placing.value = null;
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

const placingId = (job: ImportJob): string => `import-${job.key}`;

function isByHand(job: ImportJob, answers: Readonly<Record<string, string>>): boolean {
  return (job.status?.report?.questions ?? []).some((q) => laidByHand(q, answers[q.id] ?? ""));
}
