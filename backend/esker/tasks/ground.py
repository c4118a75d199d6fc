"""What a rule measures on the samples of a level: heights along lines, water that is held, land, watersheds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import QUANTA_PER_CELL, RING_SHARE
from esker.flow.pools import pool, sea
from esker.flow.rivers import water_of
from esker.flow.water import Water, quanta, sea_quanta

Floats = NDArray[np.float64]

MOST_STEPS: Final = 2_048
"""Steps along a path, whose slope is taken between neighbours about a cell apart."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A level of a terrain. ``heights``: (n, n) finite metres, row 0 south."""

    heights: NDArray[Any]
    size_m: float
    sea_m: float | None = None

    @property
    def cell_m(self) -> float:
        """Distance of neighbouring samples."""
        return self.size_m / (len(self.heights) - 1)

    @cached_property
    def steps(self) -> NDArray[np.int32]:
        """The heights in whole steps, as running water takes them."""
        return quanta(self.heights, self.cell_m)

    @cached_property
    def water(self) -> Water:
        """Where rain runs."""
        return water_of(self.heights, self.size_m, self.sea_m)

    def index(self, point: tuple[float, float]) -> int:
        """The sample nearest to a place; of one beyond the border the nearest at it."""
        n = len(self.heights)
        col, row = (min(max(round(v / self.cell_m), 0), n - 1) for v in point)
        return row * n + col

    def ring(self, point: tuple[float, float]) -> NDArray[np.int64]:
        """The samples in the ring around a place; at least the nearest."""
        n = len(self.heights)
        reach = int(RING_SHARE * self.size_m / self.cell_m)
        row, col = divmod(self.index(point), n)
        rows, cols = np.mgrid[
            max(row - reach, 0) : min(row + reach, n - 1) + 1, max(col - reach, 0) : min(col + reach, n - 1) + 1
        ]
        near = (rows - row) ** 2 + (cols - col) ** 2 <= reach * reach
        return np.asarray((rows * n + cols)[near], dtype=np.int64)

    def along(self, points: Floats) -> Floats:
        """Heights at (k, 2) places, bilinear; beyond the border those at it."""
        n = len(self.heights)
        at = np.clip(np.asarray(points, np.float64) / self.cell_m, 0, n - 1)
        low = np.minimum(at.astype(np.int64), n - 2)
        (u, v), (col, row) = (at - low).T, low.T
        z = self.heights.astype(np.float64)
        south = z[row, col] * (1 - u) + z[row, col + 1] * u
        north = z[row + 1, col] * (1 - u) + z[row + 1, col + 1] * u
        return np.asarray(south * (1 - v) + north * v)

    def grades(self, path: tuple[tuple[float, float], ...]) -> tuple[Floats, Floats]:
        """Rise over run of each step along a path, and how long each step is."""
        lengths, grades = [], []
        corners = np.asarray(path, np.float64)
        whole = float(np.hypot(*np.diff(corners, axis=0).T).sum())
        step = max(self.cell_m, whole / MOST_STEPS)
        for a, b in pairwise(corners):
            length = float(np.hypot(*(b - a)))
            if length > 0:
                count = max(1, round(length / step))
                z = self.along(a + (b - a) * np.linspace(0, 1, count + 1)[:, None])
                grades.append(np.abs(np.diff(z)) / (length / count))
                lengths.append(np.full(count, length / count))
        if not lengths:
            return np.zeros(0), np.zeros(0)
        return np.concatenate(grades), np.concatenate(lengths)

    def held(self, point: tuple[float, float], level_m: float) -> tuple[float, float]:
        """Cubic metres of water around the lowest ground in a ring, and the height at which it stands.

        That is no higher than ``level_m``, and than where it would run over.
        """
        ring = self.ring(point)
        index = int(ring[np.argmin(self.steps.ravel()[ring])])
        top = min(sea_quanta(level_m, self.cell_m), int(self.water.filled.ravel()[index]))
        wet = pool(self.steps, index, top)
        step = self.cell_m / QUANTA_PER_CELL
        return float((top - self.steps[wet]).sum(dtype=np.float64)) * step * self.cell_m**2, top * step

    def land(self, level_m: float, dry: bool) -> float:
        """Square metres above a level; ``dry``: or lower, where a sea at that level does not come."""
        level = sea_quanta(level_m, self.cell_m)
        under = sea(self.steps, level) if dry else self.steps < level
        return float(under.size - under.sum()) / under.size * self.size_m**2

    def watershed(self, point: tuple[float, float]) -> float:
        """Square metres whose rain runs through the ring around a place, by the way that most of it takes."""
        area = self.water.area.ravel()
        return float(area[self.ring(point)].max()) / area.size * self.size_m**2
