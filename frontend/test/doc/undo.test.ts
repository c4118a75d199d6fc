// What the undo stack remembers (SPEC D, I23); the rules themselves are in the shared vectors.
import { describe, expect, it } from "vitest";
import { apply, type Doc } from "../../src/doc/apply.ts";
import { fromDocument } from "../../src/doc/document.ts";
import { inverse, UndoStack } from "../../src/doc/undo.ts";
import type { Op } from "../../src/generated/contract.ts";
import { EMPTY, ridge } from "./model.ts";

const BASE = fromDocument({ ...EMPTY, strokes: [ridge("s")] });
const label = (text: string): Op => ({ type: "stroke.set", stroke: "s", fields: { label: text } });
const hide: Op = { type: "stroke.set", stroke: "s", fields: { hidden: true } };

/** Applies and records ops of one gesture with ids c:0, c:1, … */
function recorded(ops: readonly Op[]): { stack: UndoStack; doc: Doc } {
  const stack = new UndoStack();
  let doc = BASE;
  for (const [i, op] of ops.entries()) {
    const after = apply(doc, op);
    stack.record(doc, op, after, "g", `c:${i}`);
    doc = after;
  }
  return { stack, doc };
}

describe("settling", () => {
  it("a long gesture is remembered by its ends once it is committed", () => {
    const append = (n: number): Op => ({
      type: "stroke.append",
      stroke: "s",
      start: 0,
      points: Array.from({ length: 100 }, (_, k): [number, number] => [k / 100, n]),
      last: [900 + n, 100, 0],
    });
    const { stack, doc } = recorded(Array.from({ length: 300 }, (_, n) => append(n)));
    expect(stack.size).toBe(300);
    for (let n = 0; n < 300; n++) stack.settle(`c:${n}`);
    expect(stack.size).toBe(1);
    let undone = doc;
    for (const op of stack.undo(doc).ops) undone = apply(undone, op);
    expect(undone.strokes).toEqual(BASE.strokes);
  });

  it("only ops that are not committed can be forgotten, as those that are refused (SPEC D22)", () => {
    const { stack, doc } = recorded([label("a"), label("b"), hide]);
    stack.settle("c:0");
    stack.settle("c:1");
    stack.forget("c:0");
    stack.forget("c:2");
    const refused = apply(doc, { type: "stroke.set", stroke: "s", fields: { hidden: false } });
    expect(stack.undo(refused).ops).toEqual([{ type: "stroke.set", stroke: "s", fields: { label: "" } }]);
  });

  it("settling what it does not know changes nothing", () => {
    const { stack } = recorded([label("a")]);
    stack.settle("other:1");
    expect(stack.size).toBe(1);
  });
});

describe("inverse", () => {
  it("takes an op back right after it", () => {
    for (const op of [label("x"), hide, { type: "stroke.delete", stroke: "s" } as const]) {
      let doc = apply(BASE, op);
      for (const back of inverse(op, BASE)) doc = apply(doc, back);
      expect(doc.strokes).toEqual(BASE.strokes);
    }
    expect(inverse(label(""), BASE)).toEqual([]);
  });
});
