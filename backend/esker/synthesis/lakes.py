"""Lakes in the basins of the ground: how high water stands that cannot run off (twin of tiles/lakes/lakes.ts).

How high water stands that runs over its brim says ``flow``: what a flood of all samples of one level gives (Barnes,
Lehman & Mulla, "Priority-flood: An optimal depression-filling and watershed-labeling algorithm for digital elevation
models", Computers & Geosciences 62, 2014). Samples are joined as the drawn triangles join them: to the four beside
them and along the diagonals from south-east to north-west. On such ground the flood is exact: water leaves a basin over
a vertex.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import (
    LAKE_FREEBOARD_CELLS,
    LAKE_FREEBOARD_SHARE,
    LAKE_FULL_FETCH_M,
    LAKE_LEAST_SAMPLES,
    LAKE_LEVEL,
    LAKE_SHORE_SAMPLES,
    NO_LAKE,
    SUBPATCHES,
    TILE_CELLS,
)
from esker.flow.water import find_water

Heights = NDArray[np.float32]
_MESH: Final = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, -1), (-1, 1))


class Lakes(NamedTuple):
    """``heights``: (n, n) float32, metres, row 0 south, the ground that was flooded. ``levels``: (n, n) float32, level
    of the lake that covers a sample (where the ground lies below it) or whose shore it is, NO_LAKE elsewhere.
    ``samples``: how many samples lie under each lake, by level."""

    heights: Heights
    levels: Heights
    samples: dict[float, int]

    @property
    def any(self) -> bool:
        """Whether there is a lake."""
        return bool(self.samples)


def find_lakes(heights: Heights, cell_m: float, least_m: float, sea_m: float | None = None) -> Lakes:
    """The lakes of ``heights``, (n, n) float32 metres: of basins at least ``least_m`` deep and of LAKE_LEAST_SAMPLES
    samples. What reaches the border runs off; below ``sea_m`` the ground is the sea's. ``cell_m``: metres between
    samples."""
    floor = heights if sea_m is None else np.maximum(heights, np.float32(sea_m))
    ground, filled = floor.astype(np.float64), flooded(floor).astype(np.float64)
    levels = np.full(heights.shape, NO_LAKE, dtype=np.float32)
    for basin in _basins(filled > ground):
        at = tuple(np.array(basin).T)
        depth = float(filled[at].max() - ground[at].min())
        if len(basin) < LAKE_LEAST_SAMPLES or depth < least_m:
            continue
        board = min(LAKE_FREEBOARD_CELLS * cell_m, LAKE_FREEBOARD_SHARE * depth)
        level = np.float32(filled[at].max() - board)
        under = ground[at] < np.float64(level)
        levels[at[0][under], at[1][under]] = level
    found, counts = np.unique(levels[levels > NO_LAKE], return_counts=True)
    for _ in range(LAKE_SHORE_SAMPLES):
        levels = _widened(levels, heights)
    return Lakes(heights, levels, dict(zip(found.tolist(), counts.tolist(), strict=True)))


def flooded(ground: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns how high water stands on (n, n) ground whose border is open: at least the ground, metres.

    A flood only compares heights, so it is one of whole numbers in the same order (docs/water.md).
    """
    return _from_order(find_water(_in_order(ground)).filled)


def _in_order(heights: NDArray[np.float32]) -> NDArray[np.int32]:
    """Whole numbers that compare as the heights do: the bits of a positive one, and for negative ones all but the sign
    turned round."""
    bits = (heights + np.float32(0.0)).view(np.int32)  # -0.0 becomes 0.0
    return bits ^ ((bits >> 31) & np.int32(0x7FFFFFFF))


def _from_order(order: NDArray[np.int32]) -> NDArray[np.float32]:
    return (order ^ ((order >> 31) & np.int32(0x7FFFFFFF))).view(np.float32)


def lake_texture(lakes: Lakes) -> NDArray[np.float32]:
    """Returns what shaders read of lakes: (n, n, 2), ground and level of each sample (``lakes`` in view.wgsl)."""
    return np.stack((lakes.heights, lakes.levels), axis=-1)


