/** Imports under way, remembered by this tab: a page that is loaded anew goes on showing them. */

export interface KeptImport {
  /** Of the import on the server. */
  readonly id: string;
  readonly file: string;
}

const key = (terrain: string): string => `esker.imports.${terrain}`;

export function keptImports(terrain: string): KeptImport[] {
  try {
    const parsed: unknown = JSON.parse(window.sessionStorage.getItem(key(terrain)) ?? "[]");
    return Array.isArray(parsed) ? parsed.filter(isKept) : [];
  } catch {
    return [];
  }
}

export function keepImports(terrain: string, kept: readonly KeptImport[]): void {
  try {
    if (kept.length > 0) window.sessionStorage.setItem(key(terrain), JSON.stringify(kept));
    else window.sessionStorage.removeItem(key(terrain));
  } catch {
    // A blocked store costs the memory, never the page.
  }
}

/** One more, begun on another page of this tab. */
export function keepImport(terrain: string, kept: KeptImport): void {
  keepImports(terrain, [...keptImports(terrain), kept]);
}

function isKept(value: unknown): value is KeptImport {
  if (typeof value !== "object" || value === null) return false;
  const { id, file } = value as Record<string, unknown>;
  return typeof id === "string" && typeof file === "string";
}
