// SPEC U14, U15
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { describe, expect, it } from "vitest";

const SRC = resolve(import.meta.dirname, "../../src");

/** Modules that a file loads at once: static imports of values, followed through the sources. */
function loaded(entry: string, seen = new Set<string>()): Set<string> {
  const text = readFileSync(entry, "utf8");
  for (const match of text.matchAll(/^(?:import|export)\s+(?!type\b)(?:[^"';]*?from\s+)?"([^"]+)"/gm)) {
    const target = match[1]!;
    const path = target.startsWith(".") ? resolve(dirname(entry), target.replace(/\?.*$/, "")) : target;
    if (seen.has(path)) continue;
    seen.add(path);
    if (path.endsWith(".ts") && existsSync(path)) loaded(path, seen);
  }
  return seen;
}

describe("the landing page", () => {
  it("loads neither the 3D view nor the component library", () => {
    const modules = [...loaded(join(SRC, "main.ts")), ...loaded(join(SRC, "ui/pages/landing.ts"))];
    expect(modules.some((m) => m.endsWith("ui/pages/landing.ts") || m.endsWith("ui/pages/ridges.ts"))).toBe(true);
    const heavy = modules.filter((m) =>
      /webawesome\/dist\/components|wgpu-matrix|\/(gpu|input|tiles|doc|net)\//.test(m),
    );
    expect(heavy).toEqual([]);
  });

  it("would be caught loading it", () => {
    const modules = [...loaded(join(SRC, "ui/pages/terrain-page.ts"))];
    expect(modules.some((m) => /\/gpu\//.test(m))).toBe(true);
    expect(modules.some((m) => /webawesome/.test(m))).toBe(true);
  });
});

describe("the sources of the page", () => {
  const files = readdirSync(join(SRC, "ui"), { recursive: true, encoding: "utf8" });

  it("name no foreign origin", () => {
    for (const file of files.filter((f) => /\.(ts|css|svg)$/.test(f))) {
      const urls = readFileSync(join(SRC, "ui", file), "utf8").match(/\b(?:https?|wss?):\/\/[a-z0-9.-]+/gi) ?? [];
      expect(
        urls.filter((u) => u !== "http://www.w3.org"),
        file,
      ).toEqual([]);
    }
  });

  it("use only icons that the sprite holds", () => {
    const sprite = readFileSync(join(SRC, "ui/controls/icons.svg"), "utf8");
    const known = new Set([...sprite.matchAll(/<symbol id="([^"]+)"/g)].map((m) => m[1]));
    const used = new Set<string>();
    for (const file of files.filter((f) => f.endsWith(".ts"))) {
      const text = readFileSync(join(SRC, "ui", file), "utf8");
      for (const m of text.matchAll(/\bicon\("([^"]+)"\)|\bicon: "([^"]+)"|iconButton\(\s*"([^"]+)"/g))
        used.add((m[1] ?? m[2] ?? m[3])!);
    }
    expect(used.size).toBeGreaterThan(20);
    expect([...used].filter((name) => !known.has(name))).toEqual([]);
  });
});
