/** SPEC T55: the ends of what is coded; `tests/property/test_tiles_codec.py` has the same bytes. */

import { expect, test } from "vitest";
import { decodeResiduals } from "../../src/net/entropy.ts";

const CERTAIN = "2108586533084bc973db6cd071e9967bbd1f1bca0a7de8690963ef378eb1";
const LARGEST = "00000000800000000000000000000000ffffff02";
const TOO_LARGE =
  "0000000080000000000000033ffffffd555000115577ffffffc36bee5b2f53af9fc36bec011fbf5ef86d7e980282c800002b721fc9fff64ba6e7" +
  "2777ee57c5bfdfdb03675c8d0b97fffffb";

function decoded(payload: string, lattice = false): Float64Array | null {
  const out = new Float64Array(65 * 65);
  return decodeResiduals(Buffer.from(payload, "hex"), lattice, out) ? out : null;
}

test("decisions that always fall the same way, both ways", () => {
  expect(decoded(CERTAIN)!.every((value) => value === -3)).toBe(true);
});

test("the largest numbers, and none that is larger", () => {
  const found = decoded(LARGEST)!;
  expect([...found.subarray(0, 3)]).toEqual([2 ** 32 - 1, 1 - 2 ** 32, 0]);
  expect(decoded(TOO_LARGE, true)).toBeNull();
});

test("bytes that the decoder does not read", () => {
  expect(decoded(`${CERTAIN}000000`)).not.toBeNull();
  expect(decoded(`${CERTAIN}00000000`)).toBeNull();
});
