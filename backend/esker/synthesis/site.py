"""What the rule is told of a place besides its parent: settings, the solved ground, what strokes ask for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple, get_args

import numpy as np
from numpy.typing import DTypeLike, NDArray

from esker import contract, grid
from esker.contract import (
    BASE_FAR,
    BASE_ROUGHNESS,
    BASE_SURVEY,
    DEFAULT_EROSION,
    DEFAULT_EROSION_SCALE,
    DEFAULT_HOLD,
    TILE_CELLS,
)
from esker.contract.fractal import (
    ALPHA,
    FAR_SHARE,
    GULLY_CELL,
    GULLY_CYCLIC_SIDE,
    LOOKS,
    LookRule,
    relief_m,
    shore_m,
    zero_m,
)
from esker.synthesis.interpolate import Window
from esker.synthesis.state import Array, State

BORDER: Final = 2
"""Samples that a tile carries beyond each of its edges: 2k for k = 1 (paper 1, section 3.1)."""


class Ground(NamedTuple):
    """The parent's ground with its detail, at the child's samples. See docs/synthesis.md, "Interpolation".

    ``height``: Z, metres; ``slope_x``, ``slope_y``: d/dx, d/dy; ``concavity``: v, -1..1, positive in valleys;
    ``guide_slope``: steepness of the guide alone.
    """

    level: int
    height: Array
    slope_x: Array
    slope_y: Array
    concavity: Array
    guide_slope: Array


class Biases(NamedTuple):
    """What strokes ask for, what elevation data hold back, and how far it is to what strokes fix.

    ``amplitude``: metres; ``roughness``: 0..1; ``survey``: the level whose spacing is that of the finest data here,
    BASE_SURVEY where there are none; ``far``: 0..1, a distance as a share of FAR_SHARE of the domain's side, BASE_FAR
    beyond; the rest -1..1, and 0 where none asks.
    """

    amplitude: Array
    roughness: Array
    snow: Array
    grass: Array
    forest: Array
    wetness: Array
    survey: Array
    erosion: Array
    far: Array


BASES: Final = {"roughness": BASE_ROUGHNESS, "survey": BASE_SURVEY, "far": BASE_FAR}
"""Channels that are not 0 where nothing is asked."""

Rule = Callable[["Site", Ground, State, Window, Biases], State]
"""(site, ground, the parent's state at the child's samples, the child's window, biases) -> the child's state."""

Grid = NDArray[np.float32]


@dataclass(frozen=True)
class Site:
    """One terrain as the rule sees it. Immutable.

    ``guides``: heights of levels 0..G as sent on the wire, metres, (N_l, N_l) float32; ``channels``: grids (n, n) over
    the whole domain, corners on corners, n - 1 a power of two, by the names of ``Biases``; one that is missing is its
    base everywhere. ``detail``: strength, 0..4. ``erosion``: strength of the gullies, 0..2; ``erosion_scale``: their
    wavelength in cells; ``hold``: how strictly what strokes fix keeps its height, 0..1. ``sea_level_m``: None where
    there is no sea. ``cyclic``: the domain's
    east edge is its west edge, north its south. ``lat_deg``: where on Earth it lies, if anywhere. ``ground_m``: lowest
    and highest sample of its elevation layers, None without any. ``dtype``: of the arithmetic. Raises ValueError for
    what does not fit.
    """

    size_m: float
    seed: int
    guides: tuple[Grid, ...]
    channels: Mapping[str, Grid] = field(default_factory=dict)
    detail: float = 1.0
    rule: str = "landscape"
    look: str = "natural"
    sea_level_m: float | None = None
    cyclic: bool = False
    lat_deg: float | None = None
    ground_m: tuple[float, float] | None = None
    dtype: DTypeLike = np.float64
    erosion: float = DEFAULT_EROSION
    erosion_scale: float = DEFAULT_EROSION_SCALE
    hold: float = DEFAULT_HOLD

    def __post_init__(self) -> None:
        if not self.guides:
            raise ValueError("synthesis needs the heights of level 0 at least")
        for level, heights in enumerate(self.guides):
            n = grid.samples(level)
            if heights.shape != (n, n):
                raise ValueError(f"level {level} has {n}x{n} samples, not {heights.shape}")
        for name, values in self.channels.items():
            cells = len(values) - 1
            if name not in Biases._fields or values.shape != (cells + 1,) * 2 or cells < 1 or cells & (cells - 1):
                raise ValueError(f"no channel '{name}' of {values.shape} values")
        if self.look not in LOOKS:
            raise ValueError(f"no look is called '{self.look}'")
        if self.rule not in get_args(contract.Rule):
            raise ValueError(f"no rule is called '{self.rule}'")

    @property
    def solved(self) -> int:
        """Finest level G of the guide that was solved as a whole."""
        return len(self.guides) - 1

    @property
    def look_rule(self) -> LookRule:
        """Snow line, tree line and plants of the look."""
        return LOOKS[self.look]

    @property
    def relief_m(self) -> float:
        """The height that elevations are shares of, metres."""
        return relief_m(self.size_m, self.lat_deg, 0.0 if self.ground_m is None else self.ground_m[1] - self.zero_m)

    @property
    def zero_m(self) -> float:
        """Where elevations count from, metres."""
        return zero_m(self.lat_deg, self.sea_level_m, self.ground_m)

    @property
    def shore_m(self) -> float:
        """The height that the elevation of wet shores is a share of, metres."""
        return shore_m(self.size_m, self.lat_deg)

    @property
    def surveyed(self) -> bool:
        """Whether elevation data hold detail back anywhere."""
        return "survey" in self.channels

    @property
    def eroded(self) -> bool:
        """Whether gullies are asked for anywhere."""
        return self.erosion > 0 or ("erosion" in self.channels and bool((self.channels["erosion"] > 0).any()))

    @property
    def gully_side(self) -> int:
        """Side of a cell of the lattice of gullies, in samples of any level. It is whole: every device has the same."""
        return GULLY_CYCLIC_SIDE if self.cyclic else math.floor(GULLY_CELL * self.erosion_scale + 0.5)

    @property
    def far_m(self) -> float:
        """Distance of which the channel ``far`` is a share, metres."""
        return FAR_SHARE * self.size_m

    @property
    def far_margin_m(self) -> float:
        """What is taken off a distance, metres: half a cell of its grid, as bilinear values on a line are up to it."""
        cells = len(self.channels["far"]) - 1 if "far" in self.channels else TILE_CELLS
        return self.size_m / (2 * max(TILE_CELLS, cells))

    @property
    def amplitude_m(self) -> float:
        """Amplitude of the coarsest octave on steep ground, metres: detail * alpha * s_0."""
        return self.detail * ALPHA * grid.spacing(0, self.size_m)

    def spacing(self, level: int) -> float:
        """Distance between samples of a level, metres."""
        return grid.spacing(level, self.size_m)

    def indices(self, index: NDArray[np.int64], level: int) -> NDArray[np.int64]:
        """Global sample indices as the hash and the channels take them: wrapped where the domain is cyclic."""
        return index % grid.cells(level) if self.cyclic else index

    def guide(self, window: Window) -> Array:
        """Guide heights of a level that was solved. Raises IndexError above it."""
        return extended(self.guides[window.level], window, self.cyclic).astype(self.dtype)

    def biases(self, window: Window) -> Biases:
        """Channels at the samples of a window."""
        rows, cols = (self.indices(a, window.level) for a in (window.rows, window.cols))
        return Biases(*(
            self._channel(self.channels[name], window.level, rows, cols)
            if name in self.channels
            else np.full(window.shape, BASES.get(name, 0.0), dtype=self.dtype)
            for name in Biases._fields
        ))  # fmt: skip

    def _channel(self, values: Grid, level: int, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> Array:
        z: Array = values.astype(self.dtype)
        (j, v), (i, u) = (_place(a, level, len(values) - 1) for a in (rows, cols))
        fx, fy = u.astype(self.dtype)[None, :], v.astype(self.dtype)[:, None]
        south = z[np.ix_(j, i)] * (1 - fx) + z[np.ix_(j, i + 1)] * fx
        north = z[np.ix_(j + 1, i)] * (1 - fx) + z[np.ix_(j + 1, i + 1)] * fx
        between: Array = south * (1 - fy) + north * fy
        return between


def _place(index: NDArray[np.int64], level: int, cells: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Cell of a channel's grid and place in it, 0..1, exact: both grids have powers of two cells."""
    n = grid.cells(level)
    scaled = np.clip(index, 0, n) * cells
    cell = np.minimum(scaled // n, cells - 1)
    return cell, (scaled - cell * n) / n


def extended(
    heights: NDArray[np.floating], window: Window, cyclic: bool = False, origin: tuple[int, int] = (0, 0)
) -> NDArray[np.floating]:
    """Heights of a level at a window that may reach over the domain's edges by less than the domain.

    ``heights``: the whole level, or what is needed of it, its sample [0, 0] being (row, column) ``origin``.
    Beyond an edge the ground goes on point-symmetrically, 2 z(edge) - z(as far inside), x first, then y: a function of
    the global index alone, so tiles along the edge agree. Cyclic domains repeat.
    """
    rows, cols = window.rows, window.cols
    n = grid.cells(window.level)
    if cyclic:
        repeated: NDArray[np.floating] = heights[np.ix_(rows % n - origin[0], cols % n - origin[1])]
        return repeated
    across = _mirrored(heights, cols - origin[1], (-origin[1], n - origin[1]), 1)
    return _mirrored(across, rows - origin[0], (-origin[0], n - origin[0]), 0)


def _mirrored(
    z: NDArray[np.floating], index: NDArray[np.int64], edges: tuple[int, int], axis: int
) -> NDArray[np.floating]:
    nearest = np.clip(index, *edges)
    out: NDArray[np.floating] = np.take(z, nearest, axis=axis)
    away = np.flatnonzero(nearest != index)
    if away.size:
        at = (slice(None), away) if axis else (away, slice(None))
        inside = np.take(z, (2 * nearest - index)[away], axis=axis)
        out[at] = 2 * out[at] - inside
    return out


def tile_window(level: int, x: int, y: int) -> Window:
    """The 69x69 samples of a tile with its border."""
    c, r = TILE_CELLS * x, TILE_CELLS * y
    return Window(level, r - BORDER, r + TILE_CELLS + 1 + BORDER, c - BORDER, c + TILE_CELLS + 1 + BORDER)
