/** How the tools tell the person something. */

import type { Op } from "../generated/contract.ts";

/** An op that was refused, and by which rule: who shows the sentence may know more, and a way out. */
export interface RefusedHere {
  readonly code: string;
  readonly op: Op;
}

export type Say = (text: string, refused?: RefusedHere) => void;
