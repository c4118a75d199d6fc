"""Measuring the patches of one layer against the samples of another (DESIGN 11: data that became stale; compiled)."""

from __future__ import annotations

import functools
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import bands, kernel, spread
from esker.patchwork.lod.layer_patches import LayerPatches, composed, inverse, reached
from esker.patchwork.raster import patches
from esker.patchwork.raster.errors import NO_WARP, Heights, farthest, segment
from esker.patchwork.raster.patches import Floats
from esker.patchwork.raster.samples import cut

NONE = -1.0
"""The distance of a patch that no sample lies in."""
BLOCK: Final = 16
"""Samples along a side of a block whose bounds are known."""
MOST_CELLS: Final = 8.0
"""Cells of a patch that a block may be wide so that it is worth while to ask for its bounds."""


class Blocks(NamedTuple):
    """Bounds of the valid samples in blocks of BLOCK x BLOCK, in the grid's unit; [0, 0] is block [row, col]."""

    row: int
    col: int
    low: Heights
    high: Heights


@kernel
def _narrowed(rise: float, start: float, extent: float, slip: float, low: float, high: float) -> tuple[float, float]:
    """The part of low..high where -slip <= start + rise t <= extent + slip."""
    if rise == 0.0:
        if start < -slip or start > extent + slip:
            return 1.0, 0.0
        return low, high
    a, b = (-slip - start) / rise, (extent + slip - start) / rise
    return max(low, min(a, b)), min(high, max(a, b))


@kernel
def _bounds(heights: Heights, row0: int, col0: int, low: Heights, high: Heights, start: int, stop: int) -> None:
    """Least and greatest valid sample of blocks start..stop (rows of them), [row0, col0] the first sample of the first;
    infinity and minus infinity where there is none."""
    rows, cols = heights.shape
    for bj in range(start, stop):
        low[bj], high[bj] = np.inf, -np.inf
        for row in range(row0 + bj * BLOCK, min(row0 + (bj + 1) * BLOCK, rows)):
            for col in range(col0, min(col0 + low.shape[1] * BLOCK, cols)):
                value, bi = heights[row, col], (col - col0) // BLOCK
                if value < low[bj, bi]:
                    low[bj, bi] = value
                if value > high[bj, bi]:
                    high[bj, bi] = value


@kernel
def _distances(
    mip: Heights,
    first: NDArray[np.int64],
    side: int,
    to_patch: Floats,
    extent: Floats,
    gain: Floats,
    heights: Heights,
    warp: Floats,
    sway: float,
    blocks: Blocks,
    parts: int,
    out: Floats,
    start: int,
    stop: int,
) -> None:
    """Greatest distance of the samples of ``heights`` in the domains of patches, each in ``parts`` bands of rows.

    ``first`` (n, 2): row and column of a patch in ``mip``; ``to_patch`` (n, 2, 3): lattice of ``heights`` to patch;
    ``gain``: scale and lift of the patches, scale and lift of the samples. ``out[p * parts + band]``.
    """
    rows = len(heights)
    block = np.empty((side, side), np.float32)
    metres = np.empty((side, side))
    for work in range(start, stop):
        p = work // parts
        m, eu, ev = to_patch[p], extent[p, 0], extent[p, 1]
        low, high = _rows_of(m, eu, ev)
        top, end = max(0, int(np.ceil(low - sway))), min(rows, int(np.floor(high + sway)) + 1)
        out[work] = -1.0
        if top >= end:
            continue
        cut(mip, first[p, 0], first[p, 1], block, False)
        for r in range(side):
            for c in range(side):
                metres[r, c] = gain[0] * block[r, c] + gain[1]
        band = work % parts
        start_row, stop_row = top + (end - top) * band // parts, top + (end - top) * (band + 1) // parts
        fine = max(abs(m[0, 0]) + abs(m[0, 1]), abs(m[1, 0]) + abs(m[1, 1])) * BLOCK <= MOST_CELLS
        if warp.shape[0] == 0 and fine:
            out[work] = _by_blocks(metres, m, (eu, ev), gain, heights, blocks, start_row, stop_row)
        else:
            out[work] = _by_rows(metres, m, (eu, ev), gain, heights, warp, sway, start_row, stop_row)


