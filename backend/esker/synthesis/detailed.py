"""A settled terrain with its detail: heights and attributes of any window of any level, as the page shows them.

The page knows heights as integers on the wire; so does this. Above the levels that were solved as a whole the base is
refined where the caller can refine it, and interpolated beyond (docs/synthesis.md, "Two grounds").
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import (
    AMPLITUDE_QUANTA_PER_M,
    BASE_AMPLITUDE_M,
    BASE_BIAS,
    BASE_FAR,
    BASE_ROUGHNESS,
    BASE_SURVEY,
    BIAS_QUANTA,
    FAR_QUANTA,
    ROUGHNESS_QUANTA,
    SURVEY_QUANTA,
    TILE_CELLS,
    TerrainSettings,
)
from esker.synthesis import subdivide
from esker.synthesis.interpolate import Window
from esker.synthesis.site import BORDER, Biases, Grid, Site, extended
from esker.synthesis.state import Array, State
from esker.synthesis.subdivide import Samples, interpolated

Refine = Callable[[int, slice, slice], Grid]
"""(level, rows, columns) -> settled heights, metres, of samples inside the domain."""
WIRE_LIMIT: Final = 1 << 28
"""Heights saturate at so many quanta on the wire."""
BAND_SAMPLES: Final = 1 << 18
"""Samples that are made at a time: what a window holds beyond its result is some 100 bytes times this."""
NAMES: Final = dict(
    zip(State._fields, ("detail", "smoothness", "snow", "wetness", "grass", "forest", "foam"), strict=True)
)
"""What the fields of a state are called outside of this room."""
QUANTA: Final = {
    "amplitude": (AMPLITUDE_QUANTA_PER_M, BASE_AMPLITUDE_M),
    "roughness": (ROUGHNESS_QUANTA, BASE_ROUGHNESS),
    "survey": (SURVEY_QUANTA, BASE_SURVEY),
    "far": (FAR_QUANTA, BASE_FAR),
} | dict.fromkeys(("snow", "grass", "forest", "wetness", "erosion"), (BIAS_QUANTA, BASE_BIAS))


class Maker(Protocol):
    """A maker of samples: ``kernels.Kernels``, or the twin."""

    def detail(self, site: Site, window: Window) -> Samples: ...


class NumpyMaker:
    """The twin as a maker."""

    def detail(self, site: Site, window: Window) -> Samples:
        """See ``subdivide.detail``."""
        return subdivide.detail(site, window)


@dataclass(frozen=True)
class Detail:
    """A window with detail. ``heights``: (rows, columns) float32, metres; ``attributes``: the same shape, by name.

    Attributes: detail (metres, part of the heights), smoothness (the exponent h, 0..2), snow, wetness, grass, forest
    and foam (0..1).
    """

    heights: Grid
    attributes: Mapping[str, Grid]


def on_the_wire(heights: Grid, level: int, size_m: float, base: Grid | None = None) -> Grid:
    """Heights as every client has them: rounded to quanta of the level, halves to even, then metres again.

    ``base``: of elevation layers, the same shape; it travels by itself, rounded by itself, and is added.
    """
    q = grid.quantum(level, size_m)
    steps = _steps(heights, q) if base is None else _steps(heights, q) + _steps(base, q)
    metres: Grid = (steps * q).astype(np.float32)
    return metres


def _steps(heights: Grid, q: float) -> NDArray[np.float64]:
    steps: NDArray[np.float64] = np.rint(np.clip(heights * np.float32(1.0 / q), -WIRE_LIMIT, WIRE_LIMIT)).astype(
        np.float64
    )
    return steps


def site_of(
    settings: TerrainSettings,
    heights: NDArray[np.float32],
    channels: Mapping[str, Grid],
    base: Sequence[Grid] = (),
    ground_m: tuple[float, float] | None = None,
) -> Site:
    """The site of a settled solve. ``heights``: (N, N) float32 of level G, metres; ``channels``: by the names of
    ``Biases``, (n, n) as the solver gives them. ``base``: levels 0..G of the elevation layers' ground, on which
    ``heights`` are then offsets; ``ground_m``: lowest and highest sample of those layers. Raises ValueError for shapes
    that do not fit."""
    top = ((len(heights) - 1) // TILE_CELLS).bit_length() - 1
    if len(base) not in {0, top + 1}:
        raise ValueError(f"the base has {len(base)} levels, not {top + 1}")
    guides = tuple(
        on_the_wire(
            np.ascontiguousarray(heights[:: 1 << (top - k), :: 1 << (top - k)]),
            k,
            settings.size_m,
            base[k] if base else None,
        )
        for k in range(top + 1)
    )
    return Site(
        settings.size_m, settings.seed, guides,
        {name: _rounded(values, *QUANTA[name]) for name, values in channels.items() if name in Biases._fields},
        settings.detail, settings.rule, settings.look, settings.sea_level_m,
        lat_deg=None if settings.place is None else settings.place.lat_deg, ground_m=ground_m,
        erosion=settings.erosion, erosion_scale=settings.erosion_scale, hold=settings.hold,
    )  # fmt: skip


def _rounded(values: Grid, quanta: int, base: float) -> Grid:
    steps = np.rint((values - np.float32(base)) * np.float32(quanta))
    rounded: Grid = (steps.astype(np.float64) / quanta + base).astype(np.float32)
    return rounded


class DetailedTerrain:
    """Makes windows of one settled terrain.

    ``refine`` gives the base of levels above the site's solved ones, up to ``finest``; without it, and in cyclic
    domains, it is interpolated. ``ground``: the elevation layers' ground of those levels, on which ``refine`` gives
    offsets.
    """

    def __init__(
        self,
        site: Site,
        maker: Maker | None = None,
        refine: Refine | None = None,
        finest: int = 0,
        ground: Refine | None = None,
    ) -> None:
        self.site, self._maker = site, maker or NumpyMaker()
        self._refine, self._ground = refine, ground
        self.finest = max(site.solved, 0 if refine is None or site.cyclic else finest)
        """The finest level of which the base is not interpolated."""

    def window(self, level: int, rows: slice, cols: slice, progress: Callable[[float], None] | None = None) -> Detail:
        """Heights and attributes of a rectangle of samples. ``progress`` is told the share that is done.

        Raises ValueError for a level beyond ``subdivide.finest_level``, and for slices outside of the level.
        """
        shape = rows.stop - rows.start, cols.stop - cols.start
        heights = np.empty(shape, dtype=np.float32)
        attributes = {name: np.empty(shape, dtype=np.float32) for name in NAMES.values()}
        for at, window in self._bands(level, rows, cols, progress):
            state = self._maker.detail(self.site, window).state
            heights[at] = self.base(window) + state.d
            for field, name in NAMES.items():
                attributes[name][at] = getattr(state, field)
        return Detail(heights, attributes)

    def heights(self, level: int, rows: slice, cols: slice, progress: Callable[[float], None] | None = None) -> Grid:
        """The heights of ``window`` alone, by the twin: what they do not follow from is not made. Raises as it does."""
        heights = np.empty((rows.stop - rows.start, cols.stop - cols.start), dtype=np.float32)
        for at, window in self._bands(level, rows, cols, progress):
            heights[at] = self.base(window) + subdivide.relief(self.site, window)
        return heights

    def _bands(
        self, level: int, rows: slice, cols: slice, progress: Callable[[float], None] | None
    ) -> Iterator[tuple[slice, Window]]:
        """A rectangle in parts of BAND_SAMPLES at most: where each lies in it, and its window."""
        most = subdivide.finest_level(self.site.size_m)
        if not 0 <= level <= most:
            raise ValueError(f"level must be 0..{most} for a terrain of {self.site.size_m:g} m, not {level}")
        n = grid.samples(level)
        if not (0 <= rows.start < rows.stop <= n and 0 <= cols.start < cols.stop <= n):
            raise ValueError(f"level {level} has samples 0..{n - 1}, not all of rows {rows}, columns {cols}")
        count = rows.stop - rows.start
        band = max(1, BAND_SAMPLES // (cols.stop - cols.start))
        for start in range(0, count, band):
            stop = min(start + band, count)
            yield slice(start, stop), Window(level, rows.start + start, rows.start + stop, cols.start, cols.stop)
            if progress is not None:
                progress(stop / count)

    def base(self, window: Window) -> Grid:
        """Heights without detail: float32, metres."""
        if window.level <= self.site.solved:
            return self.site.guide(window).astype(np.float32)
        if window.level <= self.finest:
            return self._refined(window)
        chain = [window]
        while chain[-1].level > self.finest:
            chain.append(chain[-1].parent())
        at = chain.pop()
        z: Array = self.base(at).astype(np.float64)
        while chain:
            child = chain.pop()
            z, at = interpolated(z, at, child, self.site.rule), child
        return z.astype(np.float32)

    def _refined(self, window: Window) -> Grid:
        """Held tiles: refined samples, and beyond the domain what a tile's border holds."""
        assert self._refine is not None
        n = grid.samples(window.level)
        # beyond an edge the border is made of as many samples on the near side of it
        r0, c0 = (max(0, min(k, n - 1 - BORDER)) for k in (window.r0, window.c0))
        r1, c1 = (min(n, max(k, BORDER + 1)) for k in (window.r1, window.c1))
        rows, cols = slice(r0, r1), slice(c0, c1)
        under = None if self._ground is None else self._ground(window.level, rows, cols)
        held = on_the_wire(self._refine(window.level, rows, cols), window.level, self.site.size_m, under)
        return extended(held, window, origin=(r0, c0)).astype(np.float32)
