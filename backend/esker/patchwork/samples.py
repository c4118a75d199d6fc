"""The samples of a patch: cut from its mipmap level, and carried on beyond the level's border and into nodata.

Ground goes on with the slope that it has there: from three samples in line, nearest first a, b, c, the next is a + s,
with s the smaller of a - b and b - c where these have one sign, else 0 (minmod). So a plane goes on as a plane, while a
peak, a cliff or noise at the very border is not thrown out: two samples further on are no farther from a than c is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel

IN_LINE = 3
"""Samples from which the next one follows."""


@kernel
def following(a: float, b: float, c: float) -> float:
    """The sample that follows c, b, a; NaN for NaN among them."""
    near, far = a - b, b - c
    if near * far <= 0.0:
        return a
    return a + (near if abs(near) < abs(far) else far)


@kernel
def beyond(line: NDArray[np.float32], low: bool) -> float:
    """The sample before the first (``low``) or after the last of a line; as that one is where the line is short."""
    n = line.size
    if n < IN_LINE:
        return float(line[0] if low else line[n - 1])
    if low:
        return following(float(line[0]), float(line[1]), float(line[2]))
    return following(float(line[n - 1]), float(line[n - 2]), float(line[n - 3]))


@kernel
def cut(mip: NDArray[np.float32], row: int, col: int, out: NDArray[np.float32]) -> None:
    """Copy the samples of ``mip`` from [row, col] on to ``out`` (side, side).

    Beyond the level's border its slope goes on, along rows first. Nodata, which only lies in the margin, is filled ring
    by ring outwards from valid samples (``fill``), also from those that lie ``IN_LINE`` around the patch.
    """
    _copy(mip, row, col, out)
    side = out.shape[0]
    for r in range(side):
        for c in range(side):
            if np.isnan(out[r, c]):
                wide = np.empty((side + 2 * IN_LINE, side + 2 * IN_LINE), np.float32)
                _copy(mip, row - IN_LINE, col - IN_LINE, wide)
                fill(wide)
                out[:] = wide[IN_LINE:-IN_LINE, IN_LINE:-IN_LINE]
                return


@kernel
def _copy(mip: NDArray[np.float32], row: int, col: int, out: NDArray[np.float32]) -> None:
    """The samples from [row, col] on, nodata as it is."""
    rows, side = mip.shape[0], out.shape[0]
    top, end = max(0, -row), min(side, rows - row)
    for r in range(top, end):
        row_of(mip, row + r, col, out[r])
    if top > 0 or end < side:
        _rows_beyond(mip, col, top, end, out)


@kernel
def _go_on(last: float, following_: float, line: NDArray[np.float32], at: int, step: int) -> None:
    """Fill ``line`` from ``at`` on, in steps of 1 or -1, with the line through the last sample and the one after it.

    Where samples before the last are nodata the last goes on as it is.
    """
    rise = following_ - last
    if np.isnan(rise):
        rise = 0.0
    count = 0
    while 0 <= at < line.size:
        count += 1
        line[at] = last + count * rise
        at += step


@kernel
def _rows_beyond(mip: NDArray[np.float32], col: int, top: int, end: int, out: NDArray[np.float32]) -> None:
    """Rows of ``out`` outside of top..end, as the level goes on."""
    side = out.shape[0]
    last, after = np.empty(side, np.float32), np.empty(side, np.float32)
    for low in (True, False):
        if (top if low else side - end) > 0:
            row_of(mip, 0 if low else mip.shape[0] - 1, col, last)
            row_beyond(mip, low, col, after)
            for c in range(side):
                _go_on(last[c], after[c], out[:, c], top - 1 if low else end, -1 if low else 1)


@kernel
def row_beyond(mip: NDArray[np.float32], low: bool, col: int, out: NDArray[np.float32]) -> None:
    """The row before the first (``low``) or after the last of a level, from column ``col`` on."""
    deep = min(IN_LINE, mip.shape[0])
    near = np.empty((deep, out.size), np.float32)
    for k in range(deep):
        row_of(mip, k if low else mip.shape[0] - 1 - k, col, near[k])
    for c in range(out.size):
        out[c] = beyond(near[:, c], True)


@kernel
def row_of(mip: NDArray[np.float32], row: int, col: int, out: NDArray[np.float32]) -> None:
    """Row ``row`` of a level from column ``col`` on, as it goes on beyond its ends."""
    cols = mip.shape[1]
    source = mip[row]
    left, right = max(0, -col), min(out.size, cols - col)
    for c in range(left, right):
        out[c] = source[col + c]
    if left > 0:
        _go_on(source[0], beyond(source, True), out, left - 1, -1)
    if right < out.size:
        _go_on(source[cols - 1], beyond(source, False), out, right, 1)


@kernel
def fill(out: NDArray[np.float32]) -> None:
    """Replace the NaN of samples (side, side) but for ``IN_LINE`` at the edges, ring by ring from valid ones.

    Each takes the mean of what follows in those of the eight directions where three samples in line are known; if
    there is none, the mean of its known neighbours. Without any valid sample all stay.
    """
    side = out.shape[0]
    known = np.empty_like(out)
    for _ in range(2 * side):
        holes = 0
        for r in range(side):
            for c in range(side):
                known[r, c] = out[r, c]
        for r in range(side):
            for c in range(side):
                if np.isnan(known[r, c]):
                    out[r, c] = _filled(known, r, c)
                    inner = IN_LINE <= r < side - IN_LINE and IN_LINE <= c < side - IN_LINE
                    if inner and np.isnan(out[r, c]):
                        holes += 1
        if holes == 0:
            return


@kernel
def _filled(known: NDArray[np.float32], row: int, col: int) -> float:
    """What a sample of nodata is taken for, NaN if it has no known neighbour."""
    side = known.shape[0]
    sloping, slopes, total, count = 0.0, 0, 0.0, 0
    for dr in range(-1, 2):
        for dc in range(-1, 2):
            r, c = row + dr, col + dc
            if (dr == 0 and dc == 0) or not (0 <= r < side and 0 <= c < side) or np.isnan(known[r, c]):
                continue
            total += known[r, c]
            count += 1
            y, x = row + IN_LINE * dr, col + IN_LINE * dc
            if 0 <= y < side and 0 <= x < side:
                value = following(float(known[r, c]), float(known[r + dr, c + dc]), float(known[y, x]))
                if not np.isnan(value):
                    sloping += value
                    slopes += 1
    if slopes:
        return sloping / slopes
    return total / count if count else np.nan
