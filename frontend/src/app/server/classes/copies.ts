/** In which order the copies of a wall stand, and what they are called. */

import { msg, str } from "@lit/localize";
import type { WallCopy } from "../../../generated/contract.ts";

export type Sorting = "number" | "name" | "last" | "score";

/** What a copy is called: by those whose it is, else by its number. */
export function copyName(copy: Pick<WallCopy, "number" | "names">): string {
  const names = copy.names.filter((name) => name !== "");
  return names.length === 0 ? msg(str`Copy ${copy.number}`) : names.join(", ");
}

/** The copies whose name has what was typed in it, in order. Where two are alike the one that came first comes first. */
export function arrange(copies: readonly WallCopy[], sorting: Sorting, filter = ""): WallCopy[] {
  const wanted = filter.trim().toLocaleLowerCase();
  const found = copies.filter((copy) => copyName(copy).toLocaleLowerCase().includes(wanted));
  const by: Record<Sorting, (a: WallCopy, b: WallCopy) => number> = {
    number: () => 0,
    name: (a, b) => copyName(a).localeCompare(copyName(b), undefined, { numeric: true, sensitivity: "base" }),
    score: (a, b) => (b.score?.points ?? -1) - (a.score?.points ?? -1),
    last: (a, b) => (b.last ?? 0) - (a.last ?? 0),
  };
  return found.sort((a, b) => by[sorting](a, b) || a.number - b.number);
}

/** A code in two halves, as it is read aloud. */
export function codeWords(code: string): string {
  const half = Math.ceil(code.length / 2);
  return `${code.slice(0, half)} ${code.slice(half)}`;
}
