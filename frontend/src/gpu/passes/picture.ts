/** The picture of a frame: its passes in order, the ground in two rounds where nearer ground hides much of it. */

import type { Scene } from "../../core/types.ts";
import type { Cut } from "../../tiles/patches/selection.ts";
import type { FrameBindings } from "../frame.ts";
import type { Target } from "../target.ts";
import type { BackgroundPass } from "./background.ts";
import type { DropPass } from "./drops.ts";
import type { GhostPass } from "./ghostplane.ts";
import type { HiddenPatches } from "./hidden.ts";
import type { InstancePass } from "./instances.ts";
import type { LabelPass } from "./labels.ts";
import type { PatchPasses } from "./patches.ts";
import type { PlacingPass } from "./placing.ts";
import type { RibbonPass } from "./ribbons.ts";

interface Passes {
  readonly frame: FrameBindings;
  readonly target: Target;
  readonly background: BackgroundPass;
  readonly patches: PatchPasses;
  readonly ribbons: RibbonPass;
  readonly drops: DropPass;
  readonly ghost: GhostPass;
  readonly placing: PlacingPass;
  readonly labels: LabelPass;
}

/** Fewer patches than this cost less than looking for hidden ones. */
const LEAST_PATCHES = 256;
/** The search for hidden patches pays when it hides this share of them. */
const LEAST_HIDDEN = 0.15;
/** A search that does not pay is tried again after so many frames. */
const PAUSE_FRAMES = 40;

/** Decides whether the search for hidden patches pays in this view, by what it found in the last frames. */
export class HiddenChoice {
  #pause = 0;

  /** For a frame of `patches`. */
  use(patches: number): boolean {
    if (patches < LEAST_PATCHES) return false;
    if (this.#pause === 0) return true;
    this.#pause -= 1;
    return false;
  }

  /** Takes in what a frame found. */
  measured(total: number, drawn: number): void {
    if (drawn > (1 - LEAST_HIDDEN) * total) this.#pause = PAUSE_FRAMES;
  }
}

/** Where and how large a picture is drawn. */
export interface Canvas {
  readonly canvas: GPUTexture;
  readonly width: number;
  readonly height: number;
}

export class Picture {
  /** When hidden patches are looked for. Measurements and tests choose; people get "automatic". */
  search: "automatic" | "always" | "never" = "automatic";
  /** Patches that the last measured frame drew, of how many. */
  found = { total: 0, drawn: 0 };
  readonly #choice = new HiddenChoice();
  #told: (() => Promise<{ total: number; drawn: number }>) | null = null;

  /** Trees, rocks and tufts, where they are drawn. */
  instances: InstancePass | null = null;
  readonly #passes: Passes;
  readonly #hidden: HiddenPatches | null;

  /** `hidden`: null where shaders cannot read depth. */
  constructor(passes: Passes, hidden: HiddenPatches | null) {
    this.#passes = passes;
    this.#hidden = hidden;
  }

  /** Encodes the passes of a scene. `nodes`: for how many the patch tree has room. */
  encode(encoder: GPUCommandEncoder, scene: Scene, cut: Cut, nodes: number, onto: Canvas): void {
    const { target, frame, patches } = this.#passes;
    const { canvas, width, height } = onto;
    if (this.#hidden !== null && this.#pays(scene, cut)) {
      this.#hidden.update(cut, nodes, width, height);
      const first = this.#hidden.first(encoder);
      const near = encoder.beginRenderPass(target.begin(canvas, width, height, "first"));
      near.setBindGroup(0, frame.bindGroup);
      frame.widen(near);
      patches.drawRound(near, first);
      near.end();
      const second = this.#hidden.second(encoder, target.depthView);
      this.#told = this.#hidden.measure(encoder);
      const pass = encoder.beginRenderPass(target.begin(canvas, width, height, "second"));
      pass.setBindGroup(0, frame.bindGroup);
      frame.widen(pass);
      patches.drawRound(pass, second);
      this.#rest(pass, scene);
    } else {
      const pass = encoder.beginRenderPass(target.begin(canvas, width, height));
      pass.setBindGroup(0, frame.bindGroup);
      frame.widen(pass);
      patches.drawGround(pass);
      this.#rest(pass, scene);
    }
    target.finish(encoder, canvas);
  }

  /** Reads what the search found. Called after the submission of the commands that were encoded. */
  submitted(): void {
    const told = this.#told;
    this.#told = null;
    told?.().then(
      (found) => {
        this.found = found;
        this.#choice.measured(found.total, found.drawn);
      },
      // A lost device: the renderer's `lost` tells.
      () => {},
    );
  }

  #pays(scene: Scene, cut: Cut): boolean {
    if (this.search !== "automatic") return this.search === "always";
    return scene.camera.orthoHeight === 0 && this.#choice.use(cut.count);
  }

  /** All that comes after the ground, whose viewport is set. */
  #rest(pass: GPURenderPassEncoder, scene: Scene): void {
    const { frame, background, patches, ribbons, drops, ghost, placing, labels } = this.#passes;
    patches.drawWalls(pass);
    this.instances?.draw(pass);
    const sea = scene.settings.sea_level_m !== null;
    frame.narrow(pass);
    background.draw(pass, sea);
    frame.widen(pass);
    patches.drawWater(pass);
    frame.narrow(pass);
    placing.draw(pass);
    ghost.draw(pass);
    labels.draw(pass);
    drops.draw(pass);
    ribbons.draw(pass);
    pass.end();
  }
}
