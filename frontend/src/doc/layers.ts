/**
 * Applying operations to the elevation layers of a document (DESIGN 4, 11). Pure; the layers' half of `apply.ts`.
 *
 * Twin of `backend/esker/document/layers.py`; `tests/vectors/ops.json` holds the cases that both languages read.
 */

import { msg, str } from "@lit/localize";
import {
  type AddLayer,
  type DeleteLayer,
  LAYER_HEIGHT_MARGIN,
  type Layer,
  MAX_LAYERS,
  type RestoreLayer,
  type SetLayer,
} from "../generated/contract.ts";
import { changed, type Doc, Refusal } from "./document.ts";

export type LayerOp = AddLayer | SetLayer | DeleteLayer | RestoreLayer;
type Layers = ReadonlyMap<string, Layer>;

/** A layer with the defaults of the contract filled in: ops from other clients may leave them out. */
export function fullLayer(
  layer: Partial<Layer> & Pick<Layer, "id" | "content" | "facts" | "anchor" | "spacing_m" | "accuracy_m">,
): Layer {
  return {
    author: "",
    name: "",
    rotation_deg: 0,
    scale: 1,
    lift_m: 0,
    priority: 0,
    hidden: false,
    outline: 0.35,
    source: "",
    licence: "",
    ...layer,
  };
}

/** Lowest and highest sample of the layers that are shown, metres, as they are laid; null without any. */
export function spanOf(layers: Iterable<Layer>): [number, number] | null {
  const ends = [...layers].flatMap(({ hidden, scale, lift_m, facts }) =>
    hidden ? [] : [scale * facts.low_m + lift_m, scale * facts.high_m + lift_m],
  );
  return ends.length === 0 ? null : [Math.min(...ends), Math.max(...ends)];
}

/** The layers of one application in progress. Copies the maps on first write only. */
export class LayerEditor {
  layers: Layers;
  deleted: Layers;
  readonly #sizeM: number;
  #own: { layers: Map<string, Layer>; deleted: Map<string, Layer> } | null = null;

  constructor(base: Doc) {
    this.layers = base.layers;
    this.deleted = base.deletedLayers;
    this.#sizeM = base.settings.size_m;
  }

  run(op: LayerOp): void {
    switch (op.type) {
      case "layer.add":
        this.#add(fullLayer(op.layer));
        break;
      case "layer.set":
        this.#put({ ...this.#live(op.layer), ...(changed(op.fields, []) as Partial<Layer>) });
        break;
      case "layer.delete":
        this.#delete(op.layer);
        break;
      case "layer.restore":
        this.#restore(op.layer);
        break;
    }
  }

  #writable(): { layers: Map<string, Layer>; deleted: Map<string, Layer> } {
    if (this.#own === null) {
      this.#own = { layers: new Map(this.layers), deleted: new Map(this.deleted) };
      this.layers = this.#own.layers;
      this.deleted = this.#own.deleted;
    }
    return this.#own;
  }

  #live(id: string): Layer {
    const layer = this.layers.get(id);
    if (layer !== undefined) return layer;
    if (this.deleted.has(id))
      throw new Refusal("deleted_layer", msg("This layer was deleted. Restore it before you change it."));
    throw new Refusal("unknown_layer", msg("There is no such elevation layer in this terrain."));
  }

  /** Heights that the quanta of the finest tiles could not hold are refused. */
  #put(layer: Layer): void {
    const bound = LAYER_HEIGHT_MARGIN * this.#sizeM;
    const { low_m, high_m } = layer.facts;
    const farthest = Math.max(...[low_m, high_m].map((z) => Math.abs(layer.scale * z + layer.lift_m)));
    if (farthest > bound) {
      const needed = Math.ceil(farthest / LAYER_HEIGHT_MARGIN);
      const sentence = msg(
        str`Heights of this layer would reach ${farthest.toFixed(0)} metres from zero; a terrain ${this.#sizeM.toFixed(0)} metres wide holds ${bound.toFixed(0)}. Lower it, or make a terrain of at least ${needed.toFixed(0)} metres.`,
      );
      throw new Refusal("out_of_domain", sentence);
    }
    this.#writable().layers.set(layer.id, layer);
  }

  #checkRoom(): void {
    if (this.layers.size >= MAX_LAYERS)
      throw new Refusal("too_many_layers", msg(str`A terrain holds at most ${MAX_LAYERS} elevation layers.`));
  }

  #add(layer: Layer): void {
    if (this.layers.has(layer.id) || this.deleted.has(layer.id))
      throw new Refusal("duplicate_layer", msg("A layer with this id exists already."));
    this.#checkRoom();
    this.#put(layer);
  }

  #delete(id: string): void {
    const old = this.#live(id);
    const { layers, deleted } = this.#writable();
    layers.delete(id);
    deleted.set(id, old);
    for (const oldest of deleted.keys()) {
      if (deleted.size <= MAX_LAYERS) break;
      deleted.delete(oldest);
    }
  }

  #restore(id: string): void {
    if (this.layers.has(id)) throw new Refusal("duplicate_layer", msg("This layer is not deleted."));
    const layer = this.deleted.get(id);
    if (layer === undefined) throw new Refusal("unknown_layer", msg("There is no such deleted layer to restore."));
    this.#checkRoom();
    this.#writable().deleted.delete(id);
    this.#put(layer);
  }
}
