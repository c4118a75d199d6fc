/**
 * Synthesised detail on the CPU, where somebody points or stands (DESIGN 10): the rule run on small square blocks, each made
 * from its parent's and remembered. A block carries a border of two samples, as tiles do, so the border reproduces itself
 * and blocks agree with the GPU's tiles and with each other.
 */

import type { ChannelView } from "../../core/types.ts";
import { MAX_SYNTHESIS_LEVEL, SYNTH_FINEST_CELL_M, TILE_CELLS } from "../../generated/contract.ts";
import { Memo } from "../memo.ts";
import { fillArea, type HeightOf } from "../patches/guide.ts";
import { type RuleSettings, siteOf } from "../rules/rule.ts";
import { Biases } from "./biases.ts";
import { type Area, BORDER, detailOf, type Recipe, RULES, root, type Samples, subdivide } from "./subdivide.ts";

/** Cells on a side of a block. */
export const BLOCK_CELLS = 8;
/** Samples on a side of a block with its border. */
export const BLOCK_SIDE: number = BLOCK_CELLS + 1 + 2 * BORDER;
/** Blocks on a side of level 0. */
export const ROOT_BLOCKS: number = TILE_CELLS / BLOCK_CELLS;
/** Blocks that are remembered: some 6 KB each. */
const REMEMBERED = 2048;

/** Attributes of a place, shares 0..1: what grows and lies there. */
export interface Attributes {
  readonly snow: number;
  readonly wet: number;
  readonly grass: number;
  readonly forest: number;
  readonly foam: number;
  /** Smoothness exponent, 0..2. */
  readonly h: number;
}

/** The finest level of detail of a terrain: cells of a centimetre at most. */
export function finestLevel(sizeM: number): number {
  return Math.min(MAX_SYNTHESIS_LEVEL, Math.max(0, Math.ceil(Math.log2(sizeM / TILE_CELLS / SYNTH_FINEST_CELL_M))));
}

/** Block (x, y) of a level as a number. */
export function blockKey(level: number, x: number, y: number): number {
  return (level * 2 ** 21 + y) * 2 ** 21 + x;
}

/** The area of a block with its border. */
export function blockArea(level: number, x: number, y: number): Area {
  const [c, r] = [BLOCK_CELLS * x - BORDER, BLOCK_CELLS * y - BORDER];
  return { level, r0: r, r1: r + BLOCK_SIDE, c0: c, c1: c + BLOCK_SIDE };
}

export class DetailField {
  readonly sizeM: number;
  readonly finest: number;
  /** Ground that was never solved is a B-spline (rule `smooth`). */
  readonly spline: boolean;
  /** Inputs of every block: site, rule, painted biases and the solved guide. */
  readonly recipe: Recipe;
  readonly #blocks: Memo<Samples>;

  /** `heightOf`: heights of the levels up to `solved`, which are held as a whole. */
  constructor(
    settings: RuleSettings,
    channels: ChannelView,
    heightOf: HeightOf,
    solved: number,
    remembered: number = REMEMBERED,
  ) {
    this.#blocks = new Memo(remembered);
    this.sizeM = settings.size_m;
    this.finest = finestLevel(settings.size_m);
    this.spline = settings.rule === "smooth";
    const site = siteOf(settings);
    this.recipe = {
      site,
      rule: RULES[settings.rule],
      biases: new Biases(channels, site),
      guide: (area, out) => area.level <= solved && fillArea(heightOf, area, out),
    };
  }

  /** Guide and relief of a block and its border; null while level 0 is not held. */
  block(level: number, x: number, y: number): Samples | null {
    const key = blockKey(level, x, y);
    const known = this.#blocks.get(key);
    if (known !== undefined) return known;
    const made = this.#make(level, x, y);
    if (made !== null) this.#blocks.put(key, made);
    return made;
  }

  #make(level: number, x: number, y: number): Samples | null {
    const area = blockArea(level, x, y);
    if (level === 0) return root(area, this.recipe, true);
    const parent = this.block(level - 1, x >> 1, y >> 1);
    return parent === null ? null : subdivide(parent, area, this.recipe, true);
  }

  /** Returns the attributes of a place in metres, at the level's nearest sample; null while level 0 is not held. */
  attributesAt(x: number, y: number, level: number): Attributes | null {
    const n = TILE_CELLS * 2 ** level;
    const index = (v: number): number => Math.round(Math.min(Math.max(v / this.sizeM, 0), 1) * n);
    const [j, i] = [index(y), index(x)];
    const found = detailOf({ level, r0: j, r1: j + 1, c0: i, c1: i + 1 }, this.recipe, false);
    if (found === null) return null;
    return {
      snow: found.snow[0]!,
      wet: found.wet[0]!,
      grass: found.grass[0]!,
      forest: found.forest[0]!,
      foam: found.foam[0]!,
      h: found.h[0]!,
    };
  }
}