@kernel
def _by_rows(
    metres: Floats,
    m: Floats,
    ends: tuple[float, float],
    gain: Floats,
    heights: Heights,
    warp: Floats,
    sway: float,
    start: int,
    stop: int,
) -> float:
    """The greatest distance in rows start..stop, sample by sample."""
    rows, cols = heights.shape
    su = (abs(m[0, 0]) + abs(m[0, 1])) * sway
    sv = (abs(m[1, 0]) + abs(m[1, 1])) * sway
    worst = -1.0
    for row in range(start, stop):
        a, b = _narrowed(m[0, 0], m[0, 1] * row + m[0, 2], ends[0], su, 0.0, cols - 1.0)
        a, b = _narrowed(m[1, 0], m[1, 1] * row + m[1, 2], ends[1], sv, a, b)
        if a > b:
            continue
        col, right = max(0, int(np.floor(a))), min(cols, int(np.ceil(b)) + 1)
        while col < right:
            end_col, x, dx, y, dy = segment(warp, rows, cols, m, row, col)
            last = min(end_col, right)
            found = farthest(heights[row], gain[2], gain[3], metres, ends, (x, dx, y, dy), col, last)
            worst = max(worst, found)
            col = last
    return worst


@kernel
def _by_blocks(
    metres: Floats,
    m: Floats,
    ends: tuple[float, float],
    gain: Floats,
    heights: Heights,
    blocks: Blocks,
    start: int,
    stop: int,
) -> float:
    """Finds the greatest distance for lattices without a bend, leaving out the blocks that cannot hold it: samples and
    patch are too near to each other there. The middles of all blocks come first."""
    cols = heights.shape[1]
    left, right = np.empty(BLOCK, np.int64), np.empty(BLOCK, np.int64)
    worst = -1.0
    for thorough in (False, True):
        for bj in range(start // BLOCK, (stop - 1) // BLOCK + 1):
            top, end = max(start, bj * BLOCK), min(stop, (bj + 1) * BLOCK)
            least, most = cols, 0
            for row in range(top, end):
                a, b = _narrowed(m[0, 0], m[0, 1] * row + m[0, 2], ends[0], 0.0, 0.0, cols - 1.0)
                a, b = _narrowed(m[1, 0], m[1, 1] * row + m[1, 2], ends[1], 0.0, a, b)
                k = row - top
                left[k], right[k] = (max(0, int(np.floor(a))), min(cols, int(np.ceil(b)) + 1)) if a <= b else (cols, 0)
                least, most = min(least, left[k]), max(most, right[k])
            for bi in range(least // BLOCK, (most - 1) // BLOCK + 1 if most > least else 0):
                first, last = max(least, bi * BLOCK), min(most, (bi + 1) * BLOCK)
                if thorough and _most(metres, m, ends, gain, blocks, bj, bi, top, end, first, last) <= worst:
                    continue
                rows = (top, end) if thorough else ((top + end) // 2, (top + end) // 2 + 1)
                for row in range(*rows):
                    k = row - top
                    at = m[0, 1] * row + m[0, 2], m[0, 0], m[1, 1] * row + m[1, 2], m[1, 0]
                    a, b = max(first, left[k]), min(last, right[k])
                    if not thorough:
                        a, b = max(a, (first + last) // 2), min(b, (first + last) // 2 + 1)
                    worst = max(worst, farthest(heights[row], gain[2], gain[3], metres, ends, at, a, b))
    return worst


@kernel
def _most(
    metres: Floats,
    m: Floats,
    ends: tuple[float, float],
    gain: Floats,
    blocks: Blocks,
    bj: int,
    bi: int,
    top: int,
    end: int,
    first: int,
    last: int,
) -> float:
    """Returns more than any distance of a sample [top..end, first..last] of block [bj, bi] from a patch."""
    low, high = blocks.low[bj - blocks.row, bi - blocks.col], blocks.high[bj - blocks.row, bi - blocks.col]
    if low > high:
        return -2.0
    a, b = gain[2] * low + gain[3], gain[2] * high + gain[3]
    a, b = min(a, b), max(a, b)
    u0, u1 = _span(m[0, 0], m[0, 1], m[0, 2], first, last - 1, top, end - 1)
    v0, v1 = _span(m[1, 0], m[1, 1], m[1, 2], first, last - 1, top, end - 1)
    if u1 < 0 or v1 < 0 or u0 > ends[0] or v0 > ends[1]:
        return -2.0
    side = len(metres)
    i0, i1 = max(0, int(u0)), min(side - 1, int(u1) + 1)
    j0, j1 = max(0, int(v0)), min(side - 1, int(v1) + 1)
    least, most = np.inf, -np.inf
    for j in range(min(j0, side - 2), j1 + 1):
        for i in range(min(i0, side - 2), i1 + 1):
            least, most = min(least, metres[j, i]), max(most, metres[j, i])
    bound = max(b - least, most - a)
    return float(bound + 1e-9 * (abs(a) + abs(b) + abs(least) + abs(most)))


@kernel
def _span(du: float, dv: float, at: float, first: int, last: int, top: int, end: int) -> tuple[float, float]:
    """Least and greatest of du col + dv row + at over columns first..last and rows top..end."""
    a, b, c, d = du * first, du * last, dv * top, dv * end
    return min(a, b) + min(c, d) + at - 1e-9, max(a, b) + max(c, d) + at + 1e-9


@kernel
def _rows_of(m: Floats, eu: float, ev: float) -> tuple[float, float]:
    """Rows of the lattice that the corners of a domain span."""
    determinant = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
    low, high = np.inf, -np.inf
    for corner in range(4):
        du = (eu if corner & 1 else 0.0) - m[0, 2]
        dv = (ev if corner & 2 else 0.0) - m[1, 2]
        v = (m[0, 0] * dv - m[1, 0] * du) / determinant
        low, high = min(low, v), max(high, v)
    return low, high


def distances(of: LayerPatches, to: LayerPatches) -> tuple[NDArray[np.int64], Floats]:
    """Indices of the patches of ``of`` that samples of ``to`` lie in, and the greatest distance there, metres."""
    index = np.flatnonzero(reached(of, to))
    out = np.full(len(index), NONE)
    lattice_to_patch = composed(of.to_patch[index], to.to_world)
    ours, theirs = of.placed, to.placed
    gain = np.array([ours.layer.scale, ours.layer.lift_m, theirs.layer.scale, theirs.layer.lift_m], np.float64)
    warp = NO_WARP if theirs.raster.warp is None else theirs.raster.warp
    blocks = _blocks(theirs.raster.heights, lattice_to_patch, of.extent[index], warp)
    row, col, sides = (column[index] for column in of.windows())
    kinds = of.scale[index].astype(np.int64) * 64 + sides
    for kind in np.unique(kinds).tolist():
        scale, side = divmod(kind, 64)
        at = np.flatnonzero(kinds == kind)
        first = np.stack([row[at], col[at]], 1).astype(np.int64)
        mip = ours.raster.mips[patches.level_of(scale)]
        # A few great patches are shared out by rows, so that no thread waits for another.
        cells = patches.SMALLEST_KERNEL << max(scale, 0)
        parts = -(-cells // 448)
        bests = np.empty(len(at) * parts)
        work = functools.partial(
            _distances,
            mip,
            first,
            side,
            lattice_to_patch[at],
            of.extent[index[at]],
            gain,
            theirs.raster.heights,
            warp,
            to.sway,
            blocks,
            parts,
            bests,
        )
        spread(work, bands(len(bests), 1 if cells > 500 else 16))
        out[at] = bests.reshape(-1, parts).max(axis=1)
    there = out >= 0
    return index[there], out[there]


def _blocks(heights: Heights, to_patch: Floats, extent: Floats, warp: Floats) -> Blocks:
    """Bounds of the blocks that domains (n,) reach; none for a bent lattice, where they are of no use."""
    if len(to_patch) == 0 or len(warp):
        none = np.empty((0, 0), np.float32)
        return Blocks(0, 0, none, none)
    back, zero = inverse(to_patch), np.zeros(len(extent))
    u = np.stack([zero, extent[:, 0], extent[:, 0], zero], 1)
    v = np.stack([zero, zero, extent[:, 1], extent[:, 1]], 1)
    low, high = np.empty(2, np.int64), np.empty(2, np.int64)
    for k in range(2):
        at = back[:, k, 0, None] * u + back[:, k, 1, None] * v + back[:, k, 2, None]
        last = heights.shape[1 - k] - 1
        low[k], high[k] = (np.clip(end, 0, last) // BLOCK for end in (at.min() - 1, at.max() + 1))
    (col, row), (wide, tall) = low, high - low + 1
    least, most = np.empty((tall, wide), np.float32), np.empty((tall, wide), np.float32)
    corner = int(row) * BLOCK, int(col) * BLOCK
    spread(lambda a, b: _bounds(heights, *corner, least, most, a, b), bands(int(tall), 8))
    return Blocks(int(row), int(col), least, most)
