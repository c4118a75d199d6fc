"""World <-> sample <-> tile (DESIGN 3). Pure arithmetic, no state.

Grids are vertex-centred: level l has 64*2^l + 1 samples a side; arrays are [row, col], row 0 is south.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from esker.contract import QUANTA_PER_CELL, TILE_CELLS

SOLVE_FIELDS = 19
"""Float32 a sample that a solve holds: 12 fields of the finest level, and a third of the 21 of those below it."""
PARKED_FIELDS = 10
"""Float32 a sample that a solve under way keeps while others have their turns: of the finest level five fields of
constraints and three of the ground; of the levels below the ground and one residual, nearly two more."""
BASE_FIELDS = 4
"""Fields of the finest level that a base adds (``solve.device_workspace.OverBase``)."""
PREVIEW_WORKSPACE_LEVEL = 2
"""Level of a preview workspace, on which strokes are rasterised for the coarsest preview alone. It takes a sixteenth of
level 4's work or less."""
PREVIEW_WORKSPACE_FROM = 4
"""Terrains of this level and above have a preview workspace; smaller ones would save nothing by it (docs/solver.md)."""
SOLVE_PADDING = 96
"""Columns more that padded rows and scratch come to: in between, as kernels for GPUs need less than those for CPUs."""


def cells(level: int) -> int:
    """Cells along one side of a level."""
    return TILE_CELLS << level


def samples(level: int) -> int:
    """Samples along one side of a level: 65, 129, 257, 513, 1025, 2049, 4097."""
    return cells(level) + 1


def spacing(level: int, size_m: float) -> float:
    """Distance between neighbouring samples, metres."""
    return size_m / cells(level)


def quantum(level: int, size_m: float) -> float:
    """Height quantisation step of a level, metres (DESIGN 6)."""
    return spacing(level, size_m) / QUANTA_PER_CELL


def arena_bytes(level: int, based: bool = False) -> int:
    """Memory of the device that one workspace solves with up to ``level``, to share it out by.

    From level 3 up within a tenth of what ``solve.opencl.workspaces.planned_bytes`` says exactly, for a known device.
    """
    return _bytes(level, SOLVE_FIELDS + (BASE_FIELDS if based else 0))


def solve_bytes(level: int, based: bool = False) -> int:
    """Returns the bytes of a solve and its preview workspace.

    Level 4 takes 90 MiB, 109 over a base; each further level takes four times as much.
    """
    preview = arena_bytes(PREVIEW_WORKSPACE_LEVEL, based) if level >= PREVIEW_WORKSPACE_FROM else 0
    return arena_bytes(level, based) + preview


def parked_bytes(level: int, based: bool = False) -> int:
    """Memory that a solve under way holds while it has no arena: 45 MiB at level 4, 58 over a base. At rest it is half
    of that."""
    return _bytes(level, PARKED_FIELDS + (BASE_FIELDS - 1 if based else 0))


def _bytes(level: int, fields: int) -> int:
    n = samples(level)
    return 4 * fields * n * (n + SOLVE_PADDING)


class TileKey(NamedTuple):
    """A tile: 64x64 cells of a level. ``x`` counts tiles from the west, ``y`` from the south."""

    level: int
    x: int
    y: int

    def parent(self) -> TileKey:
        """The tile of the next coarser level that covers this one. Raises ValueError at the root."""
        if self.level == 0:
            raise ValueError("the root tile has no parent")
        return TileKey(self.level - 1, self.x >> 1, self.y >> 1)

    def children(self) -> tuple[TileKey, TileKey, TileKey, TileKey]:
        """South-west, south-east, north-west, north-east."""
        n, x, y = self.level + 1, 2 * self.x, 2 * self.y
        return TileKey(n, x, y), TileKey(n, x + 1, y), TileKey(n, x, y + 1), TileKey(n, x + 1, y + 1)


def tiles(level: int) -> Iterator[TileKey]:
    """All tiles of a level, row by row from the south."""
    n = 1 << level
    return (TileKey(level, x, y) for y in range(n) for x in range(n))


@dataclass(frozen=True, slots=True)
class Rect:
    """Axis-aligned rectangle in world metres, x0 <= x1 and y0 <= y1."""

    x0: float
    y0: float
    x1: float
    y1: float

    def union(self, other: Rect | None) -> Rect:
        """Smallest rectangle that holds both."""
        if other is None:
            return self
        return Rect(min(self.x0, other.x0), min(self.y0, other.y0), max(self.x1, other.x1), max(self.y1, other.y1))

    def grown(self, margin: float) -> Rect:
        """Moved outward by ``margin`` metres on every side."""
        return Rect(self.x0 - margin, self.y0 - margin, self.x1 + margin, self.y1 + margin)

    def intersects(self, other: Rect) -> bool:
        """True when the closed rectangles share a point."""
        return self.x0 <= other.x1 and other.x0 <= self.x1 and self.y0 <= other.y1 and other.y0 <= self.y1

    def sample_window(self, level: int, size_m: float) -> tuple[int, int, int, int]:
        """Rows and columns ``(r0, r1, c0, c1)`` (half open, clipped) of the samples inside."""
        s, n = spacing(level, size_m), samples(level)
        r0, r1 = math.ceil(self.y0 / s), math.floor(self.y1 / s) + 1
        c0, c1 = math.ceil(self.x0 / s), math.floor(self.x1 / s) + 1
        return max(0, r0), min(n, max(0, r1)), max(0, c0), min(n, max(0, c1))


def tile_rect(key: TileKey, size_m: float) -> Rect:
    """The ground a tile covers."""
    w = size_m / (1 << key.level)
    return Rect(key.x * w, key.y * w, (key.x + 1) * w, (key.y + 1) * w)
