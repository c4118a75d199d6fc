"""The ground that is exported: heights and covers of a level, of a window of it, or of a few samples less."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from esker import contract, grid
from esker.contract import TerrainSettings, fractal
from esker.exporting.resample import resampled
from esker.exporting.water import under_water
from esker.synthesis.lakes import find_lakes

Heights = NDArray[np.float32]
Mask = NDArray[np.uint8]
COVERS: Final = ("snow", "wetness", "grass", "forest")
"""Attributes of the synthesis that become masks, under their own names."""
WEAR: Final = "wear"
"""Mask of how far ground lies below what was drawn, of terrains with erosion: 255 is ``wear_m`` and more."""
BAND_SAMPLES: Final = 1 << 20
"""Samples whose attributes are held as numbers at a time; what is kept of them is a byte each."""
WHOLE: Final = 255


class Window(Protocol):
    """Heights of a rectangle, as ``Ground`` has them; with detail, attributes as ``Terrain.attributes`` has them."""

    @property
    def heights(self) -> Heights: ...
    @property
    def x_m(self) -> float: ...
    @property
    def y_m(self) -> float: ...
    @property
    def spacing_m(self) -> float: ...
    @property
    def attributes(self) -> Mapping[str, Heights]: ...


class HeightSource(Protocol):
    """What a file is written from. ``Terrain`` is one; its methods say what these give."""

    @property
    def settings(self) -> TerrainSettings: ...

    def heights(self, level: int) -> Heights:
        """Settled heights of a level."""
        ...

    def window(
        self,
        level: int,
        x0: float,
        y0: float,
        x1: float,
        y1: float,
        detail: bool = False,
        *,
        global_level: int = ...,
        refined_level: int = ...,
        progress: Progress | None = None,
    ) -> Window:
        """Settled heights of the samples of ``level`` in a rectangle of world metres."""
        ...


@dataclass(frozen=True, eq=False)
class Ground:
    """What is written. ``heights``: (rows, columns) float32, metres, row 0 south; sample [0, 0] lies at world
    (x_m, y_m), neighbours ``spacing_m`` apart. ``masks``: the same shape, uint8, 255 where there is all of it: COVERS,
    ``water`` and WEAR; empty where they were not asked for. ``lakes_m``: levels of the lakes, rising, metres.
    ``solved``: heights without detail, where they were asked for."""

    heights: Heights
    x_m: float
    y_m: float
    spacing_m: float
    settings: TerrainSettings
    masks: Mapping[str, Mask] = field(default_factory=dict)
    lakes_m: tuple[float, ...] = ()
    solved: Heights | None = None

    @property
    def range_m(self) -> tuple[float, float]:
        """The lowest and the highest sample, metres."""
        return float(self.heights.min()), float(self.heights.max())

    def facts(self) -> dict[str, Any]:
        """What other programs do not read from the heights, for side-cars and for text inside of files."""
        rows, columns = self.heights.shape
        low, high = self.range_m
        place = self.settings.place
        return {
            "title": self.settings.title,
            "samples": [columns, rows],
            "spacing_m": self.spacing_m,
            "size_m": [(columns - 1) * self.spacing_m, (rows - 1) * self.spacing_m],
            "south_west_m": [self.x_m, self.y_m],
            "terrain_m": self.settings.size_m,
            "low_m": low,
            "high_m": high,
            "sea_level_m": self.settings.sea_level_m,
            "lakes_m": list(self.lakes_m),
            "place": None if place is None else {"lat_deg": place.lat_deg, "lon_deg": place.lon_deg},
        }


@dataclass(frozen=True)
class Extent:
    """Which samples: ``samples`` a side of the whole terrain, taken from ``level``; or those of ``level`` inside
    ``window`` (x0, y0, x1, y1), world metres."""

    level: int
    samples: int
    window: tuple[float, float, float, float] | None = None

    @classmethod
    def of(
        cls, level: int | None, samples: int | None, window: tuple[float, float, float, float] | None = None
    ) -> Extent:
        """From what somebody says: a level, or samples a side; DEFAULT_LEVEL without. Raises ValueError."""
        if level is not None and samples is not None:
            raise ValueError("say a level or how many samples a side, not both")
        if samples is None:
            level = contract.DEFAULT_LEVEL if level is None else level
            if window is None and not 0 <= level <= contract.MAX_LEVEL:
                raise ValueError(f"level must be 0..{contract.MAX_LEVEL}, not {level}")
            return cls(level, grid.samples(level), window)
        known = contract.EXPORT_LEVELS.get(str(samples))
        if known is None or window is not None:
            there = ", ".join(contract.EXPORT_LEVELS)
            raise ValueError(
                "a window is exported by level" if known is not None else f"samples a side must be one of {there}"
            )
        return cls(known, samples, None)


Progress = Callable[[float], None]


def take(
    terrain: HeightSource,
    extent: Extent,
    *,
    detail: bool,
    masks: bool,
    solved: bool = False,
    progress: Progress | None = None,
    **levels: int,
) -> Ground:
    """The ground of a terrain: ``Terrain.heights`` of a level that is solved as a whole, else ``Terrain.window``,
    interpolated where ``extent`` has a few samples less than its level. ``masks``: with covers, which come with the
    detail; ``solved``: beside them the heights without it; ``levels``: ``global_level`` and, for the detail,
    ``refined_level``. Raises ValueError, and what solves raise."""
    if not detail and not masks:
        ground = _plain(terrain, extent, progress, levels)
    else:
        ground = _detailed(terrain, extent, progress, levels, masks)
        if solved or not detail:
            plain = _plain(terrain, extent, None, levels).heights
            ground = replace(ground, solved=plain if solved else None, heights=ground.heights if detail else plain)
    if extent.window is None and extent.samples != grid.samples(extent.level):
        ground = _fewer(ground, extent.samples)
    return _with_water(terrain, ground, levels.get("global_level", contract.DEFAULT_LEVEL)) if masks else ground


def _plain(terrain: HeightSource, extent: Extent, progress: Progress | None, levels: Mapping[str, int]) -> Ground:
    """Without detail. What lies above the levels that are solved as a whole is refined, as the page shows it: to solve
    the finest level as a whole takes gigabytes, most of them for what has been settled already."""
    if extent.window is None and extent.level <= levels.get("global_level", contract.DEFAULT_LEVEL):
        s = grid.spacing(extent.level, terrain.settings.size_m)
        return Ground(terrain.heights(extent.level), 0.0, 0.0, s, terrain.settings)
    return _in_bands(terrain, extent, progress, False, levels, ())


def _detailed(
    terrain: HeightSource, extent: Extent, progress: Progress | None, levels: Mapping[str, int], masks: bool
) -> Ground:
    """With detail: seven attributes of a large level take more memory than all else together."""
    return _in_bands(terrain, extent, progress, True, levels, _covers(terrain.settings) if masks else ())


def _in_bands(
    terrain: HeightSource,
    extent: Extent,
    progress: Progress | None,
    detail: bool,
    levels: Mapping[str, int],
    covers: tuple[str, ...],
) -> Ground:
    """In bands of rows, which begin where tiles do: of each only what is kept stays in memory."""
    settings, level = terrain.settings, extent.level
    size = settings.size_m
    r0, r1, c0, c1 = grid.Rect(*(extent.window or (0.0, 0.0, size, size))).sample_window(level, size)
    if r0 >= r1 or c0 >= c1:
        raise ValueError(f"no sample of level {level} lies in that window; the terrain is {size:g} m wide")
    if (r1 - r0) * (c1 - c0) > contract.MAX_GRID_SAMPLES:
        raise ValueError(
            f"that window holds {c1 - c0:,} x {r1 - r0:,} samples of level {level}; a file has at most "
            f"{contract.MAX_GRID_SAMPLES:,}"
        )
    s = grid.spacing(level, size)
    heights = np.empty((r1 - r0, c1 - c0), dtype=np.float32)
    masks = {name: np.empty(heights.shape, dtype=np.uint8) for name in covers}
    for start, stop in bands(r0, r1, c1 - c0):

        def report(share: float, start: int = start, stop: int = stop) -> None:
            if progress is not None:
                progress((start - r0 + (stop - start) * share) / (r1 - r0))

        # A quarter of a cell beyond its samples, which rounding does not lose.
        corners = ((c0 - 0.25) * s, (start - 0.25) * s, (c1 - 0.75) * s, (stop - 0.75) * s)
        found = terrain.window(level, *corners, detail=detail, progress=report, **levels)
        heights[start - r0 : stop - r0] = found.heights
        for name, mask in masks.items():
            share = (
                found.attributes[name] if name != WEAR else found.attributes["detail"] / np.float32(-wear_m(settings))
            )
            mask[start - r0 : stop - r0] = eight_bits(share)
    return Ground(heights, c0 * s, r0 * s, s, settings, masks)


def bands(start: int, stop: int, columns: int) -> Iterator[tuple[int, int]]:
    """Rows ``start`` to ``stop`` in parts of about BAND_SAMPLES, whole rows of tiles where there is room for one."""
    rows = max(1, BAND_SAMPLES // columns)
    step = max(contract.TILE_CELLS, rows - rows % contract.TILE_CELLS) if rows >= contract.TILE_CELLS else rows
    while start < stop:
        end = min(stop, start + step - start % step)
        yield start, end
        start = end


def wear_m(settings: TerrainSettings) -> float:
    """Depth of which the mask of wear is a share, metres: a bed of the coarsest gullies on a steep flank."""
    wave_m = settings.erosion_scale * grid.spacing(1, settings.size_m)
    return fractal.GULLY_MOST * fractal.GULLY_DEPTH * fractal.GULLY_STEEP * wave_m


def _covers(settings: TerrainSettings) -> tuple[str, ...]:
    """Masks that come with the detail of a terrain."""
    return (*COVERS, WEAR) if settings.rule == "landscape" and settings.erosion > 0 else COVERS


def _fewer(ground: Ground, samples: int) -> Ground:
    """The whole terrain with ``samples`` a side."""
    spacing = ground.settings.size_m / (samples - 1)
    masks = {
        name: np.rint(np.clip(resampled(mask, samples), 0.0, WHOLE)).astype(np.uint8)
        for name, mask in ground.masks.items()
    }
    solved = None if ground.solved is None else resampled(ground.solved, samples)
    return replace(ground, heights=resampled(ground.heights, samples), spacing_m=spacing, masks=masks, solved=solved)


def _with_water(terrain: HeightSource, ground: Ground, global_level: int) -> Ground:
    """With the mask of the sea and of the lakes, which stand in the solved ground of LAKE_LEVEL."""
    settings = ground.settings
    lakes = None
    if settings.lakes_m is not None:
        top = max(global_level, contract.LAKE_LEVEL)
        step = 1 << (top - contract.LAKE_LEVEL)
        cell = grid.spacing(contract.LAKE_LEVEL, settings.size_m)
        solved = np.ascontiguousarray(terrain.heights(top)[::step, ::step])
        lakes = find_lakes(solved, cell, settings.lakes_m, settings.sea_level_m)
    per_m = (grid.samples(contract.LAKE_LEVEL) - 1) / settings.size_m
    rows, columns = ground.heights.shape
    u, v = (
        (corner + np.arange(n, dtype=np.float64) * ground.spacing_m) * per_m
        for corner, n in ((ground.x_m, columns), (ground.y_m, rows))
    )
    wet = under_water(ground.heights, u, v, lakes, settings.sea_level_m)
    water = np.where(wet, np.uint8(WHOLE), np.uint8(0))
    found = () if lakes is None else tuple(sorted(lakes.samples))
    return replace(ground, masks={**ground.masks, "water": water}, lakes_m=found)


def eight_bits(values: NDArray[np.float32]) -> Mask:
    """0..1 in steps of 1/255."""
    steps: Mask = np.rint(np.clip(values, 0.0, 1.0) * WHOLE).astype(np.uint8)
    return steps
