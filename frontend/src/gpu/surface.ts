/** What of the ground's surface this device draws: stones and blades close by, trees, rocks and tufts. */

import type { Scene } from "../core/types.ts";
import type { Atlas } from "./atlas/atlas.ts";
import type { FrameBindings } from "./frame.ts";
import { InstancePass } from "./passes/instances.ts";
import type { Clothes, PatchPasses } from "./passes/patches.ts";
import type { PassContext } from "./passes/pipeline.ts";
import { createStonesTexture } from "./passes/stones.ts";

export class SurfaceParts {
  #made: InstancePass | null = null;
  #coming = false;
  /** Instances are wanted that no picture shows yet. */
  #instancesDue = false;
  #clothesDue = false;
  #stony: boolean;
  #destroyed = false;

  readonly #context: PassContext;
  readonly #frame: FrameBindings;
  readonly #software: boolean;

  /** `software`: the adapter draws on the CPU, and gets what costs much only where somebody asks for it. */
  constructor(context: PassContext, frame: FrameBindings, software: boolean) {
    this.#context = context;
    this.#frame = frame;
    this.#software = software;
    this.#stony = !software;
  }

  /** True while the last picture lacks something that its scene asked for, as shaders are still being made. */
  get due(): boolean {
    return this.#instancesDue || this.#clothesDue;
  }

  /** Dresses the ground for a scene. Returns what it wears: the last clothes while new ones are being made. */
  dress(scene: Scene, patches: PatchPasses): Clothes {
    const rich = scene.surface?.materials ?? !this.#software;
    if (rich && !this.#stony) {
      this.#frame.useStones(createStonesTexture(this.#context.device, false));
      this.#stony = true;
    }
    const wanted: Clothes = { look: scene.settings.look, detail: rich ? "rich" : "plain" };
    const worn = patches.dress(wanted);
    this.#clothesDue = worn.look !== wanted.look || worn.detail !== wanted.detail;
    return worn;
  }

  /** Finds what stands on the patches of a frame, whose bindings are up to date; null where nothing is to be drawn. */
  plant(encoder: GPUCommandEncoder, scene: Scene, atlas: Atlas, patches: PatchPasses): InstancePass | null {
    const wanted = scene.surface?.instances ?? !this.#software;
    this.#instancesDue = wanted && this.#made === null;
    if (!wanted) return null;
    if (this.#made === null && !this.#coming) this.#make();
    this.#made?.find(encoder, this.#frame.bindGroup, atlas, patches.records, scene.tiles.sizeM);
    return this.#made;
  }

  destroy(): void {
    this.#destroyed = true;
    this.#made?.destroy();
    this.#made = null;
  }

  /** Makes the pipelines when somebody first wants them. */
  #make(): void {
    this.#coming = true;
    InstancePass.create(this.#context).then(
      (made) => {
        this.#coming = false;
        if (this.#destroyed) made.destroy();
        else this.#made = made;
      },
      // A lost device: the renderer's `lost` tells.
      () => {
        this.#instancesDue = false;
      },
    );
  }
}
