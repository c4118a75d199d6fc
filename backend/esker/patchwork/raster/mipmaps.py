"""Mipmaps of an elevation grid: means of 2 x 2 blocks that know of nodata (paper 2, section 4.1).

Sample k of level l is the mean of the valid samples of level l-1 among 2k and 2k+1 a side, and lies at area coordinate
(k + 1/2) 2^l. It is NaN where none of them is valid. The last one of an odd side has fewer to take the mean of.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from esker.contract import PATCH_KERNEL_CELLS
from esker.patchwork.jit import kernel
from esker.patchwork.raster.paging import let_go, sweep

Heights = NDArray[np.float32]


def shapes(rows: int, cols: int) -> list[tuple[int, int]]:
    """Shape of every level of a grid's mipmap, the grid itself first, until one patch holds a level."""
    found = [(rows, cols)]
    while max(found[-1]) > PATCH_KERNEL_CELLS:
        found.append(((found[-1][0] + 1) // 2, (found[-1][1] + 1) // 2))
    return found


@kernel
def _halve(fine: Heights, start: int, stop: int, coarse: Heights) -> None:
    rows, cols = fine.shape
    quarter, half = np.float32(0.25), np.float32(0.5)
    for row in range(start, stop):
        low = fine[2 * row]
        high = fine[min(2 * row + 1, rows - 1)]
        out = coarse[row]
        whole = cols // 2
        bad = False
        for col in range(whole):
            # Pairs of rows first: the mean of equal numbers is that number, and a tilted plane keeps its bits longest.
            # NaN is what differs from itself.
            mean = ((low[2 * col] + high[2 * col]) + (low[2 * col + 1] + high[2 * col + 1])) * quarter
            out[col] = mean
            bad |= mean != mean
        if cols % 2:
            out[whole] = (low[cols - 1] + high[cols - 1]) * half
            bad |= out[whole] != out[whole]
        if bad:
            _halve_row_with_holes(fine, row, coarse)


@kernel
def _halve_row_with_holes(fine: Heights, row: int, coarse: Heights) -> None:
    rows, cols = fine.shape
    for col in range(coarse.shape[1]):
        total, count = 0.0, 0
        for r in range(2 * row, min(2 * row + 2, rows)):
            for c in range(2 * col, min(2 * col + 2, cols)):
                if not np.isnan(fine[r, c]):
                    total += fine[r, c]
                    count += 1
        coarse[row, col] = total / count if count else np.nan


def halve(fine: Heights, coarse: Heights | None = None) -> Heights:
    """The next coarser level of ``fine`` (rows, cols), into ``coarse`` if given: (ceil(rows/2), ceil(cols/2))."""
    if coarse is None:
        coarse = np.empty(((fine.shape[0] + 1) // 2, (fine.shape[1] + 1) // 2), np.float32)
    target, source = coarse, fine.view()
    source.flags.writeable = False  # one kind of array for the compiled loop

    def some(start: int, stop: int) -> None:
        _halve(source, start, stop, target)
        let_go(target, start, stop)

    sweep(some, fine, 64, 2)
    return coarse


def mipmaps(heights: Heights, made: Callable[[int, tuple[int, int]], Heights] | None = None) -> tuple[Heights, ...]:
    """All levels of a grid, itself first. ``made(level, shape)`` gives the array to fill, else memory does."""
    levels = [heights]
    for level, shape in enumerate(shapes(*heights.shape)[1:], 1):
        levels.append(halve(levels[-1], made(level, shape) if made else None))
    return tuple(levels)
