/** Ground that arrives: a view at home stands on it, and no longer once it is here. */

import type { Land } from "../../../core/camera/state.ts";
import type { Doc } from "../../../doc/document.ts";
import type { OpenTerrain } from "../../open-terrain.ts";

export class Arrival {
  readonly #session: OpenTerrain;
  /** The layers whose ground home stands on, and whether it is still on its way. */
  #standsOn: Doc["layers"] | undefined;
  #arriving = true;

  constructor(session: OpenTerrain) {
    this.#session = session;
  }

  /**
   * A view at home goes along with ground that arrives: that of a terrain that is opened, and that of elevation layers. It
   * stays where it is for what is drawn. `landNow`: how the land lies now, null before it has come. It is asked for only
   * while ground arrives: whoever looks at the tiles has all of them moved, between frames that come one after the other.
   */
  follow(landNow: () => Land | null, isDrawing: boolean, stand: (land: Land) => void): void {
    const { progress, doc, baseBuilding } = this.#session;
    const layers = doc.doc.value?.layers;
    if (layers !== this.#standsOn) {
      this.#arriving ||= JSON.stringify([...(layers ?? [])]) !== JSON.stringify([...(this.#standsOn ?? [])]);
      this.#standsOn = layers;
    }
    if (!this.#arriving) return;
    const land = landNow();
    if (land === null) return;
    if (!isDrawing) stand(land);
    const solved = progress.value?.settled === true && progress.value.clock === doc.clock;
    if (isDrawing || (solved && !baseBuilding.value && doc.pending.value === 0)) this.#arriving = false;
  }
}
