"""Settled heights of a terrain without a server, kept for as long as what they follow from stays or comes back.

The ground is a pure function of some fields of the document (DESIGN 5), so heights that were solved once are those of
every document with the same fields: after an undo, under another name, with paint on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.contract import Stroke, TerrainSettings
from esker.document.ops import CHANNEL_FIELDS, GROUND_FIELDS
from esker.patchwork.base import Base
from esker.solve.blank import is_blank

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
