"""The rim of a layer: points along the border of what its kernels cover."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.patchwork import patches
from esker.patchwork.sheets import Sheet, mapped

Floats = NDArray[np.float64]

_MOST_POINTS: Final = 1 << 16
"""Rim points a cell apart, at most; a longer rim is sampled more sparsely."""


class Rim(NamedTuple):
    """Points (n, 2) along the border of what a layer's kernels cover, ``weight`` (n,) metres of it for each, ``pitch``
    metres from one to the next at most."""

    points: Floats
    weight: Floats
    pitch: float


def rim_of(sheet: Sheet) -> Rim:
    """The rim of a layer. A bent lattice's follows its bend."""
    rows, cols = sheet.placed.raster.heights.shape
    held = np.zeros(np.array(patches.table_shape(rows, cols, 0)) + 2, dtype=np.int8)
    inner = held[1:-1, 1:-1]
    for scale in range(patches.SMALL_SCALES + 1):
        part, wide = slice(*sheet.scale_range(scale)), 1 << scale
        for dj in range(wide):
            for di in range(wide):
                j, i = sheet.j[part] * wide + dj, sheet.i[part] * wide + di
                there = (j < inner.shape[0]) & (i < inner.shape[1])
                inner[j[there], i[there]] = 1
    cells = patches.SMALLEST_KERNEL
    upright = np.argwhere(held[1:-1, 1:] != held[1:-1, :-1])
    level = np.argwhere(held[1:, 1:-1] != held[:-1, 1:-1])
    count = len(upright) + len(level)
    each = cells if count * cells <= _MOST_POINTS else 1
    skip = max(1, -(-count * each // _MOST_POINTS))
    upright, level = upright[::skip], level[::skip]
    share = (np.arange(each) + 0.5) / each
    v0, u0 = upright[:, 0] * cells, level[:, 1] * cells
    tall, wide_ = np.minimum(v0 + cells, rows) - v0, np.minimum(u0 + cells, cols) - u0
    u = np.concatenate(
        [np.repeat(np.minimum(upright[:, 1] * cells, cols), each), (u0[:, None] + share * wide_[:, None]).ravel()]
    )
    v = np.concatenate(
        [(v0[:, None] + share * tall[:, None]).ravel(), np.repeat(np.minimum(level[:, 0] * cells, rows), each)]
    )
    lattice = np.stack([u, v], axis=1) - 0.5
    sx, sy = sheet.placed.layer.spacing_m
    weight = np.concatenate([np.repeat(tall * sy, each), np.repeat(wide_ * sx, each)]) * (skip / each)
    points = mapped(sheet.to_world, patches.warped(sheet.placed.raster.warp, rows, cols, lattice))
    return Rim(points, weight, max(sx, sy) * skip * (cells / each))
