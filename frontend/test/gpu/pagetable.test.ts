/** Where shaders find the slot of a tile (SPEC R21). */

import { describe, expect, it } from "vitest";
import { NO_SLOT, PageTable } from "../../src/gpu/atlas/pagetable.ts";
import { random } from "./world.ts";

describe("PageTable", () => {
  it("R21: gives the slot of every tile of levels to 17 that it holds, and none for others", () => {
    const next = random(3);
    const table = new PageTable();
    for (let round = 0; round < 20; round += 1) {
      const held = new Map<string, { level: number; x: number; y: number; slot: number }>();
      while (held.size < 1024) {
        const level = Math.floor(next() * 18);
        const tile = {
          level,
          x: Math.floor(next() * 2 ** level),
          y: Math.floor(next() * 2 ** level),
          slot: held.size,
        };
        held.set(`${level}/${tile.x}/${tile.y}`, tile);
      }
      table.fill(held.values());
      for (const { level, x, y, slot } of held.values()) expect(table.slot(level, x, y)).toBe(slot);
      for (let i = 0; i < 500; i += 1) {
        const x = Math.floor(next() * 2 ** 17);
        const y = Math.floor(next() * 2 ** 17);
        if (!held.has(`17/${x}/${y}`)) expect(table.slot(17, x, y)).toBe(NO_SLOT);
      }
    }
  });

  it("R21: refuses more tiles than it was made for", () => {
    const many = Array.from({ length: 1025 }, (_, x) => ({ level: 17, x, y: 3, slot: x }));
    expect(() => new PageTable().fill(many)).toThrow(RangeError);
  });
});
