"""How water runs over ground of integer heights: the front of this room.

>>> import numpy as np
>>> crater = np.array([[9, 9, 9, 9, 9], [9, 7, 7, 7, 9], [9, 7, 3, 7, 6], [9, 7, 7, 7, 9], [9, 9, 9, 9, 9]], np.int32)
>>> water = find_water(crater)
>>> water.filled[2].tolist()
[9, 7, 7, 7, 6]
>>> int(water.area[2, 4])
10
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from esker.contract import QUANTA_PER_CELL
from esker.flow import area, basins, paths, receivers

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]

NO_SEA: Final = -(1 << 40)
"""A sea below all ground."""
MOST_SAMPLES: Final = 1 << 30
"""Indices and areas of so many samples fit 32 bits."""
MOST_QUANTA: Final = (1 << 31) - 1


@dataclass(frozen=True, eq=False)
class Water:
    """Running water on a grid.

    ``z``: the ground, int32 (rows, cols). ``receiver``: the index of the sample that each runs to, ``receivers.OUT`` at
    the border and in the sea. ``filled``: how high water or ground stands. ``area``: samples that run through each.
    ``basin``: 0 where water runs out without a lake, else the number of a basin. ``spill``: at which height each basin
    runs over, by its number.
    """

    z: Ints
    receiver: Ints
    filled: Ints
    area: Ints
    basin: Ints
    spill: NDArray[np.int64]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, cols = self.z.shape
        return rows, cols

    def watershed(self, index: int) -> Mask:
        """The samples that run through one, itself among them: (rows, cols)."""
        inside = np.zeros(self.z.size, np.int8)
        paths.mark_upstream(self.receiver.ravel(), index, inside)
        return np.asarray(inside.reshape(self.shape) == paths.INSIDE)

    def raindrop(self, index: int) -> Ints:
        """The samples that a drop passes that falls on one, down to the border or the sea."""
        way = np.empty(self.z.size, np.int32)
        return way[: paths.follow(self.receiver.ravel(), index, way)].copy()

    def highest(self) -> Ints:
        """The highest ground that runs through each sample: (rows, cols)."""
        top = np.empty(self.z.size, np.int32)
        area.highest_above(self.receiver.ravel(), self.z.ravel(), top, np.empty(self.z.size, np.int8))
        return top.reshape(self.shape)


def quanta(heights: NDArray[Any], cell_m: float) -> Ints:
    """Heights in whole steps of ``cell_m`` / 256, halves to even.

    Raises ValueError for heights that are not finite, or that are too many steps for 32 bits.
    """
    steps = heights.astype(np.float64) * (QUANTA_PER_CELL / cell_m)
    if not np.isfinite(steps).all():
        raise ValueError("water needs ground: some of these heights are not finite numbers")
    if steps.size and np.abs(steps).max() > MOST_QUANTA:
        raise ValueError("these heights are too large for cells so small: no water can be followed over them")
    return np.asarray(np.rint(steps), dtype=np.int32)


def sea_quanta(sea_m: float | None, cell_m: float) -> int:
    """The highest whole step of ``cell_m`` / 256 that the sea covers; NO_SEA without a sea."""
    if sea_m is None:
        return NO_SEA
    return max(NO_SEA, min(math.floor(sea_m * (QUANTA_PER_CELL / cell_m)), MOST_QUANTA))


def find_water(z: Ints, sea: int = NO_SEA) -> Water:
    """Where the water of each sample runs to, where it stands, and how much of it passes.

    Parameters
    ----------
    z: int32 (rows, cols), row 0 south. The border is open.
    sea: samples at this height or below are the sea's, to which water runs as it does to the border.

    Raises
    ------
    ValueError: ``z`` is not such a grid.
    """
    if z.ndim != 2 or z.dtype != np.int32 or not 0 < z.size <= MOST_SAMPLES:
        raise ValueError(f"water runs over an int32 grid of rows and columns, not over {z.dtype} {z.shape}")
    z = np.ascontiguousarray(z)
    receiver = np.empty(z.shape, np.int32)
    receivers.steepest(z, sea, receiver)
    to, order = receiver.ravel(), np.empty(z.size, np.int32)
    receivers.across_flats(z, to, order)
    areas, coming = np.empty(z.size, np.int32), np.empty(z.size, np.int8)
    area.gather(to, areas, order, coming)
    basin = np.empty(z.size, np.int32)
    count = basins.label(to, order, basin)
    passes = _passes(z, basin, count)
    spill = np.full(count + 1, basins.LOWEST, np.int64)
    exits = np.zeros((2, count + 1), np.int32)
    basins.flood(count, passes, spill, exits[0], exits[1])
    own = np.empty(z.size, np.int32)
    found = area.find_trunks(to, areas, count, exits[0], exits[1], coming, order, own)
    basins.turn_round(to, count, exits[0], exits[1])
    area.gather_trunks(to, areas, coming, order, found, own)
    filled = own  # no longer needed as what it was
    basins.fill(z.ravel(), basin, spill, filled)
    shape = z.shape
    return Water(z, receiver, filled.reshape(shape), areas.reshape(shape), basin.reshape(shape), spill)


def _passes(z: Ints, basin: Ints, count: int) -> NDArray[np.int64]:
    """The lowest passes between basins, in a table that is large enough for them."""
    capacity = 1 << max(6, (8 * (count + 1)).bit_length())
    while True:
        passes = np.full((capacity, 4), -1, np.int64)
        if basins.find_passes(z, basin, count, passes) >= 0:
            return passes
        capacity *= 4
