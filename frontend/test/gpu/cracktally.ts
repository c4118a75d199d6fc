/** What the pictures of a crack test show: pixels of the clear colour where ground must be, and NaNs. */

/** How a camera stands: only beside the horizon may the sky show, above the ground. */
export type Kind = "above" | "below" | "map" | "grazing";

/** What a test starts with, in this order over and over. */
export const KINDS: readonly Kind[] = ["above", "grazing", "below", "map"];

/** Pixels of every picture. */
export const WIDTH = 256;
export const HEIGHT = 192;

export interface CrackReport {
  readonly views: number;
  /** Views drawn with a look, its light and the NaN scan; the others are drawn in one colour. */
  readonly full: number;
  readonly cracks: number;
  readonly nans: number;
  /** Ground pixels in all pictures: that there was something to crack. */
  readonly covered: number;
  readonly patches: number;
  readonly mixed: number;
  /** Views without any ground: it had risen over the eye, and nothing can crack. */
  readonly blind: number;
  /** Finest level of any patch drawn. */
  readonly deepest: number;
  /** Views with a crack, for reproduction. */
  readonly failures: readonly string[];
}

/** One picture and what was drawn in it. */
export interface Drawn {
  /** Not 0 where something was drawn, `[row * WIDTH + column]`, row 0 on top. */
  readonly ground: Uint8Array;
  readonly nans: number;
  readonly full: boolean;
  readonly patches: number;
  /** Patches of several levels. */
  readonly mixed: boolean;
  readonly deepest: number;
}

/** Pixels of the clear colour where ground must be, and ground pixels. */
function count(ground: Uint8Array, kind: Kind): { cracks: number; covered: number } {
  let cracks = 0;
  let covered = 0;
  for (let x = 0; x < WIDTH; x += 1) {
    let seen = kind !== "grazing";
    for (let at = x; at < WIDTH * HEIGHT; at += WIDTH) {
      if (ground[at] !== 0) {
        seen = true;
        covered += 1;
      } else if (seen) cracks += 1;
    }
  }
  return { cracks, covered };
}

/** What all pictures of a test show together. */
export class Tally {
  private total = { full: 0, cracks: 0, nans: 0, covered: 0, patches: 0, mixed: 0, blind: 0, deepest: 0 };
  private readonly failures: string[] = [];

  add(drawn: Drawn, kind: Kind, view: string): void {
    const { total } = this;
    const found = count(drawn.ground, kind);
    if (found.covered === 0) {
      total.blind += 1;
      return;
    }
    total.full += drawn.full ? 1 : 0;
    total.cracks += found.cracks;
    total.covered += found.covered;
    total.nans += drawn.nans;
    total.patches += drawn.patches;
    total.mixed += drawn.mixed ? 1 : 0;
    total.deepest = Math.max(total.deepest, drawn.deepest);
    if (found.cracks > 0) this.failures.push(`${view}: ${found.cracks}`);
  }

  report(views: number): CrackReport {
    return { views, ...this.total, failures: this.failures };
  }
}
