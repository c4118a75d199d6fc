"""Settled heights of a terrain without a server, kept for as long as what they follow from stays or comes back.

The ground is a pure function of some fields of the document (DESIGN 5), so heights that were solved once are those of
every document with the same fields: after an undo, under another name, with paint on it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import Stroke, TerrainSettings
from esker.document.ops import CHANNEL_FIELDS, GROUND_FIELDS
from esker.patchwork.base import Base
from esker.solve.blank import is_blank
from esker.solve.detail import Settled, detailed, settle
from esker.solve.solver import Solver
from esker.synthesis.detailed import Detail, DetailedTerrain

Heights = NDArray[np.float32]
KEPT_BYTES: Final = 64 << 20
"""Heights that one terrain keeps, the newest always: sixteen documents at level 4, four at level 5."""
SHAPING: Final = ("id", "kind", *sorted(GROUND_FIELDS - CHANNEL_FIELDS))
"""Fields of a stroke that heights follow from; of strokes that meet, the order of ids decides."""


@dataclass(frozen=True)
class HeightWindow:
    """Heights of a rectangle. heights: (rows, columns) float32, metres, row 0 south; sample [0, 0] lies at world
    (x_m, y_m), neighbours ``spacing_m`` apart. ``attributes``: with detail, what ``Terrain.attributes`` gives."""

    heights: NDArray[np.float32]
    x_m: float
    y_m: float
    spacing_m: float
    attributes: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)


class Solved(NamedTuple):
    """Facts that heights of a level follow from, strokes by id. Equal facts have the same heights, to the bit."""

    level: int
    settings: tuple[object, ...]
    strokes: tuple[Stroke, ...]
    base: Base | None

    @classmethod
    def of(cls, level: int, settings: TerrainSettings, strokes: Sequence[Stroke], base: Base | None) -> Solved:
        """Returns the facts of a document's level."""
        shaping = sorted((stroke for stroke in strokes if not is_blank((stroke,))), key=lambda stroke: stroke.id)
        said = settings.size_m, settings.edition, settings.reach_m, settings.border
        return cls(level, said, tuple(shaping), base)

    def same(self, other: Solved) -> bool:
        """Whether the heights are the same."""
        mine, theirs = self.strokes, other.strokes
        return (
            (self.level, self.settings) == (other.level, other.settings)
            and _same_base(self.base, other.base)
            and len(mine) == len(theirs)
            and all(a is b or _alike(a, b) for a, b in zip(mine, theirs, strict=True))
        )


def _same_base(one: Base | None, other: Base | None) -> bool:
    return one is other or (one is not None and other is not None and one.digest == other.digest)


def _alike(a: Stroke, b: Stroke) -> bool:
    return all(getattr(a, name) == getattr(b, name) for name in SHAPING)


class HeightCache:
    """Heights by what they follow from, least recently asked for dropped first. Not thread-safe."""

    def __init__(self, most_bytes: int = KEPT_BYTES) -> None:
        self._most, self._held = most_bytes, list[tuple[Solved, Heights]]()

    def find(self, wanted: Solved) -> Heights | None:
        """The heights of a document, if they are held."""
        for at in range(len(self._held) - 1, -1, -1):
            if self._held[at][0].same(wanted):
                self._held.append(self._held.pop(at))
                return self._held[-1][1]
        return None

    def put(self, solved: Solved, heights: Heights) -> None:
        """Hold heights."""
        self._held.append((solved, heights))
        while len(self._held) > 1 and sum(held.nbytes for _, held in self._held) > self._most:
            del self._held[0]


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
