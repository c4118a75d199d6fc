// Who follows water, as others see it (spec W56); the tool's findings (spec W49, W50).

import { describe, expect, it } from "vitest";
import { fieldOf } from "../../src/app/view/water/field.ts";
import { floodOf, sampleAt, shedOf, wayFrom } from "../../src/app/view/water/findings.ts";
import { otherDrops } from "../../src/app/view/water/others.ts";
import { endWords, floodWords, flowWords, hourWords } from "../../src/app/view/water/words.ts";
import type { Member, MemberPresence } from "../../src/generated/contract.ts";

const member = (client: string): Member => ({ client, name: client, colour: "#3366cc", role: "edit" }) as Member;
const presence = (client: string, tool: string, cursor: [number, number, number] | null): MemberPresence =>
  ({ client, tool, cursor, stroke: null, eye: null, target: null }) as MemberPresence;

describe("others", () => {
  it("who follow water are seen at their place; nobody else is, nor am I", () => {
    const members = ["me", "ada", "ben", "cem"].map(member);
    const presences = new Map(
      [
        presence("me", "water", [1, 2, 3]),
        presence("ada", "water", [10, 20, 5]),
        presence("ben", "mountain", [30, 40, 5]),
        presence("cem", "water", null),
      ].map((p) => [p.client, p]),
    );
    const found = otherDrops({ members, presences, me: "me", myColour: "#000000" });
    expect(found.map(({ place }) => place)).toEqual([[10, 20]]);
    expect(found[0]!.colour[2]).toBeGreaterThan(found[0]!.colour[0]);
  });
});

describe("findings", () => {
  const side = 65;
  const cell = 10;
  // A bowl 200 m wide and 40 m deep in a slope to the south.
  const heights = Float32Array.from({ length: side * side }, (_, i) => {
    const [x, y] = [(i % side) * cell, Math.floor(i / side) * cell];
    const away = Math.hypot(x - 320, y - 320);
    return 100 + y / 5 + Math.abs(x - 320) / 50 - Math.max(0, 60 - 0.6 * away);
  });
  const field = fieldOf(heights, side, 640, null)!;
  const bowl = sampleAt(field, [320, 320]);

  it("tell a way through the lake over the border, and a watershed as large as its samples", () => {
    const above = sampleAt(field, [320, 560]);
    const way = wayFrom(field, above);
    expect(way.ends).toBe("border");
    expect(way.lakes).toBe(1);
    expect(way.points.at(-1)![1]).toBe(0);
    expect(endWords(way)).toBe("through a lake over the border");
    const shed = shedOf(field, bowl);
    expect(shed.inside.reduce((a, b) => a + b, 0)).toBe(shed.samples);
    expect(shed.areaM2).toBe(shed.samples * 100);
  });

  it("pour out rain on what drains through the brim, all of it accounted for", () => {
    const flood = floodOf(field, bowl, { by: "rain", mm: 300, m3: 0 });
    expect(flood.pouredM3).toBeCloseTo(0.3 * flood.shedM2, 6);
    const held = flood.lakes.reduce((sum, lake) => sum + lake.volumeM3, 0);
    expect(held + flood.runsOffM3).toBeCloseTo(flood.pouredM3, 3);
    expect(floodWords(flood)).toMatch(/^The lake stands at/);
    const more = floodOf(field, bowl, { by: "volume", mm: 0, m3: 1e9 });
    expect(more.runsOffM3).toBeGreaterThan(0);
    expect(floodWords(more)).toMatch(/It runs over/);
    expect(more.lakes[0]!.levelM).toBeGreaterThan(flood.lakes[0]!.levelM);
  });

  it("say that nothing is held where water runs off", () => {
    const flood = floodOf(field, sampleAt(field, [320, 20]), { by: "volume", mm: 0, m3: 500 });
    expect(flood.lakes).toEqual([]);
    expect(flood.runsOffM3).toBeCloseTo(500, 6);
    expect(floodWords(flood)).toMatch(/runs off/);
  });

  it("are none on ground that is no ground", () => {
    expect(fieldOf(new Float32Array(9).fill(Number.NaN), 3, 640, null)).toBeNull();
  });

  it("have words for numbers", () => {
    expect([flowWords(0), flowWords(0.0421), flowWords(4.2), flowWords(123.4)]).toEqual([
      "0 m³/s",
      "0.042 m³/s",
      "4.20 m³/s",
      "123 m³/s",
    ]);
    expect([hourWords(0), hourWords(600), hourWords(7200)]).toEqual(["0 h", "10 min", "2.0 h"]);
  });
});
