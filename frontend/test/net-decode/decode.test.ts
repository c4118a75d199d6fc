/** SPEC T1, T4, T5, T6: frames decode exactly, and what is malformed is refused whole. */

import { createHash } from "node:crypto";
import fc from "fast-check";
import { describe, expect, test } from "vitest";
import { FrameDecoder, FrameError } from "../../src/net/decode.ts";
import { bytesOf, vectors } from "./vectors.ts";

function sha256(samples: Int32Array): string {
  return createHash("sha256").update(new Uint8Array(samples.buffer)).digest("hex");
}

/** A decoder after the first two frames of the shared session: what the malformed frames are applied to. */
function opened(): FrameDecoder {
  const decoder = new FrameDecoder();
  for (const step of vectors.sessions[0]!.steps.slice(0, 2)) decoder.decode(bytesOf(step.frame));
  return decoder;
}

describe("shared vectors", () => {
  test.each(vectors.sessions.map((s) => [s.name, s] as const))("%s decodes as in Python (T4)", (_name, session) => {
    const decoder = new FrameDecoder();
    for (const { frame, decoded } of session.steps) {
      const buffer = bytesOf(frame);
      const out = decoder.decode(buffer);
      const { kind, level, clock, settled } = out;
      expect({
        kind,
        level,
        clock,
        settled,
        drops: out.drops.map((d) => [d.x, d.y]),
        held: decoder.sizeOf(out.channel),
      }).toEqual({
        kind: decoded.kind,
        level: decoded.level,
        clock: decoded.clock,
        settled: decoded.settled,
        drops: decoded.drops,
        held: decoded.held,
      });
      expect(out.bytes).toBe(buffer.byteLength);
      const tiles = out.tiles.map((t) => ({
        x: t.x,
        y: t.y,
        version: t.version,
        samples: sha256(t.samples),
        corners: [0, 64, 64 * 65, 65 * 65 - 1].map((i) => t.samples[i]),
        sub_min: [...t.subMin],
        sub_max: [...t.subMax],
        sub_error: [...t.subError],
      }));
      expect(tiles).toEqual(decoded.tiles);
    }
  });

  test.each(vectors.malformed.map((m) => [m.name, m.frame] as const))("refuses: %s (T6)", (_name, frame) => {
    const decoder = opened();
    expect(() => decoder.decode(bytesOf(frame))).toThrow(FrameError);
    expect(decoder.size).toBe(5);
  });
});

describe("robustness (T6)", () => {
  const steps = vectors.sessions[0]!.steps;
  const good = bytesOf(steps[2]!.frame);

  test("every truncation of a frame is refused and leaves the decoder able to go on", () => {
    fc.assert(
      fc.property(fc.integer({ min: 0, max: good.byteLength - 1 }), (length) => {
        const decoder = opened();
        expect(() => decoder.decode(good.slice(0, length))).toThrow(FrameError);
        expect(decoder.decode(good).tiles.length).toBe(16);
      }),
      { numRuns: 30 },
    );
  });

  test("damaged bytes either decode or raise FrameError, nothing else", () => {
    const damage = fc.array(fc.tuple(fc.nat(good.byteLength - 1), fc.nat(255)), { minLength: 1, maxLength: 6 });
    fc.assert(
      fc.property(damage, (edits) => {
        const bytes = new Uint8Array(good.slice(0));
        for (const [at, value] of edits) bytes[at] = value;
        try {
          opened().decode(bytes.buffer);
        } catch (e) {
          expect(e).toBeInstanceOf(FrameError);
        }
      }),
      { numRuns: 80 },
    );
  });

  test("garbage after a valid header is refused", () => {
    fc.assert(
      fc.property(fc.uint8Array({ minLength: 1, maxLength: 400 }), (tail) => {
        const bytes = new Uint8Array(16 + tail.length);
        bytes.set(new Uint8Array(good, 0, 16));
        bytes.set(tail, 16);
        expect(() => opened().decode(bytes.buffer)).toThrow(FrameError);
      }),
    );
  });

  test("reset forgets what was held", () => {
    const decoder = opened();
    decoder.reset();
    expect(decoder.size).toBe(0);
    expect(() => decoder.decode(bytesOf(steps[1]!.frame))).toThrow(/not held/);
  });
});
