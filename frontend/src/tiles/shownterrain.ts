/**
 * The shown ground of a page: follows the tiles, the channels and the settings, and makes anew only what they change.
 * Detail depends on the levels that are solved everywhere; refined tiles that come and go leave it alone.
 */

import type { Ground } from "../core/types.ts";
import type { ChannelStore } from "./detail/channels.ts";
import { type Attributes, DetailField } from "./detail/detail.ts";
import { heightsOfTiles } from "./patches/guide.ts";
import { type RuleSettings, reliefM, zeroM } from "./rules/rule.ts";
import { ShownGround } from "./shown.ts";
import type { TileStore } from "./store.ts";

/** Finest level on which attributes are told: what grows at a place is no matter of centimetres. */
const ATTRIBUTE_LEVEL = 8;
/** An eye this many times higher over the ground than the cells are wide cannot tell finer ones. */
const EYE_CELLS = 40;
/** The finest cells that matter to whoever walks, metres. */
const STEP_M = 0.03;

export class ShownTerrain {
  /** The ground as it is drawn now; `freeze` gives one that stays. */
  readonly ground: Ground;
  readonly #tiles: TileStore;
  readonly #channels: ChannelStore;
  readonly #settings: () => RuleSettings | null;
  #field: { readonly key: string; readonly field: DetailField } | null = null;
  #shown: { readonly stamp: number; readonly field: DetailField; readonly ground: ShownGround } | null = null;

  /** `settings`: null while there is no document; the ground is then the solved one. */
  constructor(tiles: TileStore, channels: ChannelStore, settings: () => RuleSettings | null) {
    this.#tiles = tiles;
    this.#channels = channels;
    this.#settings = settings;
    this.ground = {
      sizeM: tiles.sizeM,
      heightAt: (x, y, cellM) => this.freeze().heightAt(x, y, cellM),
      solvedAt: (x, y) => this.#tiles.ground.heightAt(x, y),
      raycast: (ray) => this.freeze().raycast(ray),
    };
  }

  /** The ground at this moment, which no later frame changes. */
  freeze(): Ground {
    const field = this.field();
    if (field === null) return this.#tiles.freeze();
    if (this.#shown?.stamp !== this.#tiles.stamp || this.#shown.field !== field) {
      const ground = new ShownGround(this.#tiles.freeze(), this.#tiles.solved, field);
      this.#shown = { stamp: this.#tiles.stamp, field, ground };
    }
    return this.#shown.ground;
  }

  /** Height of the ground under an eye at height z, metres, with all the detail that can be told from there. */
  floorUnder(x: number, y: number, z: number): number {
    const ground = this.freeze();
    const near = ground.heightAt(x, y);
    return ground.heightAt(x, y, Math.max(STEP_M, Math.abs(z - near) / EYE_CELLS));
  }

  /** Returns what grows and lies at a place; null before the ground has come. */
  attributesAt(x: number, y: number): Attributes | null {
    const field = this.field();
    return field?.attributesAt(x, y, Math.min(ATTRIBUTE_LEVEL, field.finest)) ?? null;
  }

  /** All detail of the ground as it is now; null before there is a document. It is another one once anything changes. */
  field(): DetailField | null {
    const s = this.#settings();
    if (s === null) return null;
    const key = [
      s.size_m,
      s.seed,
      s.sea_level_m,
      s.look,
      s.detail,
      s.rule,
      s.erosion,
      s.erosion_scale,
      s.hold,
      zeroM(s),
      reliefM(s),
      this.#channels.stamp,
      this.#guideStamp(),
    ].join();
    if (this.#field?.key !== key) {
      const snapshot = this.#tiles.freeze();
      const heightOf = heightsOfTiles((level, x, y) => snapshot.tile(level, x, y));
      this.#field = { key, field: new DetailField(s, this.#channels, heightOf, this.#tiles.solved) };
    }
    return this.#field.field;
  }

  #guide = { stamp: -1, value: "" };

  /** Changes whenever a tile of the levels that are solved everywhere does. */
  #guideStamp(): string {
    if (this.#guide.stamp === this.#tiles.stamp) return this.#guide.value;
    let count = 0;
    let newest = 0;
    for (const tile of this.#tiles.tiles()) {
      if (tile.level > this.#tiles.solved) continue;
      count += 1;
      newest = Math.max(newest, tile.stamp);
    }
    this.#guide = { stamp: this.#tiles.stamp, value: `${count}/${newest}` };
    return this.#guide.value;
  }
}
