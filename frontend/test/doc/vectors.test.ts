// The document's rules in TypeScript agree with the Python twin on the shared vectors (SPEC D).
import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { apply, type Doc, Refusal } from "../../src/doc/apply.ts";
import { fromDocument, toDocument } from "../../src/doc/document.ts";
import { UndoStack } from "../../src/doc/undo.ts";
import type { Document, Op } from "../../src/generated/contract.ts";

function vectors<T>(name: string): T[] {
  const path = new URL(`../../../tests/vectors/${name}.json`, import.meta.url);
  return (JSON.parse(readFileSync(path, "utf8")) as { cases: T[] }).cases;
}

interface OpCase {
  name: string;
  document: Document;
  op: Op;
  result?: Document;
  refusal?: string;
}

interface UndoStep {
  mine?: Op;
  gesture?: string | null;
  theirs?: Op;
  undo?: { ops: Op[]; skipped: string[] };
  redo?: { ops: Op[]; skipped: string[] };
}

interface UndoCase {
  name: string;
  document: Document;
  steps: UndoStep[];
  result: Document;
}

describe("apply", () => {
  it.each(vectors<OpCase>("ops").map((c) => [c.name, c] as const))("%s", (_name, c) => {
    const before = fromDocument(c.document);
    if (c.refusal === undefined) {
      expect(toDocument(apply(before, c.op))).toEqual(c.result);
    } else {
      let refusal: unknown;
      try {
        apply(before, c.op);
      } catch (error) {
        refusal = error;
      }
      expect(refusal).toBeInstanceOf(Refusal);
      expect((refusal as Refusal).code).toBe(c.refusal);
    }
    expect(toDocument(before)).toEqual(c.document);
  });
});

describe("undo", () => {
  it.each(vectors<UndoCase>("undo").map((c) => [c.name, c] as const))("%s", (_name, c) => {
    let present: Doc = fromDocument(c.document);
    const stack = new UndoStack();
    for (const step of c.steps) {
      const expected = step.undo ?? step.redo;
      if (expected !== undefined) {
        const plan = step.undo !== undefined ? stack.undo(present) : stack.redo(present);
        expect(plan).toEqual(expected);
        for (const op of plan.ops) present = apply(present, op);
        continue;
      }
      const op = (step.mine ?? step.theirs)!;
      const after = apply(present, op);
      if (step.mine !== undefined) stack.record(present, op, after, step.gesture ?? null);
      present = after;
    }
    expect(toDocument(present)).toEqual(c.result);
  });
});
