"""Samples of bases above the global levels, by squares, kept between steps of refinement (DESIGN 5.6).

Windows of refinement overlap by their halos, and a base stays as it is while strokes come and go. Which squares were
kept changes no bit: a base has the same samples in any window. Their digests make a tile's content local: a layer added
elsewhere leaves it alone.
"""

from __future__ import annotations

from collections import OrderedDict
from hashlib import blake2b
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.solve.base import Base

BLOCK: Final = 128
"""Samples along a side of a square."""
BLOCKS_BYTES: Final = 32 << 20
DIGEST_BYTES: Final = 16

Bounds = tuple[int, int, int, int]
"""Rows r0 .. r1 - 1 and columns c0 .. c1 - 1 as (r0, r1, c0, c1)."""


class BlockCache:
    """Squares of all bases and levels, least recently used dropped first."""

    def __init__(self, bytes_: int = BLOCKS_BYTES) -> None:
        self.most = max(1, bytes_ // (4 * BLOCK * BLOCK))
        self._held: OrderedDict[tuple[bytes, int, int, int], tuple[NDArray[np.float32], bytes]] = OrderedDict()

    def __len__(self) -> int:
        return len(self._held)

    def get(self, base: Base, level: int, row: int, column: int) -> tuple[NDArray[np.float32], bytes]:
        """Samples of a square, as far as the level goes, and their digest."""
        key = base.digest, level, row, column
        found = self._held.get(key)
        if found is None:
            n = grid.samples(level)
            rows, columns = (slice(k * BLOCK, min((k + 1) * BLOCK, n)) for k in (row, column))
            samples = base.window(level, rows, columns)
            found = samples, blake2b(np.ascontiguousarray(samples).tobytes(), digest_size=DIGEST_BYTES).digest()
            self._held[key] = found
            while len(self._held) > self.most:
                self._held.popitem(last=False)
        self._held.move_to_end(key)
        return found

    def clear(self) -> None:
        """Drop everything."""
        self._held.clear()


class BaseWindows:
    """Any windows of one base at any level."""

    def __init__(self, base: Base, cache: BlockCache) -> None:
        self.base, self._cache = base, cache
        self._digests: dict[tuple[int, Bounds], bytes] = {}

    def window(self, level: int, bounds: Bounds) -> NDArray[np.float32]:
        """The samples of a window that lies within the level, float32, metres."""
        r0, r1, c0, c1 = bounds
        out = np.empty((r1 - r0, c1 - c0), dtype=np.float32)
        for row in range(r0 // BLOCK, (r1 - 1) // BLOCK + 1):
            for column in range(c0 // BLOCK, (c1 - 1) // BLOCK + 1):
                samples, _ = self._cache.get(self.base, level, row, column)
                y, x = row * BLOCK, column * BLOCK
                a, b, c, d = max(r0, y), min(r1, y + BLOCK), max(c0, x), min(c1, x + BLOCK)
                out[a - r0 : b - r0, c - c0 : d - c0] = samples[a - y : b - y, c - x : d - x]
        return out

    def digest(self, level: int, bounds: Bounds) -> bytes:
        """Digest of the squares that hold a window: equal ones mean the same samples in it."""
        r0, r1, c0, c1 = bounds
        squares = r0 // BLOCK, (r1 - 1) // BLOCK, c0 // BLOCK, (c1 - 1) // BLOCK
        known = self._digests.get((level, squares))
        if known is None:
            out = blake2b(digest_size=DIGEST_BYTES)
            for row in range(squares[0], squares[1] + 1):
                for column in range(squares[2], squares[3] + 1):
                    out.update(self._cache.get(self.base, level, row, column)[1])
            known = self._digests[level, squares] = out.digest()
        return known
