// Texts of the page and their catalogue (SPEC U647, U648).
import { readdirSync, readFileSync } from "node:fs";
import { join, relative, resolve } from "node:path";
import { generateMsgId } from "@lit/localize/internal/id-generation.js";
import { parseSync } from "vite";
import { describe, expect, it } from "vitest";
import { templates } from "../../src/generated/locales/de.ts";

const SRC = resolve(import.meta.dirname, "../../src");
const CATALOGUE = resolve(import.meta.dirname, "../../words/de.xlf");

interface Node {
  readonly type: string;
  readonly [name: string]: unknown;
}

const isNode = (value: unknown): value is Node => typeof value === "object" && value !== null && "type" in value;

/** Visits a syntax tree from above; below a node whose visit says no it does not go. */
function walk(node: Node, visit: (node: Node) => boolean): void {
  if (!visit(node)) return;
  for (const value of Object.values(node))
    for (const child of Array.isArray(value) ? value : [value]) if (isNode(child)) walk(child, visit);
}

const isTagged = (node: Node, ...tags: string[]): boolean =>
  node.type === "TaggedTemplateExpression" && tags.includes(String((node.tag as Node).name));
const isMessage = (node: Node): boolean => node.type === "CallExpression" && (node.callee as Node).name === "msg";

/** The strings of a template around its expressions, as they are written or as they are read. */
function strings(node: Node, how: "raw" | "cooked"): string[] {
  const { quasis } = (node.type === "TaggedTemplateExpression" ? node.quasi : node) as { quasis: Node[] };
  return quasis.map((each) => (each.value as Record<string, string>)[how]!);
}

/** Attributes that people read or hear. */
const READ =
  /\s(title|aria-label|aria-description|aria-valuetext|placeholder|alt|label|hint|of|lead|detail|unit|copy-label)=(?:"([^"]*)"|'([^']*)')/g;
/** What is the same in every language: names of products and formats, keys, units. */
const SAME = /\b(?:Esker|EPSG|CSV|SVG|min|px|mm|km|kB|MB)\b|Mm³|https?:\/\/\S*/g;

const hasWords = (text: string): boolean => /\p{L}{2}/u.test(text.replace(SAME, "").replace(/&\w+;/g, ""));

/** Texts of a file's templates, and labels in them, that stand outside `msg`. */
function bare(source: string, name = "a.ts"): string[] {
  const found: string[] = [];
  walk(parseSync(name, source).program as unknown as Node, (node) => {
    if (isMessage(node)) return false;
    if (!isTagged(node, "html", "svg")) return true;
    const text = strings(node, "raw")
      .join("\0")
      .replace(/<!--[\s\S]*?-->|<(style|script|pre|code)\b[\s\S]*?<\/\1>/g, "");
    for (const [, attribute, double, single] of text.matchAll(READ)) {
      const value = double ?? single ?? "";
      if (hasWords(value)) found.push(`${attribute}="${value}"`);
    }
    for (const part of text.replace(/<\/?[a-z][^>]*>/gi, "\n").split(/[\n\0]/))
      if (hasWords(part)) found.push(part.trim());
    return true;
  });
  return found;
}

/** Messages of a file: their ids, each with how many expressions it has. */
function messages(source: string, name = "a.ts"): Map<string, number> {
  const found = new Map<string, number>();
  walk(parseSync(name, source).program as unknown as Node, (node) => {
    if (!isMessage(node)) return true;
    const [text, options] = node.arguments as Node[];
    const own = /\bid: "([^"]+)"/.exec(
      options ? source.slice(options.start as number, options.end as number) : "",
    )?.[1];
    const parts = text!.type === "Literal" ? [String(text!.value)] : strings(text!, "cooked");
    const id = own ?? generateMsgId(text!.type === "Literal" ? parts[0]! : parts, isTagged(text!, "html"));
    found.set(id, parts.length - 1);
    return true;
  });
  return found;
}

/** Code for a test, in which @{ stands for the beginning of an expression. */
const code = (text: string): string => text.replaceAll("@{", "$" + "{");

const sources = readdirSync(SRC, { recursive: true, encoding: "utf8" })
  .filter((file) => file.endsWith(".ts") && !file.startsWith("generated"))
  .map((file) => ({ file: relative(SRC, join(SRC, file)), text: readFileSync(join(SRC, file), "utf8") }));

