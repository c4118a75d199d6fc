"""Adaptive binary arithmetic coding of a tile's residuals (DESIGN 6), twin of ``frontend/src/net/entropy.ts``.

Each residual is a few binary decisions: is it zero, its exponent in unary, its sign, its bits below the highest. A
decision is coded with a probability that is learnt, for each context, from the decisions before it in the same tile;
the context is how large the residuals of the neighbours were that are already known. Every step is exact integer
arithmetic, so that every implementation agrees; tiles are coded one by one, so that clients share them.

Sources: the carryless range coder is that of lpaq1 (M. Mahoney, 2007), counters that learn at 1 / (n + 3) are like
those of its state maps; contexts of neighbouring magnitudes follow CALIC (X. Wu and N. Memon, 1997).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel
from esker.contract import (
    CODER_LIMIT,
    CODER_MAX_BYTES,
    CODER_MAX_EXPONENT,
    CODER_NODES,
    CODER_PLACES,
    CODER_SIZES,
    CODER_SLOWEST,
    CODER_SURE,
    LATTICE_CLASSES,
    LATTICE_WEIGHTS,
    TILE_SAMPLES,
)

Bytes = NDArray[np.uint8]
Longs = NDArray[np.int64]

SIZES: Final = CODER_SIZES
PLACES: Final = CODER_PLACES
NODES: Final = CODER_NODES
MAX_EXPONENT: Final = CODER_MAX_EXPONENT
LIMIT: Final = CODER_LIMIT
MAX_BYTES: Final = CODER_MAX_BYTES
SURE: Final = CODER_SURE
SLOWEST: Final = CODER_SLOWEST

RATES: Final = np.floor(65536 / (np.arange(SLOWEST + 1) + 3) + 0.5).astype(np.int64)
WEIGHTS: Final = np.array(LATTICE_WEIGHTS.split(), dtype=np.int64).reshape(LATTICE_CLASSES, 3, 10)


@kernel
def size_class(total: int) -> int:
    """Returns the class of a size: 0 for 0, then two classes an octave, SIZES - 1 at most."""
    if total <= 0:
        return 0
    exponent = 0
    while total >> (exponent + 1):
        exponent += 1
    half = (total >> (exponent - 1)) & 1 if exponent else 0
    return min(1 + 2 * exponent + half, SIZES - 1)


@kernel
def surroundings(known: Longs, row: int, col: int, lattice: bool, weights: Longs, out: Longs) -> None:
    """Describes the known residuals around a place:

    ``out`` = place, class of size, expected residual. ``known``: (67, 69) int64, the tile with two rows to the south,
    two columns to the west and east, of zeros.
    """
    r, c = row + 2, col + 2
    w, n, nw, ne = known[r, c - 1], known[r - 1, c], known[r - 1, c - 1], known[r - 1, c + 1]
    ww, nn = known[r, c - 2], known[r - 2, c]
    if not lattice:
        out[0] = out[2] = 0
        out[1] = size_class(2 * abs(w) + 2 * abs(n) + abs(nw) + abs(ne) + abs(ww) + abs(nn))
        return
    place = 1 + 2 * (row & 1) + (col & 1)
    out[0], out[1], out[2] = place, 0, 0
    if place == 1:  # on a sample of the parent only rounding is left
        return
    if place == 2:
        total = 3 * abs(n) + 2 * abs(ww) + abs(nn) + abs(nw) + abs(ne)
    elif place == 3:
        total = 3 * abs(w) + abs(nw) + abs(ne) + abs(nn) + abs(ww)
    else:
        total = 3 * abs(w) + 3 * abs(n) + abs(ww) + abs(nn)
    out[1] = size_class(total)
    k = weights[min(out[1], LATTICE_CLASSES - 1), place - 2]
    far = (
        k[6] * known[r - 1, c - 2]
        + k[7] * known[r - 2, c - 1]
        + k[8] * known[r - 2, c + 1]
        + k[9] * known[r - 1, c + 2]
    )
    out[2] = (k[0] * w + k[1] * n + k[2] * nw + k[3] * ne + k[4] * ww + k[5] * nn + far + 32) >> 6


@kernel
def learn(odds: Longs, seen: Longs, at: int, bit: int, rates: Longs) -> None:
    """Moves the probability of a 1 in a context towards what was seen."""
    odds[at] += ((65535 * bit - odds[at]) * rates[seen[at]]) >> 16
    if seen[at] < SLOWEST:
        seen[at] += 1


@kernel
def put_bit(out: Bytes, state: Longs, bit: int, odds: int) -> None:
    """Codes one decision. ``state``: low and high end of the range, bytes written. ``odds``: of a 1, of 65,536."""
    low, high = state[0], state[1]
    middle = low + (((high - low) * min(max(odds, SURE), 65536 - SURE)) >> 16)
    if bit:
        high = middle
    else:
        low = middle + 1
    while (low ^ high) & 0xFF000000 == 0:
        out[state[2]] = high >> 24
        state[2] += 1
        low = (low << 8) & 0xFFFFFFFF
        high = ((high << 8) & 0xFFFFFFFF) | 255
    state[0], state[1] = low, high


@kernel
def get_bit(data: Bytes, state: Longs, odds: int) -> int:
    """Decodes one decision. ``state``: low and high end of the range, bytes read, the number in between."""
    low, high, code = state[0], state[1], state[3]
    middle = low + (((high - low) * min(max(odds, SURE), 65536 - SURE)) >> 16)
    bit = 1 if code <= middle else 0
    if bit:
        high = middle
    else:
        low = middle + 1
    while (low ^ high) & 0xFF000000 == 0:
        low = (low << 8) & 0xFFFFFFFF
        high = ((high << 8) & 0xFFFFFFFF) | 255
        following = data[state[2]] if state[2] < data.size else 0
        code = ((code << 8) & 0xFFFFFFFF) | following
        state[2] += 1
    state[0], state[1], state[3] = low, high, code
    return bit


@kernel
def _encode(residual: Longs, lattice: bool, weights: Longs, rates: Longs, out: Bytes) -> int:
    known = np.zeros((67, 69), dtype=np.int64)
    odds = np.full(PLACES * SIZES * NODES, 32768, dtype=np.int64)
    seen = np.zeros(PLACES * SIZES * NODES, dtype=np.int64)
    around = np.zeros(3, dtype=np.int64)
    state = np.array([0, 0xFFFFFFFF, 0], dtype=np.int64)
    for row in range(65):
        for col in range(65):
            surroundings(known, row, col, lattice, weights, around)
            first = (around[0] * SIZES + around[1]) * NODES
            value = residual[row, col] - around[2]
            size = abs(value)
            if size >= LIMIT or abs(residual[row, col]) >= LIMIT:
                return -1
            put_bit(out, state, 1 if size else 0, odds[first])
            learn(odds, seen, first, 1 if size else 0, rates)
            if size:
                exponent = 0
                while size >> (exponent + 1):
                    exponent += 1
                for i in range(min(exponent + 1, MAX_EXPONENT)):
                    more = 1 if i < exponent else 0
                    put_bit(out, state, more, odds[first + 2 + i])
                    learn(odds, seen, first + 2 + i, more, rates)
                negative = 1 if value < 0 else 0
                put_bit(out, state, negative, odds[first + 1])
                learn(odds, seen, first + 1, negative, rates)
                if exponent:
                    second, at = (size >> (exponent - 1)) & 1, first + 36 + min(exponent, 11)
                    put_bit(out, state, second, odds[at])
                    learn(odds, seen, at, second, rates)
                    for i in range(exponent - 2, -1, -1):
                        put_bit(out, state, (size >> i) & 1, 32768)
            known[row + 2, col + 2] = residual[row, col]
    # The shortest number in the range; the decoder reads zeros after it.
    for length in range(5):
        unit = 1 << (8 * (4 - length))
        number = (state[0] + unit - 1) // unit * unit
        if number <= state[1]:
            for i in range(length):
                out[state[2] + i] = (number >> (24 - 8 * i)) & 255
            return int(state[2]) + length
    return -1


@kernel
def _decode(data: Bytes, lattice: bool, weights: Longs, rates: Longs, known: Longs) -> int:
    odds = np.full(PLACES * SIZES * NODES, 32768, dtype=np.int64)
    seen = np.zeros(PLACES * SIZES * NODES, dtype=np.int64)
    around = np.zeros(3, dtype=np.int64)
    state = np.array([0, 0xFFFFFFFF, 4, 0], dtype=np.int64)
    for i in range(4):
        state[3] = (state[3] << 8) | (data[i] if i < data.size else 0)
    for row in range(65):
        for col in range(65):
            surroundings(known, row, col, lattice, weights, around)
            first = (around[0] * SIZES + around[1]) * NODES
            value = 0
            bit = get_bit(data, state, odds[first])
            learn(odds, seen, first, bit, rates)
            if bit:
                exponent = 0
                while exponent < MAX_EXPONENT:
                    at = first + 2 + exponent
                    bit = get_bit(data, state, odds[at])
                    learn(odds, seen, at, bit, rates)
                    if not bit:
                        break
                    exponent += 1
                negative = get_bit(data, state, odds[first + 1])
                learn(odds, seen, first + 1, negative, rates)
                size = 1
                if exponent:
                    at = first + 36 + min(exponent, 11)
                    bit = get_bit(data, state, odds[at])
                    learn(odds, seen, at, bit, rates)
                    size = 2 + bit
                    for _ in range(exponent - 1):
                        size = 2 * size + get_bit(data, state, 32768)
                value = -size if negative else size
            value += around[2]
            if abs(value) >= LIMIT:
                return -1
            known[row + 2, col + 2] = value
    return int(state[2])


@kernel
def _cost(residual: Longs, logs: NDArray[np.float32]) -> float:
    """Returns ``payload.cost`` of a residual; infinity where a number is too large to be coded."""
    total = 0.0
    for r in range(residual.shape[0]):
        for k in range(residual.shape[1]):
            size = abs(residual[r, k])
            if size >= LIMIT >> 1:
                return np.inf
            total += logs[size] if size < logs.size else np.log2(np.float32(size + 1))
    return total


@kernel
def encode_cheapest(
    now: Longs,
    own: Longs,
    before: Longs,
    then: Longs,
    known: int,
    most_shift: int,
    logs: NDArray[np.float32],
    weights: Longs,
    rates: Longs,
    plain: Bytes,
    lattice: Bytes,
    few: int,
) -> tuple[int, int, int, int]:
    """Returns a predictor, its shift, and the bytes written of ``plain`` and ``lattice``; predictor -1: none will do.

    Where ``plain`` takes no more than ``few`` bytes ``lattice`` is not tried, -1.

    This function is here, and not where it is called (``coding.code``): compiled code that is kept is made anew when
    the text of its own file changes, not that of others.

    ``own``, ``then``: the parent's prediction, now and as it was for ``before``; ``known``: how many of ``before`` and
    ``then`` there are.
    """
    best, least, chosen = now - own, np.inf, -1
    for option in range(1 + known):
        if option == 0:
            residual = now - own
        elif option == 1:
            residual = now - before
        else:
            residual = now - before - (own - then)
        cost = _cost(residual, logs)
        if cost < least:
            best, least, chosen = residual, cost, option
    bits = np.int64(0)
    for value in best.flat:
        bits |= value
    if chosen < 0 or bits == 0:
        return chosen, 0, 0, 0
    shift = 0
    while shift < most_shift and not (bits >> shift) & 1:
        shift += 1
    best = best >> shift
    size = _encode(best, False, weights, rates, plain)
    small = -1 if 0 <= size <= few else _encode(best, True, weights, rates, lattice)
    return chosen, shift, size, small


def encode(residual: NDArray[np.signedinteger], lattice: bool = False) -> bytes | None:
    """Codes (65, 65) integers below 2^32; None where a number does not fit.

    ``lattice``: the residual of a prediction from the parent: samples of the parent, and those between, differ.
    """
    out = np.empty(MAX_BYTES, dtype=np.uint8)
    size = _encode(np.ascontiguousarray(residual, dtype=np.int64), lattice, WEIGHTS, RATES, out)
    return out[:size].tobytes() if size >= 0 else None


def decode(data: bytes | memoryview, lattice: bool = False) -> Longs | None:
    """Inverse of ``encode``, (65, 65) int64; None for what no encoder writes: larger numbers, or bytes left over."""
    known = np.zeros((67, 69), dtype=np.int64)
    read = _decode(np.frombuffer(data, dtype=np.uint8), lattice, WEIGHTS, RATES, known)
    return known[2:, 2 : 2 + TILE_SAMPLES].copy() if len(data) <= read else None
