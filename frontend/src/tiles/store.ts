/**
 * The tiles that the page holds, as they are drawn now (DESIGN 6, 8). The only owner of that state.
 *
 * What is drawn is the strokes' offsets plus the base, the ground of the elevation layers; each is a stream of its own
 * (`chain.ts`). Where there is a base, a tile shows once its own base is here, so that neighbours have equal edges.
 * While no tile of a level has one yet, all of that level stand on what the levels above predict: so too do they.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import { subDistance, subRange } from "../core/bounds.ts";
import { predictMetres } from "../core/predict.ts";
import { keyLevel, keyX, keyY, parentKey, tileKey } from "../core/tilekey.ts";
import type { DecodedFrame, Ground, Tile, TileView } from "../core/types.ts";
import { Channel, QUANTA_PER_CELL, SUBPATCHES, TILE_CELLS, TILE_SAMPLES } from "../generated/contract.ts";
import { FLAT, type Link, type SentBounds, TileChain } from "./detail/chain.ts";
import { TileGround } from "./ground.ts";

const AREA = TILE_SAMPLES * TILE_SAMPLES;
const SUBS = SUBPATCHES * SUBPATCHES;
const ROOT = tileKey(0, 0, 0);

/** A tile that is drawn, and what it was made of. */
interface Shown extends Footing {
  readonly tile: Tile;
  readonly offset: Link;
}

/** The ground that a tile stands on. */
interface Footing {
  /** Metres; null where there is no base. */
  readonly base: Float32Array | null;
  /** The tile's own base; null where there is none, or where `base` was predicted from the parent's, `from`. */
  readonly own: Link | null;
  readonly from: Float32Array | null;
}

type Bounds = Pick<Tile, "subMin" | "subMax" | "subError">;
const NO_BASE: Footing = { base: null, own: null, from: null };

export class TileStore implements TileView {
  readonly sizeM: number;
  readonly levels: number;
  readonly solved: number;
  /** The value of `stamp`, to subscribe to. */
  readonly revision: ReadonlySignal<number>;
  /** The ground as it is now; `freeze` gives one that stays. */
  readonly ground: Ground;
  readonly #rev = signal(0);
  readonly #offsets: TileChain;
  readonly #base: TileChain;
  /** Tiles as they were drawn when somebody last looked: where several frames come at once, tiles are made once. */
  #drawn = new Map<number, Shown>();
  /** How much of `#drawn` frames have made stale since then. */
  #stale: "nothing" | "offsets" | "all" = "nothing";
  #snapshot: { readonly stamp: number; readonly ground: TileGround } | null = null;
  readonly #distance = new Float64Array(SUBS);

  /** `levels`: the finest level that can exist; `solved`: the finest that exists everywhere. */
  constructor(sizeM: number, levels: number, solved = levels) {
    this.sizeM = sizeM;
    this.levels = levels;
    this.solved = solved;
    this.#offsets = new TileChain(sizeM, levels);
    this.#base = new TileChain(sizeM, levels);
    this.revision = this.#rev;
    this.ground = {
      sizeM,
      heightAt: (x, y) => this.freeze().heightAt(x, y),
      raycast: (ray) => this.freeze().raycast(ray),
    };
  }

  get stamp(): number {
    return this.#rev.peek();
  }

  /** True unless some level that is solved everywhere was last seen as a preview: its samples may be a little off. */
  get settled(): boolean {
    return this.#offsets.settledTo(this.solved) && this.#base.settledTo(this.solved);
  }

  tile(level: number, x: number, y: number): Tile | undefined {
    return this.#shown.get(tileKey(level, x, y))?.tile;
  }