describe("texts of templates (SPEC U647)", () => {
  it("stand in the catalogue, labels too", () => {
    const wrong = sources.flatMap(({ file, text }) => bare(text, file).map((each) => `${file}: ${each}`));
    expect(wrong).toEqual([]);
  });

  it("would be noticed outside", () => {
    expect(bare(code("html`<p>Hello @{x}</p>`"))).toEqual(["Hello"]);
    expect(bare(code('html`<b title="Stop it">@{y}</b>`'))).toEqual(['title="Stop it"']);
    expect(bare(code('html`<b aria-label="Draw @{x}"></b>`'))).toHaveLength(1);
    expect(bare(code("html`<ul>@{rows.map((r) => html`<li>Row @{r}</li>`)}</ul>`"))).toEqual(["Row"]);
    expect(
      bare(code('html`<p class="lead small" style="color: red">@{msg("Hello")} @{msg(html`<b>x y</b> of`)} 5 km</p>`')),
    ).toEqual([]);
  });
});

interface Unit {
  readonly id: string;
  readonly source: string;
  readonly target: string | null;
}

function units(catalogue: string): Unit[] {
  return [...catalogue.matchAll(/<trans-unit id="([^"]+)">([\s\S]*?)<\/trans-unit>/g)].map(([, id, inner]) => ({
    id: id!,
    source: /<source>([\s\S]*?)<\/source>/.exec(inner!)![1]!,
    target: /<target>([\s\S]*?)<\/target>/.exec(inner!)?.[1] ?? null,
  }));
}

const places = (text: string): string[] => [...text.matchAll(/<x id="(\d+)"/g)].map((m) => m[1]!).sort();

/** What is wrong with a catalogue for these messages. */
function wrongs(all: readonly Unit[], wanted: ReadonlySet<string>): string[] {
  const known = new Set(all.map(({ id }) => id));
  return [
    ...[...wanted].filter((id) => !known.has(id)).map((id) => `${id} is missing: npm run words`),
    ...all.filter(({ id }) => !wanted.has(id)).map(({ source }) => `nobody says any more: ${source}`),
    ...all.filter(({ target }) => !target?.trim()).map(({ source }) => `without a translation: ${source}`),
    ...all
      .filter(({ source, target }) => target && places(source).join() !== places(target).join())
      .map(({ source }) => `other expressions: ${source}`),
    ...all
      .filter(({ source, target }) => /^\s|\s$/.test(source) || /^\s|\s$/.test(target ?? ""))
      .map(({ source }) => `begins or ends with a space: ${source}`),
  ];
}

describe("the German catalogue (SPEC U648)", () => {
  const wanted = new Map(sources.flatMap(({ file, text }) => [...messages(text, file)]));
  const all = units(readFileSync(CATALOGUE, "utf8"));

  it("has every text of the page once, translated, with its expressions, and no other", () => {
    expect(wanted.size).toBeGreaterThan(1000);
    expect(wrongs(all, new Set(wanted.keys()))).toEqual([]);
    expect(new Set(all.map(({ id }) => id)).size).toBe(all.length);
  });

  it("is what the page loads", () => {
    const plain = (text: string): string =>
      text
        .replace(/&lt;/g, "<")
        .replace(/&gt;/g, ">")
        .replace(/&quot;/g, '"')
        .replace(/&amp;/g, "&");
    const loaded = templates as Readonly<Record<string, unknown>>;
    expect(Object.keys(loaded).sort()).toEqual(all.map(({ id }) => id).sort());
    const stale = all.filter(({ id, target }) => typeof loaded[id] === "string" && loaded[id] !== plain(target!));
    expect(stale.map(({ source }) => `npm run words: ${source}`)).toEqual([]);
  });

  it("says du, with quotation marks and dots as in German", () => {
    const texts = all.map(({ target }) => target!.replace(/<x [^>]*\/>/g, ""));
    expect(texts.filter((text) => /\p{Ll},? (?:Sie|Ihre?[nmrs]?)\b|"[^"]*"|“[^”]*”|\p{L}…/u.test(text))).toEqual([]);
    expect(texts.filter((text) => /„/.test(text) && !/„[^“]*“/.test(text))).toEqual([]);
  });

  it("would be noticed when it is not kept", () => {
    const unit = { id: "s1", source: 'Every <x id="0"/> m', target: 'Alle <x id="0"/> m' };
    expect(wrongs([unit], new Set(["s1"]))).toEqual([]);
    expect(wrongs([unit], new Set(["s1", "s2"]))).toHaveLength(1);
    expect(wrongs([unit], new Set())).toHaveLength(1);
    expect(wrongs([{ ...unit, target: null }], new Set(["s1"]))).toHaveLength(1);
    expect(wrongs([{ ...unit, target: "Alle m" }], new Set(["s1"]))).toHaveLength(1);
    expect(wrongs([{ ...unit, target: 'Alle <x id="0"/> m ' }], new Set(["s1"]))).toHaveLength(1);
    expect([...messages(code("msg(str`a @{b} c`); msg('x', { id: \"own\" });")).entries()]).toEqual([
      [generateMsgId(["a ", " c"], false), 1],
      ["own", 0],
    ]);
  });
});
