// Both themes are read by everybody: WCAG 2.2 AA (SPEC U36).
import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { describe, expect, it } from "vitest";
import { type Colour, contrast, over, parseColour } from "../ui/contrast.ts";

const CSS = readFileSync(resolve(import.meta.dirname, "../../src/ui/styles/theme.css"), "utf8");

/** The page's colours by name, as one rule of the style sheet sets them. */
function colours(selector: string): Map<string, Colour> {
  const body = new RegExp(`${selector} \\{([^}]*--esk-bg[^}]*)\\}`).exec(CSS)?.[1] ?? "";
  const found = new Map<string, Colour>();
  for (const [, name, value] of body.matchAll(/--esk-([\w-]+): (#[0-9a-f]{6}|rgb\([^)]*\));/g))
    found.set(name!, parseColour(value!));
  return found;
}

const TEXT = ["text", "quiet", "accent-text", "ok", "warn", "bad"];
const GROUNDS = ["bg", "panel", "panel-solid", "field", "hover", "chosen", "accent-soft"];

describe.each([
  ["light", ":root"],
  ["dark", "\\.wa-dark"],
])("the %s theme", (_name, selector) => {
  const all = colours(selector);
  const get = (name: string): Colour => {
    const colour = all.get(name);
    if (colour === undefined) throw new Error(`no --esk-${name}`);
    return colour;
  };
  const ground = (name: string): Colour => over(get(name), get("panel-solid"));

  it("has text of 4.5 : 1 on every ground", () => {
    for (const name of GROUNDS)
      for (const text of TEXT)
        expect(contrast(get(text), ground(name)), `${text} on ${name}`).toBeGreaterThanOrEqual(4.5);
    const white: Colour = [255, 255, 255, 1];
    for (const name of ["accent", "accent-hover"])
      expect(contrast(white, get(name)), `white on ${name}`).toBeGreaterThanOrEqual(4.5);
  });

  it("has controls, their edges and the focus at 3 : 1", () => {
    for (const [name, on] of [
      ["accent", "panel"],
      ["focus", "panel"],
      ["focus", "bg"],
      ["mountain", "panel"],
      ["plateau", "panel"],
    ] as const)
      expect(contrast(get(name), ground(on)), `${name} on ${on}`).toBeGreaterThanOrEqual(3);
    for (const on of ["panel", "field"])
      expect(contrast(over(get("edge"), ground(on)), ground(on)), `edge on ${on}`).toBeGreaterThanOrEqual(3);
  });
});
