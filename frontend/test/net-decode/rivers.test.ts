/** Frames of rivers, by the vectors of the server (SPEC W30, W31). */

import { readFileSync } from "node:fs";
import { describe, expect, test } from "vitest";
import { RIVER_AREA_STEPS, RIVER_UNITS_PER_CELL } from "../../src/generated/contract.ts";
import { FrameDecoder, FrameError } from "../../src/net/decode.ts";
import { isRivers, RiverError, readRivers } from "../../src/net/rivers.ts";

interface Case {
  readonly name: string;
  readonly frame: string;
  readonly refused?: string;
  readonly clock: number;
  readonly level: number;
  readonly settled: boolean;
  readonly rivers: readonly { points: [number, number][]; areas: [number, number]; into: number | null }[];
}

const path = new URL("../../../tests/vectors/rivers.json", import.meta.url);
const { cases } = JSON.parse(readFileSync(path, "utf-8")) as { cases: Case[] };
const named = cases.map((c) => [c.name, c] as const);

function bytesOf(text: string): ArrayBuffer {
  return Uint8Array.from(Buffer.from(text, "base64")).buffer;
}

describe("frames of rivers", () => {
  test.each(named.filter(([, c]) => c.refused === undefined))("%s is read", (_, c) => {
    const found = readRivers(bytesOf(c.frame));
    expect([found.clock, found.level, found.settled]).toEqual([c.clock, c.level, c.settled]);
    expect(found.rivers.map((r) => [...r.cells])).toEqual(
      c.rivers.map((r) => r.points.flat().map((x) => x / RIVER_UNITS_PER_CELL)),
    );
    expect(found.rivers.map((r) => r.into)).toEqual(c.rivers.map((r) => r.into));
    expect(found.rivers.map((r) => r.areasM2)).toEqual(
      c.rivers.map((r) => r.areas.map((a) => 2 ** (a / RIVER_AREA_STEPS))),
    );
  });

  test.each(named.filter(([, c]) => c.refused !== undefined))("%s is refused", (_, c) => {
    expect(() => readRivers(bytesOf(c.frame))).toThrow(RiverError);
    expect(() => readRivers(bytesOf(c.frame))).toThrow(c.refused);
  });

  test("the decoder of tiles hands them on and keeps its tiles", () => {
    const decoder = new FrameDecoder();
    const buffer = bytesOf(cases[0]!.frame);
    expect(isRivers(buffer)).toBe(true);
    const frame = decoder.decode(buffer);
    expect(frame.rivers?.rivers.length).toBe(3);
    expect(frame.bytes).toBe(buffer.byteLength);
    expect(frame.tiles).toEqual([]);
    expect(() => decoder.decode(buffer.slice(0, -1))).toThrow(FrameError);
  });
});
