"""Measuring the patches of one layer against the samples of another (DESIGN 11: data that became stale; compiled)."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from esker.patchwork import patches
from esker.patchwork.errors import NO_WARP, Heights, farthest, segment
from esker.patchwork.jit import bands, kernel, spread
from esker.patchwork.patches import Floats
from esker.patchwork.samples import cut
from esker.patchwork.sheets import Sheet, composed, reached

NONE = -1.0
"""The distance of a patch that no sample lies in."""


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
    parts: int,
    out: Floats,
    start: int,
    stop: int,
) -> None:
    """Greatest distance of the samples of ``heights`` in the domains of patches, each in ``parts`` bands of rows.

    ``first`` (n, 2): row and column of a patch in ``mip``; ``to_patch`` (n, 2, 3): lattice of ``heights`` to patch;
    ``gain``: scale and lift of the patches, scale and lift of the samples. ``out[p * parts + band]``.
    """
    rows, cols = heights.shape
    block = np.empty((side, side), np.float32)
    metres = np.empty((side, side))
    for work in range(start, stop):
        p = work // parts
        m, eu, ev = to_patch[p], extent[p, 0], extent[p, 1]
        su = (abs(m[0, 0]) + abs(m[0, 1])) * sway
        sv = (abs(m[1, 0]) + abs(m[1, 1])) * sway
        low, high = _rows_of(m, eu, ev)
        top, end = max(0, int(np.ceil(low - sway))), min(rows, int(np.floor(high + sway)) + 1)
        out[work] = -1.0
        if top >= end:
            continue
        cut(mip, first[p, 0], first[p, 1], block)
        for r in range(side):
            for c in range(side):
                metres[r, c] = gain[0] * block[r, c] + gain[1]
        worst = -1.0
        band = work % parts
        for row in range(top + (end - top) * band // parts, top + (end - top) * (band + 1) // parts):
            a, b = _narrowed(m[0, 0], m[0, 1] * row + m[0, 2], eu, su, 0.0, cols - 1.0)
            a, b = _narrowed(m[1, 0], m[1, 1] * row + m[1, 2], ev, sv, a, b)
            if a > b:
                continue
            col, right = max(0, int(np.floor(a))), min(cols, int(np.ceil(b)) + 1)
            while col < right:
                end_col, x, dx, y, dy = segment(warp, rows, cols, m, row, col)
                last = min(end_col, right)
                found = farthest(heights[row], gain[2], gain[3], metres, (eu, ev), (x, dx, y, dy), col, last)
                worst = max(worst, found)
                col = last
        out[work] = worst


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


def distances(of: Sheet, to: Sheet) -> tuple[NDArray[np.int64], Floats]:
    """Indices of the patches of ``of`` that samples of ``to`` lie in, and the greatest distance there, metres."""
    index = np.flatnonzero(reached(of, to))
    out = np.full(len(index), NONE)
    lattice_to_patch = composed(of.to_patch[index], to.to_world)
    ours, theirs = of.placed, to.placed
    gain = np.array([ours.layer.scale, ours.layer.lift_m, theirs.layer.scale, theirs.layer.lift_m], np.float64)
    warp = NO_WARP if theirs.raster.warp is None else theirs.raster.warp
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
            parts,
            bests,
        )
        spread(work, bands(len(bests), 1 if cells > 500 else 16))
        out[at] = bests.reshape(-1, parts).max(axis=1)
    there = out >= 0
    return index[there], out[there]
