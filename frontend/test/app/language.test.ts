// @vitest-environment happy-dom
// The language of the page (SPEC U645, U650).
import { existsSync, readFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { msg, str } from "@lit/localize";
import { afterEach, describe, expect, it } from "vitest";
import { fitting } from "../../src/app/device/language.ts";
import { historyWords } from "../../src/app/history/history-words.ts";
import { scoreWords } from "../../src/app/lesson/task/score-words.ts";
import type { Goal } from "../../src/app/lesson/task/words.ts";
import { readRefusal } from "../../src/app/server/api.ts";
import { galleryWords } from "../../src/app/words/gallery.ts";
import { refusalWords } from "../../src/app/words/refusals.ts";
import { ago, height, metres } from "../../src/app/words/words.ts";
import { counted, fixed, grouped, midSentence, plain, speak, whoDid } from "../../src/core/language.ts";

const SRC = resolve(import.meta.dirname, "../../src");

describe("the language of the page (SPEC U645)", () => {
  afterEach(() => speak("en"));

  it("is the browser's where the page has it, else English, or what was chosen", () => {
    expect(fitting(["de-AT", "en-US"], null)).toEqual({ code: "de", tag: "de-AT" });
    expect(fitting(["fr-CH", "de-CH", "en"], null)).toEqual({ code: "de", tag: "de-CH" });
    expect(fitting(["fr", "it"], null)).toEqual({ code: "en", tag: "en" });
    expect(fitting([], null)).toEqual({ code: "en", tag: "en" });
    expect(fitting(["de-DE", "en-GB"], "en")).toEqual({ code: "en", tag: "en-GB" });
    expect(fitting(["en-US"], "de")).toEqual({ code: "de", tag: "de" });
    expect(fitting(["en-US"], "kl")).toEqual({ code: "en", tag: "en-US" });
    expect(fitting(["de_broken tag", "de"], null)).toEqual({ code: "de", tag: "de" });
  });

  it("says words, numbers and units", async () => {
    expect(msg("New terrain")).toBe("New terrain");
    expect([metres(8.4), height(-0.04), ago(3_600_000)]).toEqual(["8.4 m", "0.0 m", "an hour ago"]);
    expect([counted(25_000), grouped(1250.4, 1), plain(0.125)]).toEqual(["25,000", "1 250.4", "0.125"]);
    expect([midSentence("Snow"), whoDid("Ada", "drew")]).toEqual(["snow", "Ada drew"]);
    await speak("de", "de-DE");
    expect(msg("New terrain")).toBe("Neues Gelände");
    expect(msg(str`Every ${5} m`)).toBe("Alle 5 m");
    expect([metres(8.4), height(-12.5), ago(3_600_000)]).toEqual(["8,4 m", "-12,5 m", "vor einer Stunde"]);
    expect([counted(25_000), grouped(1250.4, 1), plain(0.125)]).toEqual(["25.000", "1 250,4", "0,125"]);
    expect([fixed(2.5), fixed(0.0004, 2), fixed(-0.0004, 2)]).toEqual(["3", "0,00", "0,00"]);
    expect([midSentence("Schnee"), whoDid("Ada", "Berg")]).toEqual(["Schnee", "Ada: Berg"]);
    await speak("de", "de-CH");
    expect(fixed(1.5, 1)).toBe("1.5");
  });
});

describe("what the server says (SPEC U651, U652)", () => {
  afterEach(() => speak("en"));

  it("is said by its code in another language; in the server's sentence where that carries facts, and in English", async () => {
    expect(refusalWords("busy", "Another file of yours is still being brought in.")).toMatch(/^Another file/);
    await speak("de");
    expect(refusalWords("busy", "Another file of yours is still being brought in.")).toMatch(/^Der Server ist/);
    expect(refusalWords("no_seat", "This class is over. Ask your teacher.")).toBe(
      "Diese Klasse ist vorbei. Frag deine Lehrkraft.",
    );
    expect(refusalWords("malformed", "title: Field required.")).toMatch(/^Der Server hat nicht verstanden/);
    expect(refusalWords("refused", "The picture has 8 bits.")).toBe("The picture has 8 bits.");
    expect(refusalWords("of-a-newer-server", "No.")).toBe("No.");
    expect(readRefusal(404, '{"code": "no_link", "message": "There is no such link."}').message).toMatch(
      /^Diesen Link/,
    );
    expect(readRefusal(502, "<html>").message).toBe("Der Server hat abgelehnt (502). Versuche es gleich noch einmal.");
  });

  it("of the history becomes words from its facts", async () => {
    const facts = { kind: "stroke", count: 1, noun: "mountain", label: "", paint: "" };
    const entry = {
      first: 1,
      last: 2,
      at: null,
      author: "a",
      action: "draw",
      turn: "" as const,
      text: "drew a mountain",
      facts,
    };
    expect(historyWords(entry)).toBe("drew a mountain");
    await speak("de");
    expect(historyWords(entry)).toBe("Berg gezeichnet");
    expect(historyWords({ ...entry, turn: "undo" })).toBe("zurückgenommen: Berg gezeichnet");
    expect(historyWords({ ...entry, action: "hide", turn: "undo" })).toBe("wieder: Berg gezeigt");
    expect(historyWords({ ...entry, action: "move", facts: { ...facts, noun: "plateau", label: "Mesa" } })).toBe(
      "Plateau „Mesa“ verschoben",
    );
    expect(historyWords({ ...entry, action: "delete", facts: { ...facts, count: 3 } })).toBe("3 Linien gelöscht");
    expect(historyWords({ ...entry, action: "paint", facts: { ...facts, paint: "snow" } })).toMatch(/ gemalt$/);
    // Words in constants keep the language in which they were loaded: English here, German in a German page.
    const fields = ["look", "sea_level_m"];
    expect(historyWords({ ...entry, action: "settings", facts: { ...facts, kind: "terrain", fields } })).toMatch(
      /^\S.* und \S.* geändert$/,
    );
    const { facts: _, ...bare } = entry;
    expect(historyWords(bare), "an older server").toBe("drew a mountain");
  });
});

describe("why so many points (SPEC U653)", () => {
  afterEach(() => speak("en"));
  const area = { type: "area", level_m: 50, at_least_m2: 16e6, dry: false } as const;
  const score = { text: "53 of 100: 8.52 km² of the 16 km² asked for are above 50 m.", figures: [8_519_680, 16e6, 50] };

  it("is worded from the figures in German, and as the server says in English or without figures", async () => {
    expect(scoreWords(area, score)).toBe("8.52 km² of the 16 km² asked for are above 50 m.");
    await speak("de");
    expect(scoreWords(area, score)).toBe("8,52 km² von verlangten 16 km² liegen über 50 m.");
    expect(scoreWords({ ...area, dry: true }, score)).toMatch(/ bleiben trocken, wenn das Meer auf 50 m steht\.$/);
    expect(scoreWords(area, { ...score, figures: [] })).toBe("8.52 km² of the 16 km² asked for are above 50 m.");
    const slope: Goal = { type: "slope", path: [], at_most: 0.1 };
    expect(scoreWords(slope, { text: "", figures: [80, 0.1, 0.253] })).toBe(
      "80 % des Weges sind nicht steiler als 10 %; die steilste Stelle hat 25,3 %.",
    );
    const volume: Goal = { type: "volume", point: [0, 0], level_m: 9, at_least_m3: 2e6 };
    expect(scoreWords(volume, { text: "", figures: [0, 2e6] })).toBe("Am Punkt bleibt kein Wasser; es läuft weg.");
    expect(scoreWords(volume, { text: "", figures: [1.5e6, 2e6, 7.5, 1] })).toBe(
      "Der See hält 1,5 Mio. m³ von verlangten 2 Mio. m³. Er steht auf 7,5 m, dort liefe er über.",
    );
  });
});

describe("the gallery (SPEC U654)", () => {
  afterEach(() => speak("en"));
  const delta = { id: "delta", title: "Delta!", description: "Arms." };

  it("has its words in German, and the server's in English or where the page has none", async () => {
    expect(galleryWords(delta)).toEqual({ title: "Delta!", description: "Arms." });
    await speak("de");
    expect(galleryWords(delta).description).toMatch(/^Ein Fluss teilt sich/);
    expect(galleryWords({ ...delta, id: "mine" })).toEqual({ title: "Delta!", description: "Arms." });
  });
});

/** Modules that a file loads at once: static imports of values, followed through the sources. */
function loaded(entry: string, seen = new Set<string>()): Set<string> {
  seen.add(entry);
  for (const match of readFileSync(entry, "utf8").matchAll(
    /^(?:import|export)\s+(?!type\b)(?:[^"';]*?from\s+)?"(\.[^"]+\.ts)"/gm,
  )) {
    const path = resolve(dirname(entry), match[1]!);
    if (!seen.has(path) && existsSync(path)) loaded(path, seen);
  }
  return seen;
}

describe("what is loaded before the language (SPEC U650)", () => {
  const speaking = (entry: string): string[] =>
    [...loaded(join(SRC, entry))].filter((path) => /\bmsg\(/.test(readFileSync(path, "utf8")));

  it("says nothing, so that words may stand in constants", () => {
    expect(speaking("main.ts")).toEqual([]);
    expect(speaking("ui/pages/landing.ts").length).toBeGreaterThan(1);
  });

  it("is no catalogue: English pages load none", () => {
    const all = [...loaded(join(SRC, "main.ts")), ...loaded(join(SRC, "ui/pages/terrain-page.ts"))];
    expect(all.filter((path) => path.endsWith("locales/de.ts"))).toEqual([]);
    expect(all.some((path) => path.endsWith("locales/codes.ts"))).toBe(true);
  });
});
