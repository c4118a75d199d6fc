"""Bounds of tiles and sub-patches: the min/max pyramid that selection reads (DESIGN 7; paper 0, III-A, figure 3).

Per 16-cell sub-patch of every level: lowest and highest sample, and the error of drawing the parent level there.
From these, per tile and nested over all descendants, flat arrays over all levels for ``quadtree.select``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import PATCH_CELLS, SUBPATCHES
from esker.tiles import loops
from esker.tiles.codec.payload import Ints

Floats = NDArray[np.float32]
Counts = NDArray[np.uint32]
T = TypeVar("T", bound=np.generic)
Window = Callable[[slice, slice], Ints]
"""Samples of some rows and columns of a level."""


def block_reduce(ufunc: np.ufunc, a: NDArray[T], cells: int) -> NDArray[T]:
    """Reduces closed blocks of ``cells``+1 samples a side that share their edge samples.

    (m*cells + 1, n*cells + 1) -> (m, n); ``ufunc`` is np.minimum, np.maximum or np.logical_or.
    """
    for axis in (0, 1):
        n = (a.shape[axis] - 1) // cells
        blocks = ufunc.reduceat(a, np.arange(n) * cells, axis=axis)
        far = a[cells::cells] if axis == 0 else a[:, cells::cells]
        a = ufunc(blocks, far)
    return a


def dilate(a: NDArray[T]) -> NDArray[T]:
    """Returns the largest of each value (rows, cols) and its eight neighbours.

    Of booleans, True spreads to the eight neighbours.
    """
    rows = a.copy()
    np.maximum(rows[1:], a[:-1], out=rows[1:])
    np.maximum(rows[:-1], a[1:], out=rows[:-1])
    out = rows.copy()
    np.maximum(out[:, 1:], rows[:, :-1], out=out[:, 1:])
    np.maximum(out[:, :-1], rows[:, 1:], out=out[:, :-1])
    return out


def parent_distance(samples: Ints, parent: Ints) -> Ints:
    """Twice |sample - what the parent would draw there|, in quanta of the child, same shape as ``samples``.

    ``parent`` holds the samples of the coarser level over the same ground: shape (m, n) for samples (2m-1, 2n-1). It
    draws bilinear interpolation, at a cell's centre the mean of its four corners. Needs |sample| < 2^28.
    """
    out = np.empty_like(samples)
    p = parent * 2
    out[0::2, 0::2] = (samples[0::2, 0::2] - p[:, :]) * 2
    out[0::2, 1::2] = samples[0::2, 1::2] * 2 - (p[:, :-1] + p[:, 1:])
    rows = parent[:-1] + parent[1:]
    out[1::2, 0::2] = (samples[1::2, 0::2] - rows) * 2
    out[1::2, 1::2] = samples[1::2, 1::2] * 2 - (rows[:, :-1] + rows[:, 1:])
    return np.abs(out, out=out)


def sub_error(samples: Ints, parent: Ints) -> Counts:
    """Largest distance to the parent's surface per sub-patch, quanta of the child's level, rounded up: (n, n) for
    samples (16n+1, 16n+1)."""
    worst = block_reduce(np.maximum, parent_distance(samples, parent), PATCH_CELLS)
    return np.asarray((worst + 1) >> 1, dtype=np.uint32)


class SubPatches:
    """Bounds of one level's sub-patches, quanta of the level, arrays (4*2^l, 4*2^l): ``low``, ``high``, ``error``.

    Mutable and owned by the pyramid; ``update`` recomputes a window of tiles.
    """

    def __init__(self, level: int) -> None:
        n = SUBPATCHES << level
        self.low = np.zeros((n, n), dtype=np.int32)
        self.high = np.zeros((n, n), dtype=np.int32)
        self.error = np.zeros((n, n), dtype=np.uint32)

    def update(self, samples: Window, parent: Window | None, dirty: NDArray[np.bool_]) -> None:
        """Recomputes the smallest rectangle of tiles that holds every True of ``dirty`` (2^l, 2^l).

        ``samples`` and ``parent`` give a window of the level and of the one above.
        """
        rows, cols = np.flatnonzero(dirty.any(axis=1)), np.flatnonzero(dirty.any(axis=0))
        if not rows.size:
            return
        r0, r1, c0, c1 = (int(v) for v in (rows[0], rows[-1] + 1, cols[0], cols[-1] + 1))
        cells = PATCH_CELLS * SUBPATCHES
        window = samples(slice(r0 * cells, r1 * cells + 1), slice(c0 * cells, c1 * cells + 1))
        sub = np.s_[r0 * SUBPATCHES : r1 * SUBPATCHES, c0 * SUBPATCHES : c1 * SUBPATCHES]
        loops.bounded(window, PATCH_CELLS, self.low[sub], self.high[sub])
        if parent is not None:
            half = cells // 2
            above = parent(slice(r0 * half, r1 * half + 1), slice(c0 * half, c1 * half + 1))
            loops.erred(window, above, PATCH_CELLS, self.error[sub])


def _quarter(ufunc: np.ufunc, a: Floats, by: int) -> Floats:
    n = a.shape[0] // by
    out: Floats = ufunc.reduce(a.reshape(n, by, n, by), axis=(1, 3))
    return out


@dataclass(frozen=True)
class Bounds:
    """Flat arrays over all tiles of levels 0..levels, coarse first, rows from the south; metres, float32.

    ``low``/``high`` hold the tile and all its descendants. ``error``: largest distance between any surface that this
    tile or a descendant adds and the one that it replaces. ``x``, ``y``, ``half``: centre and half side on the ground.
    ``spacing`` is that of the level's samples. ``starts[l]`` is where level l begins. ``valid`` is False for levels
    that have never been solved.
    """

    size_m: float
    levels: int
    starts: tuple[int, ...]
    x: Floats
    y: Floats
    half: Floats
    spacing: Floats
    low: Floats
    high: Floats
    error: Floats
    valid: NDArray[np.bool_]


def nest(subs: Sequence[SubPatches], valid: Sequence[bool], size_m: float) -> Bounds:
    """Makes the flat, nested arrays from each level's sub-patches."""
    levels = len(subs) - 1
    low: list[Floats] = []
    high: list[Floats] = []
    error: list[Floats] = []
    for level in range(levels, -1, -1):
        q = np.float32(grid.quantum(level, size_m))
        sub = subs[level]
        lo = _quarter(np.minimum, sub.low.astype(np.float32) * q, SUBPATCHES)
        hi = _quarter(np.maximum, sub.high.astype(np.float32) * q, SUBPATCHES)
        err = _quarter(np.maximum, sub.error.astype(np.float32) * q, SUBPATCHES)
        if low and valid[level + 1]:
            lo = np.minimum(lo, _quarter(np.minimum, low[-1], 2))
            hi = np.maximum(hi, _quarter(np.maximum, high[-1], 2))
            err = np.maximum(err, _quarter(np.maximum, error[-1], 2))
        low.append(lo)
        high.append(hi)
        error.append(err)
    starts = tuple((4**level - 1) // 3 for level in range(levels + 1))
    x, y, half, spacing = _ground(levels, size_m)
    return Bounds(
        size_m=size_m,
        levels=levels,
        starts=starts,
        x=x,
        y=y,
        half=half,
        spacing=spacing,
        low=np.concatenate([a.ravel() for a in reversed(low)]),
        high=np.concatenate([a.ravel() for a in reversed(high)]),
        error=np.concatenate([a.ravel() for a in reversed(error)]),
        valid=np.repeat(np.asarray(valid, dtype=np.bool_), [4**level for level in range(levels + 1)]),
    )


@lru_cache(maxsize=32)
def _ground(levels: int, size_m: float) -> tuple[Floats, Floats, Floats, Floats]:
    """``x``, ``y``, ``half``, ``spacing`` of all tiles: the part of ``Bounds`` that never changes."""
    x, y, half, spacing = [], [], [], []
    for level in range(levels + 1):
        n = 1 << level
        width = size_m / n
        centre = ((np.arange(n) + 0.5) * width).astype(np.float32)
        x.append(np.tile(centre, n))
        y.append(np.repeat(centre, n))
        half.append(np.full(n * n, width / 2, dtype=np.float32))
        spacing.append(np.full(n * n, grid.spacing(level, size_m), dtype=np.float32))
    return np.concatenate(x), np.concatenate(y), np.concatenate(half), np.concatenate(spacing)
