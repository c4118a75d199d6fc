/**
 * One stream of ground tiles, offsets or base, as it is shown now (DESIGN 6, 8).
 *
 * Levels arrive coarse to fine, and while somebody draws the fine ones lag. A tile whose ancestor moved is shown as its
 * last exact samples plus the parent's movement since then, predicted by the codec's own rule, until its level is
 * confirmed: full detail that morphs with the coarse levels. Movements are taken from the parent's heights at the time
 * when the child was exact, never accumulated, so nothing drifts and equal edges stay equal to the bit.
 */

import { predictMetres } from "../../core/predict.ts";
import { isUnderAny, keyLevel, keyX, keyY, parentKey, tileKey } from "../../core/tilekey.ts";
import type { DecodedFrame, DecodedTile } from "../../core/types.ts";
import { FrameKind, QUANTA_PER_CELL, TILE_CELLS, TILE_SAMPLES } from "../../generated/contract.ts";

const AREA = TILE_SAMPLES * TILE_SAMPLES;

/** The heights of every tile that is zero everywhere. Never written to. */
export const FLAT = new Float32Array(AREA);

export type SentBounds = Pick<DecodedTile, "subMin" | "subMax" | "subError">;

/** A tile of the stream: its exact heights and its parent's at the time when it was exact; metres. Immutable. */
export interface Link {
  readonly version: number;
  /** False while `heights` are the exact ones moved along with a newer parent. */
  readonly exact: boolean;
  /** The samples that are shown. */
  readonly heights: Float32Array;
  readonly exactHeights: Float32Array;
  readonly parentThen: Float32Array | null;
  /** The bounds that came with it, quanta; null once it has moved. */
  readonly sent: SentBounds | null;
  /** Another one whenever the tile was sent or moved, be it there and back: its parent moved too then. */
  readonly mark: object;
}

export class TileChain {
  readonly #sizeM: number;
  readonly #levels: number;
  #links = new Map<number, Link>();
  /** Per level: tiles held. */
  readonly #counts: number[];
  /** Per level that is held: whether what was last said of all its tiles is final. */
  readonly #finals = new Map<number, boolean>();
  /** Tiles that show something else, of which the children may not have followed yet. */
  readonly #changed = new Set<number>();
  /** Tiles that changed or went since `follow`. */
  #touched = new Set<number>();
  readonly #delta = new Float32Array(AREA);
  readonly #movement = new Float32Array(AREA);

  /** `levels`: the finest level that can exist. */
  constructor(sizeM: number, levels: number) {
    this.#sizeM = sizeM;
    this.#levels = levels;
    this.#counts = new Array<number>(levels + 1).fill(0);
  }

  /** Number of tiles held. */
  get size(): number {
    return this.#links.size;
  }

  get(key: number): Link | undefined {
    return this.#links.get(key);
  }

  keys(): Iterable<number> {
    return this.#links.keys();
  }

  /** Number of tiles held of a level. */
  countOf(level: number): number {
    return this.#counts[level] ?? 0;
  }

