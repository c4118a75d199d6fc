"""The last solve of a terrain without a server, and the detail on it: they serve again while nothing has changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from esker import grid
from esker.api.heights import HeightCache, Solved
from esker.contract import Stroke, TerrainSettings
from esker.patchwork.base import Base
from esker.solve.detail import Settled, detailed, settle
from esker.solve.solver import Solver
from esker.synthesis.detailed import Detail, DetailedTerrain


class Source(NamedTuple):
    """Facts that the ground of a terrain follows from.

    span_m: lowest and highest sample of the elevation layers, metres; None without any.
    """

    strokes: tuple[Stroke, ...]
    settings: TerrainSettings
    base: Base | None
    span_m: tuple[float, float] | None


class KeptGround:
    """Holds one settled solve, what makes detail of it, and one whole level with detail. Not thread-safe.

    ``heights`` is told of heights that were solved on the way.
    """

    def __init__(self, heights: HeightCache) -> None:
        self._heights = heights
        self._settled: Settled | None = None
        self._detailed: tuple[Settled, int, DetailedTerrain] | None = None
        self._detail: tuple[DetailedTerrain, int, Detail] | None = None

    def settled(self, solver: Solver, source: Source, level: int) -> Settled:
        """Returns what refinement and detail start from. Raises ValueError, DeviceErrors, DivergedError."""
        strokes, settings, base, _ = source
        held = self._settled
        basis = None if held is None else held.basis
        if (
            held is None
            or basis is None
            or basis.level != level
            or basis.settings != settings
            or basis.base is not base
            or not _same(basis.strokes, strokes)
        ):
            held = self._settled = settle(solver, strokes, settings, level, base=base)
            if base is None:
                self._heights.put(Solved.of(level, settings, strokes, base), held.basis.heights)
        return held

    def detailed(self, solver: Solver, source: Source, global_level: int, refined_level: int) -> DetailedTerrain:
        """Returns what makes windows with detail. Raises as ``settled`` does."""
        settled, held = self.settled(solver, source, global_level), self._detailed
        if held is None or held[0] is not settled or held[1] != refined_level:
            made = detailed(solver, settled, refined_level, source.span_m)
            held = self._detailed = settled, refined_level, made
        return held[2]

    def whole(
        self,
        solver: Solver,
        source: Source,
        level: int,
        levels: tuple[int, int],
        progress: Callable[[float], None] | None,
    ) -> Detail:
        """Returns a whole level with detail, read-only. levels: global and refined level. Raises as ``settled``."""
        terrain, held = self.detailed(solver, source, *levels), self._detail
        if held is None or held[0] is not terrain or held[1] != level:
            every = slice(0, grid.samples(level))
            made = terrain.window(level, every, every, progress)
            for values in (made.heights, *made.attributes.values()):
                values.flags.writeable = False
            held = self._detail = terrain, level, made
        return held[2]


def _same(a: tuple[Stroke, ...], b: tuple[Stroke, ...]) -> bool:
    """Whether these are the very same values in the same order: strokes are immutable."""
    return len(a) == len(b) and all(x is y for x, y in zip(a, b, strict=True))
