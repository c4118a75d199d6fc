// @vitest-environment happy-dom
// Questions of imports in the language of the page (SPEC U692).
import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { afterEach, describe, expect, it } from "vitest";
import { questionWords } from "../../src/app/words/question-words.ts";
import { speak } from "../../src/core/language.ts";
import type { ImportQuestion } from "../../src/generated/contract.ts";

const VECTORS = resolve(import.meta.dirname, "../../../tests/vectors/questions.json");
const { cases } = JSON.parse(readFileSync(VECTORS, "utf8")) as { cases: ImportQuestion[] };

describe("questions of imports (SPEC U692)", () => {
  afterEach(() => speak("en"));

  it("are the server's in English", () => {
    for (const question of cases) expect(questionWords(question)).toBe(question.text);
  });

  it("are all known in German, each with its figures", async () => {
    await speak("de", "de-DE");
    const words = cases.map(questionWords);
    for (const [k, word] of words.entries()) expect(word, cases[k]!.text).not.toBe(cases[k]!.text);
    expect(new Set(words).size).toBe(cases.length);
    const said = (id: string): string[] => words.filter((_, k) => cases[k]!.id === id);
    expect(said("band")[0]).toContain("4 B\u00e4nder");
    expect(said("nodata")[0]).toMatch(/^-9999\b.*0,25 %/);
    expect(said("range")[0]).toMatch(/von 0 bis 65535/);
    expect(said("height")[0]).toMatch(/8\D?848 m.*4\D?096 m.*5\D?200 m senken/);
    expect(said("height")[1]).toMatch(/9\D?000 m anheben/);
    expect(said("place")[0]).toMatch(/1\D?235 km/);
  });

  it("are the server's where the page does not know them", async () => {
    await speak("de", "de-DE");
    const strange = { id: "colour", text: "Which colour?", options: [], default: "" };
    expect(questionWords(strange)).toBe("Which colour?");
    const moved = { ...cases.find(({ id }) => id === "height")!, text: "It is too high by far." };
    expect(questionWords(moved)).toBe("It is too high by far.");
  });
});
