// Dependencies point one way (SPEC H2): generated <- core <- {doc, net, tiles} <- {input, gpu} <- app <- ui <- main.
import { readdirSync, readFileSync } from "node:fs";
import { dirname, join, relative, resolve } from "node:path";
import { describe, expect, it } from "vitest";

const SRC = resolve(import.meta.dirname, "../src");

const MAY_IMPORT: Readonly<Record<string, readonly string[]>> = {
  generated: [],
  core: ["generated"],
  doc: ["generated", "core"],
  net: ["generated", "core"],
  tiles: ["generated", "core"],
  input: ["generated", "core", "doc", "net", "tiles"],
  gpu: ["generated", "core", "doc", "net", "tiles"],
  app: ["generated", "core", "doc", "net", "tiles", "input", "gpu"],
  ui: ["generated", "core", "doc", "net", "tiles", "input", "gpu", "app"],
  "main.ts": ["generated", "core", "doc", "net", "tiles", "input", "gpu", "app", "ui"],
};

/** Names that a folder may show at most (SPEC H2). */
const MOST_NAMES = 16;

/** DOM and GPU names that the rooms below input and ui must not touch. */
const FORBIDDEN: Readonly<Record<string, RegExp>> = {
  core: /\b(document|window|navigator|localStorage|GPUDevice|HTMLElement)\b\s*[.(]/,
  doc: /\b(window|navigator|localStorage|WebSocket|HTMLElement|setTimeout)\b\s*[.(]/,
  tiles: /\b(document|window|navigator|localStorage|WebSocket|HTMLElement)\b\s*[.(]/,
};

function sources(folder: string): string[] {
  return readdirSync(folder, { withFileTypes: true }).flatMap((e) => {
    const path = join(folder, e.name);
    return e.isDirectory() ? sources(path) : /\.ts$/.test(e.name) ? [path] : [];
  });
}

/** Specifiers of static imports, re-exports, dynamic imports and worker URLs. */
function imports(text: string): string[] {
  const code = text.replace(/\/\*[\s\S]*?\*\//g, "").replace(/^\s*\/\/.*$/gm, "");
  const found = code.matchAll(/(?:\bfrom\s*|\bimport\s*\(\s*|^\s*import\s*|new URL\(\s*)["']([^"']+)["']/gm);
  return [...found].map((m) => m[1]!);
}

/** Groups of files that reach each other by imports (Tarjan's strongly connected components), each of two or more. */
function circles(edges: ReadonlyMap<string, readonly string[]>): string[][] {
  const index = new Map<string, number>();
  const low = new Map<string, number>();
  const stack: string[] = [];
  const found: string[][] = [];
  const visit = (name: string): void => {
    index.set(name, index.size);
    low.set(name, index.get(name)!);
    stack.push(name);
    for (const next of edges.get(name) ?? []) {
      if (!index.has(next)) visit(next);
      if (stack.includes(next)) low.set(name, Math.min(low.get(name)!, low.get(next)!));
    }
    if (low.get(name) !== index.get(name)) return;
    const group = stack.splice(stack.indexOf(name));
    if (group.length > 1) found.push(group.sort());
  };
  for (const name of edges.keys()) if (!index.has(name)) visit(name);
  return found;
}

const room = (path: string): string => relative(SRC, path).split("/")[0]!;

/** What is wrong with one file's imports. */
function violations(path: string, text: string): string[] {
  const own = room(path);
  const wrong: string[] = [];
  for (const specifier of imports(text)) {
    if (!specifier.startsWith(".")) continue;
    const target = resolve(dirname(path), specifier);
    if (relative(SRC, target).startsWith("..")) {
      wrong.push(`${specifier}: leaves src`);
      continue;
    }
    const to = room(target);
    if (!/\.(ts|css|svg|json)(\?\w+)?$/.test(specifier)) wrong.push(`${specifier}: carries no extension`);
    if (to !== own && !(MAY_IMPORT[own] ?? []).includes(to)) wrong.push(`${specifier}: ${own} may not import ${to}`);
  }
  return wrong;
}

/** What of a component's file takes the whole stage or the whole session. */
function reaches(text: string): string[] {
  const found = text.matchAll(
    /\bapp\/(?:view\/stage|session)\.ts|\bstage: \{ attribute|\bdeclare stage\b|: OpenTerrain\b/g,
  );
  return [...found].map((m) => m[0]);
}

/** Lines whose members are private or protected by keyword, where neither an override nor a class in `bases` asks for it. */
function keywords(text: string, bases: ReadonlySet<string>): string[] {
  const code = text.replace(/\/\*[\s\S]*?\*\//g, "");
  const has = (line: string, word: string): boolean =>
    new RegExp(`(?:^\\s*|[(,]\\s*)${word} (?!constructor\\b|override\\b)[\\w*]+`).test(line);
  const shared = [...code.matchAll(/\bclass (\w+)/g)].some((m) => bases.has(m[1]!));
  return code.split("\n").filter((line) => has(line, "private") || (!shared && has(line, "protected")));
}

describe("one-way imports", () => {
  const files = sources(SRC);

  it("finds the rooms of the house, and no other", () => {
    expect(new Set(files.map(room))).toEqual(new Set(Object.keys(MAY_IMPORT)));
  });

  it.each(files.map((f) => relative(SRC, f)))("%s", (name) => {
    const path = join(SRC, name);
    expect(violations(path, readFileSync(path, "utf8"))).toEqual([]);
  });

  it.each(Object.keys(FORBIDDEN))("%s touches no DOM", (name) => {
    const touching = files
      .filter((f) => room(f) === name)
      .filter((f) => FORBIDDEN[name]!.test(readFileSync(f, "utf8").replace(/\/\*[\s\S]*?\*\//g, "")));
    expect(touching.map((f) => relative(SRC, f))).toEqual([]);
  });

  it("keeps components out of app", () => {
    const drawing = files
      .filter((f) => room(f) === "app")
      .filter((f) => imports(readFileSync(f, "utf8")).some((s) => /^(lit\b|@awesome\.me)/.test(s)));
    expect(drawing.map((f) => relative(SRC, f))).toEqual([]);
  });

  it("exports nothing that nobody names (SPEC H574)", () => {
    const all = [...files, ...sources(resolve(SRC, "../test"))].map(
      (path) => [path, readFileSync(path, "utf8")] as const,
    );
    const times = new Map<string, number>();
    for (const [, text] of all) {
      for (const [word] of text.matchAll(/[\w$]+/g)) times.set(word, (times.get(word) ?? 0) + 1);
    }
    const exported = /^export (?:abstract |async )*(?:const|function|class|interface|type|enum) (\w+)/gm;
    const unnamed = all
      .filter(([path]) => room(path) !== "generated")
      .flatMap(([path, text]) => [...text.matchAll(exported)].map(([, name]) => [path, name!] as const))
      .filter(([, name]) => times.get(name) === 1);
    expect(times.size).toBeGreaterThan(1000);
    expect(unnamed.map(([path, name]) => `${relative(SRC, path)}: ${name}`)).toEqual([]);
  });

  it("shows few names in a folder", () => {
    const names = new Map<string, number>();
    for (const path of files) {
      for (let at = path; at !== SRC; at = dirname(at)) names.set(at, 0);
    }
    const shown = new Map<string, number>();
    for (const at of names.keys()) shown.set(dirname(at), (shown.get(dirname(at)) ?? 0) + 1);
    const large = [...shown].filter(([, count]) => count > MOST_NAMES).map(([at]) => relative(SRC, at));
    expect(large).toEqual([]);
  });

  it("has no circles between files", () => {
    const names = new Set(files);
    const edges = new Map(
      files.map((f) => [
        f,
        imports(readFileSync(f, "utf8"))
          .map((s) => resolve(dirname(f), s))
          .filter((t) => names.has(t)),
      ]),
    );
    expect(circles(edges).map((c) => c.map((f) => relative(SRC, f)))).toEqual([]);
  });

  it("would notice a circle", () => {
    expect(
      circles(
        new Map([
          ["a", ["b"]],
          ["b", ["c"]],
          ["c", ["b"]],
        ]),
      ),
    ).toEqual([["b", "c"]]);
  });

  it("writes private members as #x (SPEC H470)", () => {
    const texts = files.map((f) => readFileSync(f, "utf8"));
    const bases = new Set(texts.flatMap((t) => [...t.matchAll(/\bextends (\w+)/g)].map((m) => m[1]!)));
    expect(files.flatMap((f, k) => keywords(texts[k]!, bases).map((line) => `${relative(SRC, f)}: ${line}`))).toEqual(
      [],
    );
  });

  it("would notice a private keyword", () => {
    const of = (text: string): number => keywords(text, new Set(["Base"])).length;
    expect(of("class A {\n  private b = 1;\n}")).toBe(1);
    expect(of("class A {\n  constructor(private readonly b: number) {}\n}")).toBe(1);
    expect(of("class A {\n  protected b = 1;\n}")).toBe(1);
    expect(of("class A {\n  private constructor() {}\n}")).toBe(0);
    expect(of("class A extends Base {\n  protected override c(): void {}\n}")).toBe(0);
    expect(of("class Base {\n  protected b = 1;\n}")).toBe(0);
  });

  it("gives components what they show, not the stage (SPEC H471)", () => {
    const components = files.filter((f) => room(f) === "ui" && !f.includes("/ui/pages/"));
    const wrong = components.flatMap((f) =>
      reaches(readFileSync(f, "utf8")).map((what) => `${relative(SRC, f)}: ${what}`),
    );
    expect(wrong).toEqual([]);
  });

  it("would notice a component that takes the stage", () => {
    expect(reaches('import type { Stage } from "../../app/view/stage.ts";')).toHaveLength(1);
    expect(reaches('import type { TerrainSession } from "../../app/session.ts";')).toHaveLength(1);
    expect(reaches("static override properties = { stage: { attribute: false } };")).toHaveLength(1);
    expect(reaches("declare terrain: OpenTerrain;")).toHaveLength(1);
    expect(reaches('declare terrain: Pick<OpenTerrain, "id">;')).toEqual([]);
  });

  it("would notice a wrong one", () => {
    const path = join(SRC, "doc/x.ts");
    expect(violations(path, 'import { a } from "../net/connection.ts";')).toHaveLength(1);
    expect(violations(path, 'const a = await import("../ui/toasts.ts");')).toHaveLength(1);
    expect(violations(path, 'import { a } from "../core/math";')).toHaveLength(1);
    expect(violations(path, 'import { a } from "../core/math.ts";')).toEqual([]);
    expect(violations(path, '// from "../net/connection.ts"')).toEqual([]);
  });
});
