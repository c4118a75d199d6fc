"""Noise from an integer hash of the global sample index: the same bits on every device (docs/synthesis.md, "Noise").

The mixer is the one of C. Wellons' ``lowbias32`` (public domain): two rounds of xor-shift and multiplication, all in
wrapping uint32.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike, NDArray

from esker.contract.fractal import HASH_MULTIPLIER_1, HASH_MULTIPLIER_2, HASH_STEP, HASH_STREAMS

Words = NDArray[np.uint32]


def mix(x: Words) -> Words:
    """uint32 to uint32, a bijection in which every input bit moves about half of the output bits."""
    x = x ^ (x >> np.uint32(16))
    x = x * np.uint32(HASH_MULTIPLIER_1)
    x = x ^ (x >> np.uint32(15))
    x = x * np.uint32(HASH_MULTIPLIER_2)
    return x ^ (x >> np.uint32(16))


def hashed(seed: int, level: int, stream: int, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> Words:
    """H(level, stream, i, j) of every sample of a grid: (len(rows), len(cols)) uint32.

    ``rows``, ``cols``: global sample indices j and i on the level, also negative ones (they wrap to uint32).
    """
    start = np.full(1, (seed + HASH_STEP * (HASH_STREAMS * level + stream)) & 0xFFFFFFFF, dtype=np.uint32)
    by_row = mix(mix(start) + (rows & 0xFFFFFFFF).astype(np.uint32))
    return mix(by_row[:, None] + (cols & 0xFFFFFFFF).astype(np.uint32)[None, :])


def full(words: Words, dtype: DTypeLike) -> NDArray[np.floating]:
    """Uniform in [-1, 1), shaped like the words: 24 bits of each, exact in float32."""
    return (words >> np.uint32(8)).astype(dtype) * 2.0**-23 - 1.0


def low(words: Words, dtype: DTypeLike) -> NDArray[np.floating]:
    """Uniform in (-1, 1) and symmetric, shaped like the words: the low half of each, exact in float32."""
    return (words & np.uint32(0xFFFF)).astype(dtype) * 2.0**-15 - (1.0 - 2.0**-16)


def high(words: Words, dtype: DTypeLike) -> NDArray[np.floating]:
    """Uniform in (-1, 1) and symmetric, from the high half of each word."""
    return (words >> np.uint32(16)).astype(dtype) * 2.0**-15 - (1.0 - 2.0**-16)
