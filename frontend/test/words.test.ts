// The page says each thing in one word, the field's (SPEC H473, docs/glossary.md).
import { readdirSync, readFileSync } from "node:fs";
import { join, relative, resolve } from "node:path";
import { describe, expect, it } from "vitest";

const PAGE = resolve(import.meta.dirname, "..");

/** Old words, and what is said instead. */
const OLD: Readonly<Record<string, string>> = {
  wish: "request",
  wishes: "requests",
  wished: "requested",
  lapse: "time lapse",
  grip: "handle",
  grips: "handles",
  presses: "pointer actions",
  pointing: "hit test",
  sheet: "placing pass, water, glyphs, drawer, print map, dialog: what it is",
  sheets: "placing pass, water, glyphs, drawer, print map, dialog: what it is",
  laying: "placing, or base building",
  steady: "preview stabiliser",
  chronicle: "activity log",
  glimpse: "early preview",
  scout: "preview workspace",
};

/** What may be said all the same: sentences that people see, names of other programs, fields of messages. */
const ALLOWED = [
  /\b[Tt]ime[ -]?[Ll]apse/g,
  /as on a rubber sheet\b/g,
  /\bLaying the real ground\b/g,
  /\bstyle sheets?\b/g,
  /\bspriteSheet\b/g,
  /\bicon\("grip"\)/g,
  /\bmessage\.laying\b/g,
  /\blaying: (?:true|false)\b/g,
];

function sources(folder: string): string[] {
  return readdirSync(folder, { withFileTypes: true }).flatMap((e) => {
    const path = join(folder, e.name);
    if (e.isDirectory()) return e.name === "generated" ? [] : sources(path);
    return e.name.endsWith(".ts") && e.name !== "words.test.ts" ? [path] : [];
  });
}

/** Old words in a text, each taken from identifiers in any case: `layingBar`, `LAYING_BAR` and `laying-bar` are one. */
function oldWords(text: string): string[] {
  const left = ALLOWED.reduce((t, allowed) => t.replace(allowed, ""), text);
  const words = left.replace(/([a-z0-9])([A-Z])/g, "$1 $2").matchAll(/[A-Za-z]+/g);
  return [...new Set([...words].map((m) => m[0].toLowerCase()).filter((word) => Object.hasOwn(OLD, word)))];
}

/** Beginnings of sentences whose noun stands somewhere else. */
const OPENING = /^(?:That|Of|As of|So many|So much|The same|Whose|Theirs|Its own|And)\b/;

/** Comments of a text, each from its first word on. Lines with // that follow each other are one. */
function comments(text: string): string[] {
  const found = text.matchAll(
    /\/\*\*?\s*(?:\*\s)?\s*([^*\n]*)|((?:^[ \t]*\/\/[^\n]*\n)+)|(?<=[;,{}() ])\/\/ ([^\n]*)/gm,
  );
  return [...found].map((m) => (m[1] ?? m[2]?.replace(/^[ \t]*\/\/ ?/, "") ?? m[3] ?? "").trim());
}

describe("words", () => {
  const files = [...sources(join(PAGE, "src")), ...sources(join(PAGE, "test"))];

  it("are the glossary's, in code, comments and names of files", () => {
    const wrong = files.flatMap((path) => {
      const name = relative(PAGE, path);
      return oldWords(`${name}\n${readFileSync(path, "utf8")}`).map((word) => `${name}: ${word}, say ${OLD[word]}`);
    });
    expect(wrong).toEqual([]);
  });

  it("stand in sentences that have their noun (SPEC H513)", () => {
    const wrong = sources(join(PAGE, "src")).flatMap((path) => {
      const riddles = comments(readFileSync(path, "utf8")).filter((comment) => OPENING.test(comment));
      return riddles.map((riddle) => `${relative(PAGE, path)}: ${riddle.split("\n")[0]}`);
    });
    expect(wrong).toEqual([]);
    const text =
      "/** Of masks. */\n/**\n * The same as above.\n */\n  // That is over.\n  // of it\nx(); // And why.\n";
    expect(comments(text).filter((comment) => OPENING.test(comment))).toHaveLength(4);
    expect(comments("// Offsets\n// of masks\n/** Andes */\n").filter((c) => OPENING.test(c))).toEqual([]);
  });

  it("would notice an old one", () => {
    for (const text of [
      "class LayingBar {}",
      "const LAYING_BAR = 1;",
      "import './laying-bar.ts'",
      "this.#grips",
      "a sheet",
    ])
      expect(oldWords(text), text).toHaveLength(1);
    for (const text of ["a time lapse", "TimeLapse", "timeLapse", "presentation", "delaying", "message.laying"])
      expect(oldWords(text), text).toEqual([]);
  });
});
