// @vitest-environment happy-dom
// Notices of a lesson in the language of the page (SPEC L165).
import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { afterEach, describe, expect, it } from "vitest";
import { noticeWords } from "../../src/app/words/notices.ts";
import { speak } from "../../src/core/language.ts";
import type { Notice } from "../../src/generated/contract.ts";

const VECTORS = resolve(import.meta.dirname, "../../../tests/vectors/notices.json");
const { cases } = JSON.parse(readFileSync(VECTORS, "utf8")) as { cases: Notice[] };

describe("notices of a lesson (SPEC L165)", () => {
  afterEach(() => speak("en"));

  it("are the server's in English", () => {
    for (const notice of cases) expect(noticeWords(notice)).toBe(notice.text);
  });

  it("are all known in German, with the names of whom they tell", async () => {
    await speak("de", "de-DE");
    for (const notice of cases) {
      expect(noticeWords(notice), notice.text).not.toBe(notice.text);
      for (const name of notice.text.includes("Ada") ? notice.names : []) expect(noticeWords(notice)).toContain(name);
    }
    const three = cases.find(({ code, names }) => code === "taken_back" && names.length === 3)!;
    expect(noticeWords(three)).toContain("Ada, Ben und Cho");
  });

  it("are the server's where it is newer than the page", async () => {
    await speak("de", "de-DE");
    const strange = { type: "notice", code: "soon", names: [], text: "It is late." } as unknown as Notice;
    expect(noticeWords(strange)).toBe("It is late.");
  });
});
