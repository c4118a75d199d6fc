"""The border of a layer: points along the edge of the ground that its kernels cover, around nodata in it as well."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.patchwork.lod.layer_patches import Ints, LayerPatches, mapped
from esker.patchwork.raster import patches

Floats = NDArray[np.float64]

_MOST_POINTS: Final = 1 << 16
"""Points a cell apart, at most; a longer border is sampled more sparsely."""


class Border(NamedTuple):
    """Points (n, 2), metres. ``weight``: metres of border for each. ``pitch``: metres from one to the next at most."""

    points: Floats
    weight: Floats
    pitch: float


def border_of(of: LayerPatches) -> Border:
    """The border of a layer, a point in the middle of each cell's side. A bent lattice's follows its bend."""
    rows, cols = of.placed.raster.heights.shape
    upright, level = _sides(of, rows, cols)
    skip = max(1, -(-(len(upright) + len(level)) // _MOST_POINTS))
    upright, level = upright[::skip], level[::skip]
    v, u = np.divmod(upright, cols + 1)
    y, x = np.divmod(level, cols)
    lattice = np.stack([np.concatenate([u - 0.5, x]), np.concatenate([v, y - 0.5])], axis=1).astype(np.float64)
    step_u, step_v = of.placed.layer.spacing_m
    weight = np.concatenate([np.full(len(u), skip * step_v), np.full(len(x), skip * step_u)])
    points = mapped(of.to_world, patches.warped(of.placed.raster.warp, rows, cols, lattice))
    return Border(points, weight, max(step_u, step_v) * skip)


def _sides(of: LayerPatches, rows: int, cols: int) -> tuple[Ints, Ints]:
    """Sides of cells that kernels of the grid's own level end at, sorted: upright ones of cell [v, u] as
    v * (cols + 1) + u, those that lie as v * cols + u. Where two kernels meet both have the side, and it is none."""
    held = np.zeros(np.array(patches.table_shape(rows, cols, 0)) + 2, dtype=np.int8)
    inner, size = held[1:-1, 1:-1], patches.SMALLEST_KERNEL
    for scale in range(patches.SMALL_SCALES + 1):
        part, wide = slice(*of.scale_range(scale)), 1 << scale
        for dj in range(wide):
            for di in range(wide):
                row_of, col_of = of.j[part] * wide + dj, of.i[part] * wide + di
                there = (row_of < inner.shape[0]) & (col_of < inner.shape[1])
                inner[row_of[there], col_of[there]] = 1
    j, i = np.nonzero(held[1:-1, 1:] != held[1:-1, :-1])
    upright = [_run(j * size, np.minimum(i * size, cols), np.minimum(size, rows - j * size), cols + 1, cols + 1)]
    j, i = np.nonzero(held[1:, 1:-1] != held[:-1, 1:-1])
    level = [_run(np.minimum(j * size, rows), i * size, np.minimum(size, cols - i * size), cols, 1)]
    row, col, tall, wide_ = of.placed.raster.errors.rim.astype(np.int64).T
    upright += [_run(row, end, tall, cols + 1, cols + 1) for end in (col, col + wide_)]
    level += [_run(end, col, wide_, cols, 1) for end in (row, row + tall)]
    return _once(np.concatenate(upright)), _once(np.concatenate(level))


def _run(row: Ints, col: Ints, count: Ints, per_row: int, step: int) -> Ints:
    """Numbers row * per_row + col, and ``count`` of them in all, ``step`` apart."""
    which = np.repeat(np.arange(len(row)), count)
    along = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    return np.asarray((row * per_row + col)[which] + along * step, dtype=np.int64)


def _once(numbers: Ints) -> Ints:
    found, count = np.unique(numbers, return_counts=True)
    return np.asarray(found[count == 1], dtype=np.int64)