  *tiles(): Iterable<Tile> {
    for (const shown of this.#shown.values()) yield shown.tile;
  }

  /** Number of tiles held, those included that wait for their base. */
  get size(): number {
    return this.#offsets.size;
  }

  /** Number of tiles of the base held. */
  get baseSize(): number {
    return this.#base.size;
  }

  /** The ground at this moment, which no later frame changes. Cheap: tiles are immutable and shared. */
  freeze(): TileGround {
    if (this.#snapshot?.stamp !== this.stamp) {
      const tiles = new Map<number, Tile>();
      for (const [key, shown] of this.#shown) tiles.set(key, shown.tile);
      this.#snapshot = { stamp: this.stamp, ground: new TileGround(this.sizeM, tiles) };
    }
    return this.#snapshot.ground;
  }

  /** Forgets all tiles, as the server does when a connection begins. */
  clear(): void {
    this.#offsets.clear();
    this.#base.clear();
    this.#drawn = new Map();
    this.#stale = "nothing";
    this.#rev.value++;
  }

  /** Shows a frame of the offsets or the base: all of it at once, with everything that moves along. One step of `revision`. */
  apply(frame: DecodedFrame): void {
    const based = this.#based;
    (frame.channel === Channel.BASE ? this.#base : this.#offsets).apply(frame);
    this.#stale = based || this.#based || this.#stale === "all" ? "all" : "offsets";
    this.#rev.value++;
  }

  /** Returns the tiles that are drawn now. */
  get #shown(): ReadonlyMap<number, Shown> {
    if (this.#stale === "nothing") return this.#drawn;
    const all = this.#stale === "all";
    this.#stale = "nothing";
    const touched = this.#offsets.follow();
    this.#base.follow();
    this.#drawn = all
      ? this.#composed(this.#offsets.keys(), new Map(), this.stamp)
      : this.#composed(touched, new Map(this.#drawn), this.stamp);
    return this.#drawn;
  }

  /** Says whether there is a base: its root is held with anything of it. */
  get #based(): boolean {
    return this.#base.get(ROOT) !== undefined;
  }

  /** Shows these tiles, coarse to fine, beside those that `next` has. */
  #composed(keys: Iterable<number>, next: Map<number, Shown>, stamp: number): Map<number, Shown> {
    for (const key of [...keys].sort((a, b) => a - b)) {
      const link = this.#offsets.get(key);
      const parent = keyLevel(key) > 0 ? next.get(parentKey(key)) : undefined;
      const footing = link && this.#footing(key, parent);
      if (footing) next.set(key, this.#show(key, link, footing, parent?.tile, stamp));
      else next.delete(key);
    }
    return next;
  }

  /** Returns the ground that a tile stands on; null where the tile has to wait for it. */
  #footing(key: number, parent: Shown | undefined): Footing | null {
    if (!this.#based) return NO_BASE;
    const own = this.#base.get(key);
    if (own && (parent || keyLevel(key) === 0)) return { base: own.heights, own, from: null };
    if (!parent?.base || this.#base.countOf(keyLevel(key)) > 0) return null;
    const old = this.#drawn.get(key);
    if (old && old.from === parent.base) return old;
    return { base: predicted(key, parent.base), own: null, from: parent.base };
  }

  /** The tile as it is drawn; the same object where nothing that one sees has changed. */
  #show(key: number, offset: Link, footing: Footing, parent: Tile | undefined, stamp: number): Shown {
    const { base, own, from } = footing;
    const { version } = offset;
    const exact = offset.exact && from === null && own?.exact !== false;
    const old = this.#drawn.get(key);
    if (old && old.offset.mark === offset.mark && old.own?.mark === own?.mark && old.base === base) {
      const kept = old.tile.exact === exact && old.tile.version === version;
      return { tile: kept ? old.tile : { ...old.tile, exact, version, stamp }, offset, base, own, from };
    }
    const heights = sum(offset.heights, base);
    const place = { level: keyLevel(key), x: keyX(key), y: keyY(key) };
    const bounds =
      offset.sent && !base ? this.#sentBounds(offset.sent, place.level) : this.#measured(heights, parent, place);
    return { tile: { ...place, version, exact, stamp, heights, ...bounds }, offset, base, own, from };
  }

  #sentBounds(sent: SentBounds, level: number): Bounds {
    const quantum = this.sizeM / (TILE_CELLS << level) / QUANTA_PER_CELL;
    const scaled = (a: ArrayLike<number>) => Float32Array.from(a, (v) => v * quantum);
    return { subMin: scaled(sent.subMin), subMax: scaled(sent.subMax), subError: scaled(sent.subError) };
  }

  #measured(heights: Float32Array, parent: Tile | undefined, { x, y }: Pick<Tile, "x" | "y">): Bounds {
    const subMin = new Float32Array(SUBS);
    const subMax = new Float32Array(SUBS);
    const subError = new Float32Array(SUBS);
    subRange(heights, subMin, subMax);
    if (parent) {
      subDistance(heights, parent.heights, 1, x, y, this.#distance);
      for (let i = 0; i < SUBS; i++) subError[i] = this.#distance[i]! / 2;
    }
    return { subMin, subMax, subError };
  }
}

/** The base of a tile, metres, as its parent's predicts it. */
function predicted(key: number, parent: Float32Array): Float32Array {
  if (parent === FLAT) return FLAT;
  const out = new Float32Array(AREA);
  predictMetres(parent, keyX(key), keyY(key), out);
  return out;
}

/** Shared where one part is zero everywhere. */
function sum(offset: Float32Array, base: Float32Array | null): Float32Array {
  if (!base || base === FLAT) return offset;
  if (offset === FLAT) return base;
  return offset.map((v, i) => v + base[i]!);
}
