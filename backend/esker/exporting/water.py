"""Where water stands on the ground that is exported: the sea, and lakes in basins (docs/renderer.md, "Lakes")."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.contract import NO_LAKE
from esker.synthesis.lakes import Lakes

Float = NDArray[np.float64]


def under_water(
    heights: NDArray[np.float32], u: Float, v: Float, lakes: Lakes | None, sea_m: float | None
) -> NDArray[np.bool_]:
    """Returns which samples of ``heights`` (rows, columns), metres, lie under the sea or in a lake.

    ``u`` (columns,), ``v`` (rows,): where they lie in the lattice of the lakes, in its samples. A lake ends where
    ``inside_lake`` of shaders/wgsl/water/lakes.wgsl does; where two meet in a cell the higher one counts.
    """
    wet: NDArray[np.bool_] = np.zeros(heights.shape, dtype=bool) if sea_m is None else heights < np.float32(sea_m)
    if lakes is None or not lakes.any:
        return wet
    last = len(lakes.levels) - 2
    i, j = (np.clip(np.floor(at).astype(np.intp), 0, last) for at in (v, u))
    near: NDArray[np.bool_] = np.greater(lakes.levels, np.float32(NO_LAKE))
    beside = np.logical_or.reduce([near[:-1, :-1], near[:-1, 1:], near[1:, :-1], near[1:, 1:]])
    for row in np.nonzero(beside.any(axis=1)[i])[0]:
        columns = np.nonzero(beside[i[row]][j])[0]
        inside, level = _inside(lakes, i[row], j[columns], v[row] - i[row], u[columns] - j[columns])
        wet[row, columns] |= (inside > 0) & (heights[row, columns] < level)
    return wet


def _inside(lakes: Lakes, i: Any, j: NDArray[np.intp], fy: float, fx: Float) -> tuple[Float, Float]:
    """How far places of a row lie inside the highest lake of their cell, metres, and its level."""
    at = [(i + dy, j + dx) for dy in (0, 1) for dx in (0, 1)]
    levels = [lakes.levels[p].astype(np.float64) for p in at]
    grounds = [lakes.heights[p].astype(np.float64) for p in at]
    lake = np.maximum.reduce(levels)
    covers = [(z == lake) & (g < lake) for z, g in zip(levels, grounds, strict=True)]
    a, b, c, d = (np.where(cover, lake - g, g - lake) for cover, g in zip(covers, grounds, strict=True))
    south, north = a + (b - a) * fx, c + (d - c) * fx
    shore = np.logical_and.reduce([z == lake for z in levels])
    side = np.where(shore | np.logical_or.reduce(covers), south + (north - south) * fy, -1.0)
    return np.where(lake > NO_LAKE, side, -1.0), lake