  /** True unless some level up to `solved` was last seen as a preview: its samples may be a little off. */
  settledTo(solved: number): boolean {
    for (const [level, final] of this.#finals) if (level <= solved && !final) return false;
    return true;
  }

  /** Forgets all tiles. */
  clear(): void {
    this.#links = new Map();
    this.#finals.clear();
    this.#counts.fill(0);
    this.#changed.clear();
    this.#touched.clear();
  }

  /**
   * Takes a frame, all of it at once. What moves along is moved by `follow`: frames of finer levels may come first, and
   * where they do there is nothing to move.
   */
  apply(frame: DecodedFrame): void {
    const sent = new Set(frame.tiles.map((t) => tileKey(frame.level, t.x, t.y)));
    this.#moveTo(frame.level, sent);
    const next = new Map(this.#links);
    for (const key of drop(next, frame)) this.#touched.add(key);
    // A listener that holds nothing of a level hears nothing of it: the first tiles that fill the level say all.
    if (!holds(next, frame.level)) this.#finals.set(frame.level, frame.settled || frame.tiles.length === 0);
    for (const t of frame.tiles) {
      const key = tileKey(frame.level, t.x, t.y);
      next.set(key, this.#exactLink(next, key, t));
      this.#changed.add(key);
      this.#touched.add(key);
    }
    if (frame.kind === FrameKind.LEVEL) {
      if (frame.tiles.length > 0 || holds(next, frame.level)) this.#finals.set(frame.level, frame.settled);
      this.#confirm(next, frame.level, sent);
    }
    this.#links = next;
    this.#counts.fill(0);
    for (const key of next.keys()) this.#counts[keyLevel(key)]! += 1;
  }

  /** Moves along what the frames since the last call moved. Returns the tiles that changed or went since then. */
  follow(): Set<number> {
    this.#moveTo(this.#levels);
    const touched = this.#touched;
    this.#touched = new Set();
    return touched;
  }

  #exactLink(next: ReadonlyMap<number, Link>, key: number, t: DecodedTile): Link {
    const quantum = this.#sizeM / (TILE_CELLS << keyLevel(key)) / QUANTA_PER_CELL;
    const flat = t.subMin.every((v) => v === 0) && t.subMax.every((v) => v === 0);
    const heights = flat ? FLAT : new Float32Array(AREA);
    if (!flat) for (let i = 0; i < AREA; i++) heights[i] = t.samples[i]! * quantum;
    const parentThen = parentHeights(next, key);
    const sent = { subMin: t.subMin, subMax: t.subMax, subError: t.subError };
    return { version: t.version, exact: true, heights, exactHeights: heights, parentThen, sent, mark: {} };
  }

  /** After a LEVEL frame every held tile of the level shows its own samples again. */
  #confirm(next: Map<number, Link>, level: number, sent: ReadonlySet<number>): void {
    for (const [key, link] of next) {
      if (keyLevel(key) !== level || sent.has(key)) continue;
      const parent = parentHeights(next, key);
      if (link.exact && link.parentThen === parent) continue;
      this.#touched.add(key);
      if (link.heights === link.exactHeights) {
        next.set(key, { ...link, exact: true, parentThen: parent });
        continue;
      }
      next.set(key, { ...link, exact: true, heights: link.exactHeights, parentThen: parent, sent: null, mark: {} });
      this.#changed.add(key);
    }
  }

  /**
   * Moves the tiles up to a level whose parents changed, level by level, so that each follows what its parent shows.
   * Those in `but`, of the finest level, are about to be replaced.
   */
  #moveTo(finest: number, but: ReadonlySet<number> | null = null): void {
    if (this.#changed.size === 0) return;
    const byLevel: number[][] = Array.from({ length: this.#levels + 1 }, () => []);
    for (const key of this.#links.keys()) byLevel[keyLevel(key)]?.push(key);
    for (let level = 1; level <= finest; level++) {
      for (const key of byLevel[level]!) {
        if (!this.#changed.has(parentKey(key)) || but?.has(key)) continue;
        const link = this.#links.get(key)!;
        const shown = this.#moved(key, link, parentHeights(this.#links, key));
        if (shown === link) continue;
        this.#links.set(key, shown);
        this.#changed.add(key);
        this.#touched.add(key);
      }
    }
    for (const key of this.#changed) {
      if (keyLevel(key) < finest || finest === this.#levels) this.#changed.delete(key);
    }
  }

  /** The tile moved along with its parent; the same object when its part of the parent did not move. */
  #moved(key: number, link: Link, parent: Float32Array | null): Link {
    const { heights, exactHeights, parentThen } = link;
    if (!parent || !parentThen) return link;
    if (!this.#parentMoved(parent, parentThen, keyX(key), keyY(key))) {
      return link.exact ? link : { ...link, exact: true, heights: exactHeights, sent: null, mark: {} };
    }
    predictMetres(this.#delta, keyX(key), keyY(key), this.#movement);
    let same = true;
    let still = true;
    for (let i = 0; i < AREA; i++) {
      const height = Math.fround(exactHeights[i]! + this.#movement[i]!);
      if (height !== heights[i]) same = false;
      if (height !== exactHeights[i]) still = false;
      this.#movement[i] = height;
    }
    if (same) return link;
    return { ...link, exact: still, heights: still ? exactHeights : this.#movement.slice(), sent: null, mark: {} };
  }

  /** Writes the parent's movement, where the child's prediction reads it, to `delta`; false when it is zero there. */
  #parentMoved(now: Float32Array, then: Float32Array, x: number, y: number): boolean {
    if (now === then) return false;
    const [firstCol, lastCol] = x & 1 ? [TILE_CELLS / 2 - 1, TILE_CELLS] : [0, TILE_CELLS / 2 + 1];
    const [firstRow, lastRow] = y & 1 ? [TILE_CELLS / 2 - 1, TILE_CELLS] : [0, TILE_CELLS / 2 + 1];
    let any = false;
    for (let r = firstRow; r <= lastRow; r++) {
      for (let i = r * TILE_SAMPLES + firstCol, end = r * TILE_SAMPLES + lastCol; i <= end; i++) {
        const d = now[i]! - then[i]!;
        this.#delta[i] = d;
        if (d !== 0) any = true;
      }
    }
    return any;
  }
}

/** Takes the frame's drops and all below them away; returns them. */
function drop(next: Map<number, Link>, frame: DecodedFrame): Set<number> {
  const dropped = new Set<number>();
  if (frame.drops.length === 0) return dropped;
  const gone = new Set(frame.drops.map((d) => tileKey(frame.level, d.x, d.y)));
  for (const key of next.keys()) {
    if (!isUnderAny(key, gone, frame.level)) continue;
    next.delete(key);
    dropped.add(key);
  }
  return dropped;
}

function parentHeights(links: ReadonlyMap<number, Link>, key: number): Float32Array | null {
  if (keyLevel(key) === 0) return null;
  return links.get(parentKey(key))?.heights ?? null;
}

function holds(links: ReadonlyMap<number, unknown>, level: number): boolean {
  for (const key of links.keys()) if (keyLevel(key) === level) return true;
  return false;
}
