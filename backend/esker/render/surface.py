"""The ground as tiles: heights, attributes and bounds of any level, made where they are asked for.

Levels up to the finest that was solved are held whole; finer tiles come from their parents by the synthesis rule, as on
the page (docs/synthesis.md), and are kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import LAKE_LEVEL, PATCH_CELLS, SUBPATCHES, TILE_CELLS, TILE_SAMPLES, TerrainSettings
from esker.contract.fractal import H_RANGE
from esker.flow.rivers import River, rivers_of, water_of
from esker.render.select import Floats, Ints
from esker.synthesis.detailed import DetailedTerrain
from esker.synthesis.hash import full, hashed
from esker.synthesis.lakes import Lakes, find_lakes
from esker.synthesis.site import BORDER, extended, tile_window
from esker.synthesis.state import Array, State
from esker.synthesis.subdivide import Samples, interpolated, root, subdivide, whole

SLOT: Final = TILE_SAMPLES + 2 * BORDER
RATIOS: Final = {"landscape": 0.5, "smooth": 0.25, "plain": 0.25}
"""Likely error of a level that is not made yet, in that of the one above it (tiles/detail/synthetic.ts)."""
FALL: Final = 2.0 ** -H_RANGE[0]
"""A level adds at most this share of what its parent adds: for bounds."""

Tile = tuple[int, int, int]
"""Level, column, row."""


class SlotData(NamedTuple):
    """Samples of one tile with a border of two, row 0 south. ``heights``: (69, 69) float32, metres; ``state``: what the
    rule made there, and ``grain``, the noise that it was made with, -1..1; None on ground without detail."""

    heights: NDArray[np.float32]
    state: State | None = None
    grain: Array | None = None


class _Sub(NamedTuple):
    """Per 16-cell sub-patch (4 x 4, row, column), metres."""

    low: Floats
    high: Floats
    error: Floats


class _Made(NamedTuple):
    """Samples of one tile with its border, and its heights without detail, metres."""

    samples: Samples
    base: Array


class Surface:
    """The ground that is drawn; ``select.Figures``."""

    def __init__(
        self,
        size_m: float,
        levels: Sequence[NDArray[np.float32]],
        terrain: DetailedTerrain | None = None,
        top: int = 0,
    ) -> None:
        """``levels``: solved heights of levels 0..G, (N, N) metres. ``terrain``: its detail is added to them, on levels
        up to ``top``; without, the ground ends at level G."""
        self.size_m = size_m
        self.solved = len(levels) - 1
        self.range_m = float(min(z.min() for z in levels)), float(max(z.max() for z in levels))
        """Lowest and highest solved ground, without detail."""
        self.coarse_m = float(levels[0].mean(dtype=np.float64)), float(levels[0].min())
        """Mean and lowest height of the coarsest level."""
        self.levels = self.solved if terrain is None else max(top, self.solved)
        self._terrain = terrain
        self._solved = [np.asarray(z, dtype=np.float32) for z in levels[: LAKE_LEVEL + 1]]
        self._whole: list[Samples] = []
        self._heights: list[NDArray[np.float32]] = []
        for level, heights in enumerate(levels):
            if terrain is None:
                self._heights.append(extended(heights, whole(level)).astype(np.float32))
            else:
                site = terrain.site
                made = root(site) if level == 0 else subdivide(self._whole[-1], whole(level), site)
                self._whole.append(made)
                self._heights.append((made.guide + made.state.d).astype(np.float32))
        self._made: dict[Tile, _Made] = {}
        self._subs: dict[Tile, _Sub] = {}
        self._bounds = self._merge()

    @classmethod
    def of(cls, terrain: DetailedTerrain, top: int) -> Surface:
        """The ground of a settled terrain with its detail."""
        return cls(terrain.site.size_m, terrain.site.guides, terrain, top)

    def bounds(self, level: int, nodes: Ints) -> tuple[Floats, Floats, Floats]:
        """See ``select.Figures``."""
        px, py = nodes[:, 0], nodes[:, 1]
        if level <= self.solved:
            low, high, error = self._bounds[level]
            return low[py, px], high[py, px], error[py, px]
        out = np.empty((3, len(nodes)))
        tiles: dict[tuple[int, int], list[int]] = {}
        for k, (x, y) in enumerate((nodes // SUBPATCHES).tolist()):
            tiles.setdefault((x, y), []).append(k)
        for (x, y), at in tiles.items():
            sub = self._sub(level, x, y)
            rows, cols = py[at] % SUBPATCHES, px[at] % SUBPATCHES
            out[:, at] = self._grown(level, _Sub(*(a[rows, cols] for a in sub)))
        return out[0], out[1], out[2]

    def slot(self, level: int, x: int, y: int) -> SlotData:
        """The samples of a tile. Raises ValueError outside of the domain or above ``levels``."""
        if not (0 <= level <= self.levels and 0 <= x < 1 << level and 0 <= y < 1 << level):
            raise ValueError(f"there is no tile ({level}, {x}, {y})")
        if self._terrain is None:
            return SlotData(self._heights[level][_within(level, x, y)])
        made = self._tile(level, x, y)
        window, site = made.samples.window, self._terrain.site
        words = hashed(site.seed, level, 0, site.indices(window.rows, level), site.indices(window.cols, level))
        heights = (made.base + made.samples.state.d).astype(np.float32)
        return SlotData(heights, made.samples.state, full(words, np.float64))

    def lakes(self, settings: TerrainSettings) -> Lakes | None:
        """The lakes in basins of the solved ground; None without any, or where the terrain has none."""
        if settings.lakes_m is None:
            return None
        level = min(LAKE_LEVEL, self.solved)
        cells = TILE_CELLS << level
        ground = self._solved[level]
        if level < LAKE_LEVEL:
            at = np.arange((TILE_CELLS << LAKE_LEVEL) + 1) / (1 << LAKE_LEVEL - level)
            i = np.minimum(at.astype(np.int64), cells - 1)
            f = (at - i).astype(np.float32)
            rows = ground[i] * (1 - f[:, None]) + ground[i + 1] * f[:, None]
            ground = rows[:, i] * (1 - f) + rows[:, i + 1] * f
        cell = self.size_m / (TILE_CELLS << LAKE_LEVEL)
        found = find_lakes(ground, cell, settings.lakes_m, settings.sea_level_m)
        return found if found.any else None

    def rivers(self, settings: TerrainSettings) -> tuple[River, ...]:
        """The rivers of the ground with its detail, on the finest level that is solved as a whole."""
        if settings.rivers == 0:
            return ()
        heights = self._heights[self.solved][BORDER:-BORDER, BORDER:-BORDER]
        water = water_of(heights, settings.size_m, settings.sea_level_m)
        return rivers_of(water, settings.size_m, settings.rivers, settings.wetness)

    def height_at(self, x_m: float, y_m: float, level: int | None = None) -> float:
        """Height of the ground at a place, bilinear in the samples of a level (default: the finest solved one)."""
        level = self.solved if level is None else level
        side = 1 << level
        u, v = (min(max(p / self.size_m, 0.0), 1.0) * side for p in (x_m, y_m))
        x, y = min(int(u), side - 1), min(int(v), side - 1)
        z = self.slot(level, x, y).heights
        c, r = ((a - b) * TILE_CELLS + BORDER for a, b in ((u, x), (v, y)))
        i, j = min(int(c), SLOT - 2), min(int(r), SLOT - 2)
        fx, fy = c - i, r - j
        south, north = z[j, i] * (1 - fx) + z[j, i + 1] * fx, z[j + 1, i] * (1 - fx) + z[j + 1, i + 1] * fx
        return float(south * (1 - fy) + north * fy)

    # --- what is behind them

    def _tile(self, level: int, x: int, y: int) -> _Made:
        """Samples of one tile with its border, through those of its ancestors."""
        window = tile_window(level, x, y)
        if level <= self.solved:
            held = self._whole[level]
            at = window.within(held.window)
            samples = Samples(window, held.guide[at], State(*(a[at] for a in held.state)))
            return _Made(samples, samples.guide)
        found = self._made.get((level, x, y))
        if found is None:
            assert self._terrain is not None
            parent, site = self._tile(level - 1, x >> 1, y >> 1), self._terrain.site
            samples = subdivide(parent.samples, window, site)
            if level <= self._terrain.finest:
                base: Array = self._terrain.base(window).astype(np.float64)
            else:
                base = interpolated(parent.base, parent.samples.window, window, site.rule)
            found = self._made[level, x, y] = _Made(samples, base)
        return found

    def _sub(self, level: int, x: int, y: int) -> _Sub:
        found = self._subs.get((level, x, y))
        if found is None:
            heights = self.slot(level, x, y).heights[BORDER:-BORDER, BORDER:-BORDER]
            half = TILE_CELLS // 2
            at = np.s_[half * (y & 1) : half * (y & 1) + half + 1, half * (x & 1) : half * (x & 1) + half + 1]
            parent = self.slot(level - 1, x >> 1, y >> 1).heights[BORDER:-BORDER, BORDER:-BORDER][at]
            found = self._subs[level, x, y] = _figures(heights, parent)
        return found

    def _grown(self, level: int, sub: _Sub) -> tuple[Floats, Floats, Floats]:
        """Bounds with what finer tiles may add to them, a geometric series, and the error that they are likely to."""
        if level == self.levels or self._terrain is None:
            return sub.low - sub.error, sub.high + sub.error, np.zeros_like(sub.error)
        reach = sub.error / (1 - FALL)
        return sub.low - reach, sub.high + reach, RATIOS[self._terrain.site.rule] * sub.error

    def _merge(self) -> list[tuple[Floats, Floats, Floats]]:
        """Per solved level: bounds of each patch and all below it, and the error of stopping there."""
        out: list[tuple[Floats, Floats, Floats]] = []
        finer: Floats | None = None
        for level in range(self.solved, -1, -1):
            heights = self._heights[level][BORDER:-BORDER, BORDER:-BORDER]
            parent = self._heights[level - 1][BORDER:-BORDER, BORDER:-BORDER] if level else None
            sub = _figures(heights, parent)
            if finer is None:
                low, high, error = self._grown(level, sub)
            else:
                below = out[-1]
                low = np.minimum(sub.low - sub.error, _quarters(np.minimum, below[0]))
                high = np.maximum(sub.high + sub.error, _quarters(np.maximum, below[1]))
                error = _quarters(np.maximum, np.maximum(below[2], finer))
            finer = sub.error
            out.append((low, high, error))
        return out[::-1]


def _within(level: int, x: int, y: int) -> tuple[slice, slice]:
    return tile_window(level, x, y).within(whole(level))


def _quarters(ufunc: np.ufunc, a: Floats) -> Floats:
    n = len(a) // 2
    out: Floats = ufunc.reduce(a.reshape(n, 2, n, 2), axis=(1, 3))
    return out


def _figures(heights: NDArray[np.float32], parent: NDArray[np.float32] | None) -> _Sub:
    """Bounds per 16-cell block of closed squares of samples, and the distance to what the parent draws there."""
    z = heights.astype(np.float64)
    low, high = _blocks(np.minimum, z), _blocks(np.maximum, z)
    if parent is None:
        return _Sub(low, high, np.zeros_like(low))
    p = parent.astype(np.float64)
    away = z.copy()
    away[::2, ::2] -= p
    away[::2, 1::2] -= 0.5 * (p[:, 1:] + p[:, :-1])
    away[1::2, ::2] -= 0.5 * (p[1:] + p[:-1])
    # Cells are cut from their south-east to their north-west corner.
    away[1::2, 1::2] -= 0.5 * (p[:-1, 1:] + p[1:, :-1])
    return _Sub(low, high, _blocks(np.maximum, np.abs(away)))


def _blocks(ufunc: np.ufunc, a: Floats) -> Floats:
    for axis in (0, 1):
        n = (a.shape[axis] - 1) // PATCH_CELLS
        inner = ufunc.reduceat(a, np.arange(n) * PATCH_CELLS, axis=axis)
        far = a[PATCH_CELLS::PATCH_CELLS] if axis == 0 else a[:, PATCH_CELLS::PATCH_CELLS]
        # The last block of reduceat reaches to the end; the closing sample of the others is added here.
        a = ufunc(inner, far)
    return a
