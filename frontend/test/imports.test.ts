// Dependencies point one way (SPEC H2): generated <- core <- {doc, net, tiles} <- {input, gpu} <- ui <- main.
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
  ui: ["generated", "core", "doc", "net", "tiles", "input", "gpu"],
  "main.ts": ["generated", "core", "doc", "net", "tiles", "input", "gpu", "ui"],
};

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

  it("would notice a wrong one", () => {
    const path = join(SRC, "doc/x.ts");
    expect(violations(path, 'import { a } from "../net/connection.ts";')).toHaveLength(1);
    expect(violations(path, 'const a = await import("../ui/toasts.ts");')).toHaveLength(1);
    expect(violations(path, 'import { a } from "../core/math";')).toHaveLength(1);
    expect(violations(path, 'import { a } from "../core/math.ts";')).toEqual([]);
    expect(violations(path, '// from "../net/connection.ts"')).toEqual([]);
  });
});
