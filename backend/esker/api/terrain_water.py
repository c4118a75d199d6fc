"""Running water on a terrain without a server: rivers, watersheds, and the way of a raindrop (docs/water.md)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker import contract
from esker.api import arguments
from esker.contract import TerrainSettings
from esker.flow import pour as pouring
from esker.flow.rivers import River, rivers_of, water_of
from esker.flow.water import Water

Heights = NDArray[np.float32]
MOST_POURED_M3: Final = 1e15
MOST_RAIN_MM: Final = 100_000.0


@dataclass(frozen=True, eq=False)
class Watershed:
    """All ground that drains through a point.

    ``inside``: bool (N, N), row 0 south. ``area_m2``: how much it is. ``point``: x and y of the sample through which it
    drains, metres.
    """

    inside: NDArray[np.bool_]
    area_m2: float
    point: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Raindrop:
    """The way of a drop, from where it falls to where it leaves.

    ``points``: (points, 3) float64, x, y and the height of the ground, metres. ``distance_m``: along the way, from
    above. ``water_m``: how high water stands there: the ground, or the surface of the lake that covers it.
    ``reaches_sea``: it ends in the sea, and not at the border.
    """

    points: NDArray[np.float64]
    distance_m: NDArray[np.float64]
    water_m: NDArray[np.float64]
    reaches_sea: bool


@dataclass(frozen=True, eq=False)
class Lake:
    """Water that stands in one hollow, or in several that have joined.

    ``inside``: bool (N, N), the samples below its level, row 0 south. ``depth_m``: at its deepest sample.
    """

    inside: NDArray[np.bool_]
    level_m: float
    volume_m3: float
    area_m2: float
    depth_m: float


@dataclass(frozen=True, eq=False)
class Flood:
    """Where water stands that was poured out at a point.

    ``lakes``: in the order in which they fill; none where water runs off. ``runs_off_m3``: what leaves at the border or
    into the sea. ``watershed_m2``: what drains through the brim of the lake, or through the point where there is none.
    """

    lakes: tuple[Lake, ...]
    poured_m3: float
    runs_off_m3: float
    watershed_m2: float


class TerrainWater(ABC):
    """The part of ``Terrain`` that follows water. All of it sees the ground with its detail."""

    _settings: TerrainSettings
    _water: tuple[Heights, float | None, Water] | None = None
    """The water found last, with the heights and the sea that it is of."""

    @abstractmethod
    def heights(self, level: int = ..., detail: bool = ...) -> Heights:
        """Settled heights of a level."""

    def rivers(
        self, level: int = contract.DEFAULT_LEVEL, many: float | None = None, wetness: float | None = None
    ) -> tuple[River, ...]:
        """The rivers of the terrain as lines.

        Parameters
        ----------
        level: 0..6, whose samples the water runs over; a finer one has the same rivers, drawn more exactly.
        many: how many rivers, 0..4; 1 asks for a 256th of the terrain's area above each. By default as many as the
            settings say, and 1 where they ask for none.
        wetness: how many times as much water they carry, 0.1..10; by default what the settings say.

        Returns
        -------
        Rivers, each before the one that it runs into: ``points`` (x, y), and ``area_m2``, ``width_m``, ``depth_m`` at
        both ends.

        Raises
        ------
        ValueError: a number is out of its range.

        Examples
        --------
        >>> from esker import Stroke, Terrain
        >>> t = Terrain(size_m=2048)
        >>> for x in (300, 1700):
        ...     _ = t.add(Stroke.profile([(x, 100, 300), (x, 1000, 500), (x, 1900, 400)]))
        >>> rivers = t.rivers(level=2)
        >>> largest = max(rivers, key=lambda river: river.area_m2[1])
        >>> largest.points.shape[1], largest.next, bool(largest.width_m[1] > 0.5)
        (2, None, True)
        """
        asked = self._settings.rivers or contract.DEFAULT_RIVERS
        many = asked if many is None else arguments.number("many", many, 0, contract.MAX_RIVERS)
        least, most = contract.MIN_WETNESS, contract.MAX_WETNESS
        wet = self._settings.wetness if wetness is None else arguments.number("wetness", wetness, least, most)
        return rivers_of(self._running(level), self._settings.size_m, many, wet)

    def watershed(self, x: float, y: float, level: int = contract.DEFAULT_LEVEL) -> Watershed:
        """All ground whose water passes a point.

        Parameters
        ----------
        x, y: the point, metres; the sample that is nearest to it counts.
        level: 0..6, whose samples the water runs over.

        Raises
        ------
        ValueError: the point lies outside of the terrain, or there is no such level.

        Examples
        --------
        >>> from esker import Stroke, Terrain
        >>> t = Terrain(size_m=2048)
        >>> _ = t.add(Stroke.profile([(200, 1000, 0), (1000, 1000, 400), (1800, 1000, 0)]))
        >>> shed = t.watershed(1000, 400, level=1)
        >>> shed.inside.shape, shed.area_m2 / 16.0**2 == int(shed.inside.sum())
        ((129, 129), True)
        """
        water, index = self._at(x, y, level)
        inside = water.watershed(index)
        cell_m = self._settings.size_m / (len(inside) - 1)
        row, col = divmod(index, len(inside))
        return Watershed(inside, int(inside.sum()) * cell_m * cell_m, (col * cell_m, row * cell_m))

    def raindrop(self, x: float, y: float, level: int = contract.DEFAULT_LEVEL) -> Raindrop:
        """The way of a drop that falls on a point, and its profile.

        Parameters
        ----------
        x, y, level: those of ``watershed``.

        Raises
        ------
        ValueError: as ``watershed`` does.

        Examples
        --------
        >>> from esker import Stroke, Terrain
        >>> t = Terrain(size_m=2048)
        >>> _ = t.add(Stroke.profile([(200, 1000, 0), (1000, 1000, 400), (1800, 1000, 0)]))
        >>> way = t.raindrop(1000, 900, level=1)
        >>> bool((np.diff(way.water_m) <= 0).all()), way.reaches_sea
        (True, False)
        """
        water, index = self._at(x, y, level)
        way = water.raindrop(index)
        n = water.shape[0]
        cell_m = self._settings.size_m / (n - 1)
        quantum_m = cell_m / contract.QUANTA_PER_CELL
        ground, stands = (field.ravel()[way].astype(np.float64) * quantum_m for field in (water.z, water.filled))
        points = np.stack((way % n * cell_m, way // n * cell_m, ground), axis=1)
        steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
        row, col = divmod(int(way[-1]), n)
        at_border = row in (0, n - 1) or col in (0, n - 1)
        return Raindrop(points, np.concatenate(([0.0], np.cumsum(steps))), stands, not at_border)

    def flood(
        self,
        x: float,
        y: float,
        volume_m3: float | None = None,
        rain_mm: float | None = None,
        level: int = contract.DEFAULT_LEVEL,
    ) -> Flood:
        """How high water stands that is poured out at a point, or that falls as rain on the lake's watershed.

        Hollows are empty at first; each runs over at its lowest brim into the next.

        Parameters
        ----------
        x, y: the point, metres; the sample that is nearest to it counts.
        volume_m3: how much water, or
        rain_mm: how much rain on all ground that drains through the brim of the lake below the point.
        level: 0..6, whose samples hold the water.

        Raises
        ------
        ValueError: the point lies outside of the terrain, there is no such level, a number is out of its range, or not
            exactly one of ``volume_m3`` and ``rain_mm`` was said.

        Examples
        --------
        >>> from esker import Stroke, Terrain
        >>> t = Terrain(size_m=2048)
        >>> for x in (500, 1500):
        ...     _ = t.add(Stroke.profile([(x, 300, 300), (x, 1700, 300)]))
        >>> for y in (500, 1500):
        ...     _ = t.add(Stroke.profile([(300, y, 250), (1700, y, 250)]))
        >>> flood = t.flood(1000, 1000, volume_m3=1e6, level=1)
        >>> round(sum(lake.volume_m3 for lake in flood.lakes) + flood.runs_off_m3)
        1000000
        """
        if (volume_m3 is None) == (rain_mm is None):
            raise ValueError("say either volume_m3 or rain_mm, not both or neither")
        water, index = self._at(x, y, level)
        cell_m = self._settings.size_m / (water.shape[0] - 1)
        quantum_m, cell_m2 = cell_m / contract.QUANTA_PER_CELL, cell_m * cell_m
        out = pouring.brim(water, index)
        shed_m2 = int(water.area.ravel()[index if out < 0 else out]) * cell_m2
        if volume_m3 is not None:
            poured_m3 = arguments.number("volume_m3", volume_m3, 0, MOST_POURED_M3)
        else:
            poured_m3 = arguments.number("rain_mm", rain_mm, 0, MOST_RAIN_MM) / 1000 * shed_m2
        step_m3 = quantum_m * cell_m2
        found = pouring.pour(water, index, poured_m3 / step_m3)
        lakes = []
        for pool in found.pools:
            inside = np.zeros(water.z.size, np.bool_)
            inside[pool.samples] = True
            deepest = pool.level - float(water.z.ravel()[pool.samples].min()) if pool.samples.size else 0.0
            lakes.append(
                Lake(
                    inside.reshape(water.shape),
                    pool.level * quantum_m,
                    pool.volume * step_m3,
                    pool.samples.size * cell_m2,
                    deepest * quantum_m,
                )
            )
        return Flood(tuple(lakes), poured_m3, found.left * step_m3, shed_m2)

    def _at(self, x: float, y: float, level: int) -> tuple[Water, int]:
        """The water of a level, and the index of the sample that is nearest to a point."""
        size = self._settings.size_m
        x, y = (arguments.number(name, at, 0, size) for name, at in (("x", x), ("y", y)))
        water = self._running(level)
        n = water.shape[0]
        col, row = (round(at * (n - 1) / size) for at in (x, y))
        return water, row * n + col

    def _running(self, level: int) -> Water:
        level = arguments.whole("level", level, 0, contract.MAX_LEVEL)
        ground, sea = self.heights(level, True), self._settings.sea_level_m
        held = self._water
        if held is None or held[0] is not ground or held[1] != sea:
            held = self._water = ground, sea, water_of(ground, self._settings.size_m, sea)
        return held[2]