class Surfaces:
    """How high water may stand on the patches of any level."""

    def __init__(self, lakes: Lakes | None, sea_m: float | None) -> None:
        """``lakes``: of level LAKE_LEVEL."""
        self.sea = -np.inf if sea_m is None else sea_m
        self._tops: list[NDArray[np.float64]] = []
        if lakes is None or not lakes.any:
            return
        across = SUBPATCHES << LAKE_LEVEL + 2
        cells = (TILE_CELLS << LAKE_LEVEL) // across
        z = np.where(lakes.levels > NO_LAKE, lakes.levels, -np.inf).astype(np.float64)
        # A patch has the samples of its edges: cells, and one more.
        for axis in (0, 1):
            inner = np.maximum.reduceat(z, np.arange(across) * cells, axis=axis)
            z = np.maximum(inner, z[cells::cells] if axis == 0 else z[:, cells::cells])
        self._tops.append(z)
        while len(z) > SUBPATCHES:
            n = len(z) // 2
            z = z.reshape(n, 2, n, 2).max(axis=(1, 3))
            self._tops.append(z)
        self._tops.reverse()

    def highest(self, level: int, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
        """Metres, -inf where no water can be. ``nodes``: (n, 2) columns and rows of patches of ``level``."""
        out = np.full(len(nodes), self.sea)
        if self._tops:
            held = min(level, len(self._tops) - 1)
            at = nodes >> (level - held)
            out = np.maximum(out, self._tops[held][at[:, 1], at[:, 0]])
        return np.asarray(out)


def levels_on(lakes: Lakes, level: int, column: int, row: int) -> list[float]:
    """Levels of the lakes, rising, that may be seen on a patch."""
    cell = 1 << max(level - LAKE_LEVEL, 0)
    span = (TILE_CELLS // SUBPATCHES) << max(LAKE_LEVEL - level, 0)
    low_x, low_y = column * span // cell, row * span // cell
    high_x, high_y = -(-(column + 1) * span // cell), -(-(row + 1) * span // cell)
    part = lakes.levels[low_y : high_y + 1, low_x : high_x + 1]
    return sorted(set(part[part > NO_LAKE].tolist()))


def waves_of(lakes: Lakes, size_m: float) -> dict[float, float]:
    """Height of the waves on each lake in those of the sea, by their fetch: about the root of it."""
    cell = size_m / (TILE_CELLS << LAKE_LEVEL)
    return {lake: math.sqrt(min(1.0, math.sqrt(n) * cell / LAKE_FULL_FETCH_M)) for lake, n in lakes.samples.items()}


def _around(r: int, c: int, rows: int, cols: int) -> Iterator[tuple[int, int]]:
    for dy, dx in _MESH:
        if 0 <= r + dy < rows and 0 <= c + dx < cols:
            yield r + dy, c + dx


def _basins(wet: NDArray[np.bool_]) -> Iterator[list[tuple[int, int]]]:
    """Samples of each connected part."""
    left = wet.copy()
    rows, cols = wet.shape
    for r, c in zip(*np.nonzero(wet), strict=True):
        if not left[r, c]:
            continue
        left[r, c] = False
        basin = [(int(r), int(c))]
        for y, x in basin:
            for v, u in _around(y, x, rows, cols):
                if left[v, u]:
                    left[v, u] = False
                    basin.append((v, u))
        yield basin


def _widened(levels: Heights, heights: Heights) -> Heights:
    """Levels carried one sample further, over ground that is not below them; where lakes meet the lowest."""
    n = len(levels)
    around = np.full((n + 2, n + 2), np.inf)
    around[1:-1, 1:-1] = np.where(levels > NO_LAKE, levels, np.inf)
    best = np.full(levels.shape, np.inf)
    for dy in range(3):
        for dx in range(3):
            near = around[dy : dy + n, dx : dx + n]
            best = np.minimum(best, np.where(heights >= near, near, np.inf))
    free = (levels <= NO_LAKE) & (best < np.inf)
    return np.where(free, best, levels).astype(np.float32)
