"""Compiled loops for what is done with every sample of a level that is put (DESIGN 6, 7).

They let go of the interpreter's lock, so the solver's thread and the event loop go on beside them. Each does, to the
bit, what its NumPy twin does: ``stabiliser.steadied``, ``pyramid.quantise``, ``pyramid.follow_parents``,
``bounds.SubPatches``, ``payload.upsampled``. They are compiled at their first call and kept on disk where a disk allows
it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel

Ints = NDArray[np.int32]
Wide = NDArray[np.signedinteger]
Floats = NDArray[np.float32]


@kernel
def steadied(heights: Floats, settled: Floats, correction: Floats, out: Floats) -> None:
    """Computes ``stabiliser.steadied`` of whole levels, (n, n) float32 each."""
    rows, cols = heights.shape
    for r in range(rows):
        for k in range(cols):
            h = heights[r, k]
            c = correction[r, k]
            left = max(abs(c) - abs(h - (settled[r, k] - c)), np.float32(0))
            out[r, k] = np.copysign(left, c) + h


@kernel
def finite(heights: Floats) -> bool:
    """Returns whether all of (n, m) float32 are finite: infinities and NaN have the largest exponent."""
    bits = heights.view(np.int32)
    most = np.int32(0)
    for r in range(bits.shape[0]):
        for k in range(bits.shape[1]):
            most = max(most, bits[r, k] & np.int32(0x7FFFFFFF))
    return bool(most < np.int32(0x7F800000))


@kernel
def quantised(heights: Floats, kept: Ints, scale: np.float32, quanta: int, limit: np.float32, out: Ints) -> None:
    """``pyramid.quantise`` of ``heights`` with ``kept``, (n, n).

    scale: quanta a metre; quanta: its ``step``; limit: largest |sample|.
    """
    rows, cols = heights.shape
    whole, most = np.float32(quanta), np.int64(limit)
    for r in range(rows):
        for k in range(cols):
            away = min(max(heights[r, k] * scale, -limit), limit) - np.float32(kept[r, k])
            value = np.int64(kept[r, k])
            if abs(away) >= whole:
                value = min(max(value + np.int64(np.rint(away / whole)) * quanta, -most), most)
            out[r, k] = value


@kernel
def changed(new: Ints, old: Ints, cells: int, out: NDArray[np.bool_]) -> None:
    """Finds the closed blocks of ``cells`` + 1 samples a side that hold a sample that differs; out: (m, n) of False.

    Most rows of a put are as they were, so each row is looked at as a whole first.
    """
    rows, cols = out.shape
    for r in range(new.shape[0]):
        whole = np.int32(0)
        for k in range(new.shape[1]):
            whole |= new[r, k] ^ old[r, k]
        if whole == 0:
            continue
        first, last = max((r - 1) // cells, 0), min(r // cells, rows - 1)
        for b in range(cols):
            differs = np.int32(0)
            for k in range(b * cells, (b + 1) * cells + 1):
                differs |= new[r, k] ^ old[r, k]
            if differs != 0:
                out[first, b] = True
                out[last, b] = True


@kernel
def predicted(tile: Wide, shift: int, out: Wide) -> None:
    """Computes ``payload.predict`` of one tile, (n, n) into (2n - 1, 2n - 1) of the same dtype, wide enough for the
    sums."""
    n = tile.shape[0]
    wide = 2 * n - 1
    half = 1 << (shift - 1)
    across = np.empty((n, wide), dtype=tile.dtype)
    for r in range(n):
        for k in range(n):
            across[r, 2 * k] = 16 * tile[r, k]
        across[r, 1] = 5 * tile[r, 0] + 15 * tile[r, 1] - 5 * tile[r, 2] + tile[r, 3]
        across[r, wide - 2] = 5 * tile[r, n - 1] + 15 * tile[r, n - 2] - 5 * tile[r, n - 3] + tile[r, n - 4]
        for k in range(1, n - 2):
            across[r, 2 * k + 1] = 9 * (tile[r, k] + tile[r, k + 1]) - tile[r, k - 1] - tile[r, k + 2]
    for r in range(n):
        for k in range(wide):
            out[2 * r, k] = (16 * across[r, k] + half) >> shift
    for k in range(wide):
        first = 5 * across[0, k] + 15 * across[1, k] - 5 * across[2, k] + across[3, k]
        last = 5 * across[n - 1, k] + 15 * across[n - 2, k] - 5 * across[n - 3, k] + across[n - 4, k]
        out[1, k], out[wide - 2, k] = (first + half) >> shift, (last + half) >> shift
    for r in range(1, n - 2):
        for k in range(wide):
            inner = 9 * (across[r, k] + across[r + 1, k]) - across[r - 1, k] - across[r + 2, k]
            out[2 * r + 1, k] = (inner + half) >> shift


@kernel
def _equal(a: Ints, b: Ints) -> bool:
    """Whether two arrays of one shape hold the same: NumPy's own takes five times as long to compile."""
    for r in range(a.shape[0]):
        for k in range(a.shape[1]):
            if a[r, k] != b[r, k]:
                return False
    return True


@kernel
def followed(
    samples: Ints, then: Ints, now: Ints, tiles: NDArray[np.int64], cells: int, shift: int, limit: int, out: Ints
) -> None:
    """``pyramid.follow_parents``: moves ``out``, a copy of ``samples``, along with the tiles (y, x) of its parent."""
    before = np.empty((2 * cells + 1, 2 * cells + 1), dtype=np.int64)
    after = np.empty_like(before)
    for t in range(tiles.shape[0]):
        y, x = tiles[t, 0] * cells, tiles[t, 1] * cells
        a, b = then[y : y + cells + 1, x : x + cells + 1], now[y : y + cells + 1, x : x + cells + 1]
        if _equal(a, b):
            continue
        predicted(a.astype(np.int64), shift, before)
        predicted(b.astype(np.int64), shift, after)
        for r in range(2 * cells + 1):
            for k in range(2 * cells + 1):
                moved = samples[2 * y + r, 2 * x + k] + after[r, k] - before[r, k]
                out[2 * y + r, 2 * x + k] = min(max(moved, -limit), limit)


@kernel
def bounded(samples: Ints, cells: int, low: Ints, high: Ints) -> None:
    """Finds the lowest and highest sample of closed blocks of ``cells`` + 1 samples a side; low, high: (m, n)."""
    for i in range(low.shape[0]):
        for j in range(low.shape[1]):
            least, most = samples[i * cells, j * cells], samples[i * cells, j * cells]
            for r in range(i * cells, (i + 1) * cells + 1):
                for k in range(j * cells, (j + 1) * cells + 1):
                    least, most = min(least, samples[r, k]), max(most, samples[r, k])
            low[i, j], high[i, j] = least, most


@kernel
def erred(samples: Ints, parent: Ints, cells: int, out: NDArray[np.uint32]) -> None:
    """``bounds.sub_error``: largest distance to the parent's surface per block of ``cells`` (even); (m, n)."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            worst = 0
            for r in range(i * cells, (i + 1) * cells + 1):
                up, down = r >> 1, (r + 1) >> 1
                for k in range(j * cells, (j + 1) * cells + 1):
                    left, right = k >> 1, (k + 1) >> 1
                    # the mean of a cell's four corners; on an edge two of them are the same, at a sample all four
                    corners = parent[up, left] + parent[down, right] + parent[up, right] + parent[down, left]
                    worst = max(worst, abs(2 * samples[r, k] - corners))
            out[i, j] = (worst + 1) >> 1
