// What the page may send follows the contract, case by case with the server (SPEC P).
import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { checkClientMessage, checkOp } from "../../src/core/wire.ts";

interface MessageCase {
  name: string;
  text: string;
  accept: boolean;
}

const path = new URL("../../../tests/vectors/messages.json", import.meta.url);
const cases = (JSON.parse(readFileSync(path, "utf8")) as { cases: MessageCase[] }).cases;

function accepted(text: string): boolean {
  try {
    return checkClientMessage(JSON.parse(text)) === null;
  } catch {
    return false;
  }
}

describe("messages", () => {
  it.each(cases.map((c) => [c.name, c] as const))("%s", (_name, c) => {
    expect(accepted(c.text)).toBe(c.accept);
  });

  it("numbers that JSON cannot carry are refused before they are sent", () => {
    for (const x of [Number.NaN, Number.POSITIVE_INFINITY])
      expect(checkOp({ type: "stroke.anchor", stroke: "a", which: "last", to: [x, 0, 0] })).toContain(
        "must be a number",
      );
  });

  it("says which field is wrong", () => {
    expect(checkOp({ type: "stroke.set", stroke: "a", fields: { left: { slope_deg: 99 } } })).toBe(
      "fields left slope_deg must be a number from 0 to 85",
    );
  });
});
