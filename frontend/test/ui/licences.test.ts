// What the page holds of others goes with their licences (SPEC U40).
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { afterAll, describe, expect, it } from "vitest";
import { licenceOf, licencesText, packageOf } from "../../licences.ts";

const MODULES = resolve(import.meta.dirname, "../../node_modules");
const made = mkdtempSync(join(tmpdir(), "licences-"));
afterAll(() => rmSync(made, { recursive: true }));

describe("licences", () => {
  it("know the package of a module, the innermost one, and that ours has none", () => {
    expect(packageOf("/a/node_modules/lit/index.js?v=1")).toBe("/a/node_modules/lit");
    expect(packageOf("\0/a/node_modules/@x/y/z.css")).toBe("/a/node_modules/@x/y");
    expect(packageOf("/a/node_modules/b/node_modules/c/d.js")).toBe("/a/node_modules/b/node_modules/c");
    expect(packageOf("/a/src/main.ts")).toBeNull();
  });

  it("give every package once, with its text in full, below the notice", () => {
    const text = licencesText("Ours", [`${MODULES}/lit/index.js`, `${MODULES}/lit/html.js`, "/src/main.ts"]);
    expect(text.startsWith("Ours\n")).toBe(true);
    expect(text.match(/^lit \d+\.\d+\.\d+ \(BSD-3-Clause\)$/gm)).toHaveLength(1);
    expect(text).toContain("Redistributions in binary form must reproduce the above copyright");
  });

  it("refuse a package that has none", () => {
    const folder = join(made, "node_modules", "bare");
    mkdirSync(folder, { recursive: true });
    writeFileSync(join(folder, "package.json"), '{"name": "bare", "version": "1.0.0"}');
    expect(() => licenceOf(folder)).toThrow("bare has no licence");
  });
});
