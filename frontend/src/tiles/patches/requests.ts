/** Tiles that a cut asks for. */

import { tileKey } from "../../core/tilekey.ts";
import { SUBPATCHES } from "../../generated/contract.ts";
import type { PatchTree } from "./patchtree.ts";

export interface TileRequest {
  readonly level: number;
  readonly x: number;
  readonly y: number;
}

interface RankedRequest extends TileRequest {
  readonly priority: number;
}

export class TileRequests {
  #list: RankedRequest[] = [];
  readonly #known = new Set<number>();

  readonly #tree: PatchTree;
  readonly #keep: (page: number) => void = () => {};

  /** `keep` is told the pages of tiles that are there already and that a requested one cannot be drawn without. */
  constructor(tree: PatchTree, keep: (page: number) => void = () => {}) {
    this.#tree = tree;
    this.#keep = keep;
  }

  clear(): void {
    // Requests that were given out stay as they were.
    this.#list = [];
    this.#known.clear();
  }

  /** All of them, coarse first, then by priority. */
  sorted(): readonly TileRequest[] {
    return this.#list.sort((a, b) => a.level - b.level || b.priority - a.priority);
  }

  /** Asks for the tile of a node's children. */
  askBelow(level: number, node: number, priority: number): void {
    const { tileX, tileY } = this.#tree;
    const column = tileX[node >> 4]! * SUBPATCHES + (node & 3);
    const row = tileY[node >> 4]! * SUBPATCHES + ((node >> 2) & 3);
    this.ask(level + 1, column >> 1, row >> 1, priority);
  }

  /** Asks for a tile and for the neighbours of its parents, without which it could not be drawn. */
  ask(level: number, x: number, y: number, priority: number): void {
    const tree = this.#tree;
    const side = 2 ** level;
    if (x < 0 || y < 0 || x >= side || y >= side) return;
    const key = tileKey(level, x, y);
    if (this.#known.has(key)) return;
    this.#known.add(key);
    const page = tree.find(level, x, y);
    const missing = page < 0 || tree.usable[page] === 0;
    if (missing && (tree.canMake(level) || (page >= 0 && tree.held[page] === 1)))
      this.#list.push({ level, x, y, priority });
    if (!missing) this.#keep(page);
    if (level === 0) return;
    const dx = (x & 1) * 2 - 1;
    const dy = (y & 1) * 2 - 1;
    for (let i = 0; i < 4; i += 1) this.ask(level - 1, (x >> 1) + (i & 1) * dx, (y >> 1) + (i >> 1) * dy, priority);
  }
}
