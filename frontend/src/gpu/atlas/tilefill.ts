/**
 * Fills slots of the atlas on the device: ground and detail from the parents' slots, then gradients; and measures what was
 * made for the selection, which hears of it a few frames later.
 */

import type { PatchTree } from "../../tiles/patches/patchtree.ts";
import { type SynthesisJob, SynthesisPass } from "../synthesis/synthesis.ts";
import type { Atlas, Changes, Resident } from "./atlas.ts";
import { type BoundsJob, BoundsPass, TILE_BOUNDS } from "./bounds.ts";
import { NormalsPass } from "./tilecompute.ts";

interface Measured extends BoundsJob, SynthesisJob {
  readonly resident: Resident;
  /** Version of the slot's contents when they were measured. */
  readonly version: number;
}

interface Answer {
  readonly jobs: readonly Measured[];
  readonly figures: Float32Array;
}

/** Answers that have come back from the device and that nobody has looked at yet. */
class Inbox {
  readonly answers: Answer[] = [];
  underWay = 0;
}

export class TileFill {
  #atlas: Atlas | null = null;

  readonly #normals: NormalsPass;
  readonly #bounds: BoundsPass<Measured>;
  readonly #inbox: Inbox;

  private constructor(
    readonly synthesis: SynthesisPass,
    normals: NormalsPass,
    bounds: BoundsPass<Measured>,
    inbox: Inbox,
  ) {
    this.#normals = normals;
    this.#bounds = bounds;
    this.#inbox = inbox;
  }

  static async create(device: GPUDevice): Promise<TileFill> {
    const inbox = new Inbox();
    const receive = (jobs: readonly Measured[], figures: Float32Array): void => {
      inbox.underWay -= 1;
      inbox.answers.push({ jobs, figures });
    };
    const [synthesis, normals, bounds] = await Promise.all([
      SynthesisPass.create(device),
      NormalsPass.create(device),
      BoundsPass.create<Measured>(device, receive),
    ]);
    return new TileFill(synthesis, normals, bounds, inbox);
  }

  attach(atlas: Atlas): void {
    this.#atlas = atlas;
    this.#inbox.answers.length = 0;
    for (const pass of [this.synthesis, this.#normals, this.#bounds]) pass.attach(atlas);
  }

  /** True while figures are under way or wait to be told: the selection may yet choose otherwise. */
  get pending(): boolean {
    return this.#inbox.underWay > 0 || this.#inbox.answers.length > 0;
  }

  /** Tells the tree what was measured since the last call; true when anything was. */
  tell(tree: PatchTree): boolean {
    const answers = this.#inbox.answers.splice(0);
    for (const { jobs, figures } of answers)
      jobs.forEach(({ resident, version }, i) => {
        // A slot that was filled again since will be measured again.
        if (this.#atlas?.holds(resident) !== true || resident.version !== version) return;
        tree.measure(resident.level, resident.x, resident.y, figures, i * TILE_BOUNDS);
      });
    return answers.length > 0;
  }

  /** Makes anew what changed and makes what entered, parents before children. Once an encoder. */
  run(encoder: GPUCommandEncoder, sizeM: number, changes: Changes, entered: readonly Resident[]): void {
    const atlas = this.#atlas;
    if (atlas === null) return;
    const job = (resident: Resident): Measured => {
      const { slot, level, x, y, held, version } = resident;
      return { slot, level, x, y, parentSlot: atlas.parentOf(resident).slot, held, resident, version };
    };
    // A tile that entered may have taken the slot of one that changed.
    const here = (residents: readonly Resident[]): Measured[] => residents.filter((r) => atlas.holds(r)).map(job);
    const moved = here(changes.moved);
    const made = [...here(changes.remade), ...here(entered)];
    // A tile that enters under ground that moved is made from its parent as it is then.
    this.synthesis.compose(encoder, moved);
    this.synthesis.run(encoder, made);
    const all = [...moved, ...made];
    this.#normals.run(encoder, sizeM, all);
    this.#bounds.run(encoder, sizeM, all);
    if (all.length > 0) this.#inbox.underWay += 1;
  }

  /** To be called when the encoder was submitted. */
  submitted(): void {
    this.#bounds.submitted();
  }

  destroy(): void {
    for (const pass of [this.synthesis, this.#normals, this.#bounds]) pass.destroy();
  }
}
