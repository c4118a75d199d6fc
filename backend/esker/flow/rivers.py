"""Rivers in metres: lines over the ground with the area, width and depth at both ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esker.flow.reaches import NO_REACH, UNITS_PER_CELL, bankfull, find_reaches
from esker.flow.water import Water, find_water, quanta, sea_quanta

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class River:
    """A river from its head, or a confluence, down to the next.

    ``points``: (points, 2) float64, x and y in metres, at least two. ``area_m2``, ``width_m``, ``depth_m``: at its head
    and at its end. ``next``: the index, among all rivers, of the one that it runs into; None at the border or the sea.
    """

    points: Floats
    area_m2: tuple[float, float]
    width_m: tuple[float, float]
    depth_m: tuple[float, float]
    next: int | None


def water_of(heights: NDArray[Any], size_m: float, sea_m: float | None) -> Water:
    """The water of a whole level, heights in metres, row 0 south. Raises ValueError for what is no ground."""
    cell_m = size_m / (len(heights) - 1)
    return find_water(quanta(heights, cell_m), sea_quanta(sea_m, cell_m))


def rivers_of(water: Water, size_m: float, many: float, wetness: float) -> tuple[River, ...]:
    """The rivers of a terrain, each before the one that it runs into."""
    reaches = find_reaches(water, many)
    cell_m = size_m / (max(water.shape) - 1)
    areas = reaches.areas.astype(np.float64) * (cell_m * cell_m)
    widths, depths = bankfull(areas, wetness)
    lines = reaches.points.astype(np.float64) * (cell_m / UNITS_PER_CELL)
    found = []
    for k in range(len(reaches)):
        following = int(reaches.next[k])
        area, width, depth = ((float(pair[0]), float(pair[1])) for pair in (areas[k], widths[k], depths[k]))
        points = lines[reaches.start[k] : reaches.start[k + 1]]
        found.append(River(points, area, width, depth, None if following == NO_REACH else following))
    return tuple(found)
