"""The rim of a grid's data: kernels as small as need be beside nodata, so that every valid sample lies in one.

The smallest kernels of the tiling are 7 x 7 samples (``patches``). A block of that size that holds nodata has none, at
any scale; its valid samples are taken apart into rectangles instead, the greatest first, each the kernel of a patch of
the grid's own samples. They are disjoint, so kernels of one layer still tile and nest: a rim patch has no other above
or below it. A single sample is the least there can be, so nothing of a grid is left out, unless a grid is so riddled
that its rim had more than ``MOST`` kernels: then rectangles below the least area that keeps within it stay out.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.jit import kernel
from esker.patchwork.raster.paging import sweep
from esker.patchwork.raster.patches import SMALLEST_KERNEL, Mask

Boxes = NDArray[np.int32]

MOST: Final = 1 << 18
"""Rim kernels of a grid, at most: a patch of the model takes about 700 bytes."""
_CELLS: Final = SMALLEST_KERNEL * SMALLEST_KERNEL


@kernel
def _masks(heights: NDArray[np.float32], j: int, i: int, masks: NDArray[np.int64]) -> int:
    """Valid samples of a block of the tiling, a bit a column in each row's number; returns how many rows it has."""
    rows, cols = heights.shape
    top, left = j * SMALLEST_KERNEL, i * SMALLEST_KERNEL
    tall, wide = min(SMALLEST_KERNEL, rows - top), min(SMALLEST_KERNEL, cols - left)
    for r in range(tall):
        bits = 0
        for c in range(wide):
            if not np.isnan(heights[top + r, left + c]):
                bits |= 1 << c
        masks[r] = bits
    return int(tall)


@kernel
def _greatest(masks: NDArray[np.int64], tall: int, box: NDArray[np.int64]) -> int:
    """The rectangle of set bits with the greatest area, of equal ones the squarest, then the first, into ``box`` as
    row, column, rows, columns; returns its area, 0 if no bit is set."""
    best, longest = 0, 0
    for first in range(tall):
        both = masks[first]
        for last in range(first, tall):
            both &= masks[last]
            if both == 0:
                break
            run, high = 0, last - first + 1
            for c in range(SMALLEST_KERNEL):
                run = run + 1 if both >> c & 1 else 0
                area, longer = run * high, max(run, high)
                if area > best or (area == best and longer < longest):
                    best, longest = area, longer
                    box[0], box[1], box[2], box[3] = first, c - run + 1, high, run
    return best


@kernel
def _take_apart(
    heights: NDArray[np.float32], whole: Mask, least: int, start: int, stop: int, count: NDArray[np.int64], out: Boxes
) -> None:
    """Rectangles of at least ``least`` samples of the blocks (j, i) with j in start..stop that are not ``whole``.

    Without room in ``out``: counts them, ``count[j, area - 1]``. With: writes them from ``out[count[j, 0]]`` on.
    """
    masks, box = np.empty(SMALLEST_KERNEL, np.int64), np.empty(4, np.int64)
    for j in range(start, stop):
        at = count[j, 0]
        for i in range(whole.shape[1]):
            if whole[j, i]:
                continue
            tall = _masks(heights, j, i, masks)
            area = _greatest(masks, tall, box)
            while area >= least and area > 0:
                for r in range(box[0], box[0] + box[2]):
                    masks[r] &= ~(((1 << box[3]) - 1) << box[1])
                if len(out):
                    out[at, 0], out[at, 1] = j * SMALLEST_KERNEL + box[0], i * SMALLEST_KERNEL + box[1]
                    out[at, 2], out[at, 3] = box[2], box[3]
                    at += 1
                else:
                    count[j, area - 1] += 1
                area = _greatest(masks, tall, box)


def find(heights: NDArray[np.float32], whole: Mask | None) -> Boxes:
    """Rim kernels of a grid (rows, cols): int32 (n, 4), first row, first column, rows, columns, by block of the tiling.

    ``whole``: the blocks of 7 x 7 samples without nodata, which have kernels of their own; None if all are.
    """
    if whole is None or whole.all():
        return np.empty((0, 4), np.int32)
    tall = len(whole)
    count = np.zeros((tall, _CELLS), np.int64)
    none = np.empty((0, 4), np.int32)
    sweep(lambda a, b: _take_apart(heights, whole, 1, a, b, count, none), heights, 1, SMALLEST_KERNEL)
    # The greedy order takes great ones first, so that leaving the small ones out changes none of the others.
    at_least = count.sum(axis=0)[::-1].cumsum()[::-1]
    least = 1 + int(np.count_nonzero(at_least > MOST))
    each = count[:, least - 1 :].sum(axis=1)
    first = np.zeros((tall, 1), np.int64)
    first[1:, 0] = np.cumsum(each)[:-1]
    out = np.empty((int(each.sum()), 4), np.int32)
    if len(out):
        sweep(lambda a, b: _take_apart(heights, whole, least, a, b, first, out), heights, 1, SMALLEST_KERNEL)
    return out


def blocks(boxes: Boxes, shape: tuple[int, int]) -> NDArray[np.int64]:
    """Where the kernels of each block begin: (rows * cols + 1,) for the ``shape`` of the tiling's finest table."""
    of = (boxes[:, 0] // SMALLEST_KERNEL).astype(np.int64) * shape[1] + boxes[:, 1] // SMALLEST_KERNEL
    out = np.zeros(shape[0] * shape[1] + 1, np.int64)
    np.cumsum(np.bincount(of, minlength=shape[0] * shape[1]), out=out[1:])
    return out
