import { expect, test } from "vitest";
import { apply, type Doc } from "../../src/doc/apply.ts";
import { fromDocument, fullStroke } from "../../src/doc/document.ts";
import { MAX_POINTS_PER_STROKE, type Stroke } from "../../src/generated/contract.ts";
import { EMPTY } from "./model.ts";

/** SPEC D9: the same as in tests/property/test_document.py. */
test("tombstones hold no more points than a terrain", () => {
  const curve: [number, number][] = new Array(MAX_POINTS_PER_STROKE).fill([0.5, 1]);
  const strokes = new Map<string, Stroke>();
  for (let i = 0; i < 124; i++)
    strokes.set(`s${i}`, fullStroke({ id: `s${i}`, kind: "profile", first: [0, 0, 0], last: [9, 0, 0], curve }));
  let doc: Doc = { ...fromDocument(EMPTY), strokes };
  for (let i = 0; i < 124; i++) doc = apply(doc, { type: "stroke.delete", stroke: `s${i}` });
  expect([...doc.deleted.keys()]).toEqual(Array.from({ length: 122 }, (_, i) => `s${i + 2}`));
});
