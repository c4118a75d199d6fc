/** `licences.txt` beside the page: what others made and is in it, with the texts that their licences want to go along. */

import { readdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";
import type { Plugin } from "vite";

/** The folder of the package that a module belongs to, null for our own. Innermost where packages hold packages. */
export function packageOf(id: string): string | null {
  return /^\0?(.*\/node_modules\/(?:@[^/]+\/)?[^/?]+)\//.exec(id)?.[1] ?? null;
}

/** Name, version and licence of a package, and the texts of its licence and notice files. Throws for one without any. */
export function licenceOf(folder: string): string {
  const { name, version, license } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
  const files = readdirSync(folder).filter((file) => /^(licen[cs]e|notice|copying)(\.|$)/i.test(file));
  if (files.length === 0 && !license) throw new Error(`${name} has no licence.`);
  const texts = files.sort().map((file) => readFileSync(join(folder, file), "utf8").trim());
  return [`${name} ${version} (${license ?? "see below"})`, ...texts].join("\n\n");
}

/** Everything in one text, packages by name. `notice`: what stands above them. */
export function licencesText(notice: string, ids: Iterable<string>): string {
  const folders = new Set([...ids].map(packageOf).filter((folder) => folder !== null));
  const line = `\n\n${"-".repeat(80)}\n\n`;
  return `${[notice.trim(), ...[...folders].sort().map(licenceOf)].join(line)}\n`;
}

/** Writes the file at every build. `notice`: the project's NOTICE. */
export function licences(notice: string): Plugin {
  return {
    name: "licences",
    apply: "build",
    generateBundle(_, bundle) {
      // Fonts come in by styles, not as modules: their files tell.
      const files = Object.values(bundle).flatMap((part) => (part.type === "asset" ? part.originalFileNames : []));
      const ids = [...this.getModuleIds(), ...files.map((file) => resolve(import.meta.dirname, file))];
      const source = licencesText(readFileSync(notice, "utf8"), ids);
      this.emitFile({ type: "asset", fileName: "licences.txt", source });
    },
  };
}
