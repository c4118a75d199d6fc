/** Strokes that others deleted: who did, and the way back, for whoever had one in hand. */

import { msg, str } from "@lit/localize";
import type { Member, Op, OpsBroadcast } from "../../generated/contract.ts";
import { memberName } from "../device/names.ts";

/** The last deletions are remembered, so many of them. */
const MOST = 500;

export class GoneStrokes {
  readonly #by = new Map<string, string>();

  /** Ops that everybody did; `members`: who is here, by whose names they are told. */
  note(message: OpsBroadcast, members: readonly Member[], me: string): void {
    for (const { author, op } of message.ops)
      for (const stroke of deletedBy(op)) {
        const member = members.find((m) => m.client === author);
        this.#by.delete(stroke);
        this.#by.set(stroke, author === me ? msg("You") : member ? memberName(member) : msg("Somebody who has left"));
      }
    for (const stroke of this.#by.keys()) {
      if (this.#by.size <= MOST) break;
      this.#by.delete(stroke);
    }
  }

  /** "Ana deleted this stroke." */
  words(stroke: string): string {
    return msg(str`${this.#by.get(stroke) ?? msg("Somebody")} deleted this stroke.`);
  }
}

/** Ids of the strokes that an op deletes. */
function deletedBy(op: Op): string[] {
  if (op.type === "group") return op.ops.flatMap(deletedBy);
  return op.type === "stroke.delete" ? [op.stroke] : [];
}

/** The stroke that an op changes, if it is one that can be restored. */
export function strokeOf(op: Op | undefined): string | null {
  if (op === undefined) return null;
  if (op.type === "group") return op.ops.map(strokeOf).find((id) => id !== null) ?? null;
  return "stroke" in op && typeof op.stroke === "string" ? op.stroke : null;
}
