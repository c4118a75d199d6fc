import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { BadTarget, decode, encode } from "../../src/app/lesson/task/target.ts";
import type { Heights } from "../../src/core/difference.ts";
import { MAX_TARGET_CHARACTERS, type Target } from "../../src/generated/contract.ts";

interface Case {
  name: string;
  target: Target;
  heights: [row: number, col: number, z: number][] | null;
  sum?: number;
}

const { cases } = JSON.parse(readFileSync("../tests/vectors/targets.json", "utf8")) as { cases: Case[] };

/** Hills whose heights depend on nothing but their side. */
function hills(side: number, high = 300): Heights {
  const data = Float32Array.from({ length: side * side }, (_, i) => {
    const [x, y] = [(i % side) / (side - 1), Math.floor(i / side) / (side - 1)];
    return high * Math.sin(5 * x) * Math.cos(7 * y + x);
  });
  return { side, data };
}

describe("targets (SPEC L103, L104)", () => {
  it.each(cases)("$name", async ({ target, heights, sum }) => {
    if (heights === null) {
      await expect(decode(target)).rejects.toThrow(BadTarget);
      return;
    }
    const found = await decode(target);
    for (const [row, col, z] of heights) expect(found.data[row * found.side + col]).toBe(z);
    expect(found.data.reduce((a, b) => a + b, 0)).toBeCloseTo(sum!, 6);
  });

  it.each([65, 129, 257])("are their ground to half a step, %i samples a side", async (side) => {
    const ground = hills(side);
    const target = await encode(ground, 4096);
    const back = await decode(target);
    expect(back.side).toBe(side);
    const off = back.data.map((z, i) => Math.abs(z - ground.data[i]!)).reduce((a, b) => Math.max(a, b), 0);
    expect(off).toBeLessThanOrEqual(target.step_m * 0.501);
    expect(target.step_m).toBeCloseTo(hills(side).data.reduce((a, b) => Math.max(a, b), 0) / 1024, 0);
  });

  it("keep every second sample of rough ground", async () => {
    const side = 257;
    let seed = 1;
    const rough = Float32Array.from({ length: side * side }, () => {
      seed = (seed * 48271) % 2147483647;
      return seed / 2147483647;
    });
    const target = await encode({ side, data: rough }, 4096);
    expect([target.level, target.data.length <= MAX_TARGET_CHARACTERS]).toEqual([1, true]);
    expect((await decode(target)).data[1]).toBeCloseTo(rough[2]!, 2);
  });

  it("refuse ground that is none", async () => {
    await expect(encode({ side: 65, data: new Float32Array(65 * 65).fill(Number.NaN) }, 4096)).rejects.toThrow(
      BadTarget,
    );
    await expect(encode({ side: 64, data: new Float32Array(64 * 64) }, 4096)).rejects.toThrow(BadTarget);
  });

  it("do not unpack what is larger than their level", async () => {
    const bomb = new Response(
      new Blob([new Uint8Array(20_000_000)]).stream().pipeThrough(new CompressionStream("deflate")),
    );
    const data = Buffer.from(await bomb.arrayBuffer()).toString("base64");
    await expect(decode({ size_m: 1, level: 0, low_m: 0, step_m: 1, data })).rejects.toThrow("damaged");
  });
});
