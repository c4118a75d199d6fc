"""Rivers as shaders read them (twin of ``frontend/src/tiles/water/rivermap.ts``; shaders/wgsl/water/rivers.wgsl)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.flow.rivers import River

Floats = NDArray[np.float64]

CELLS: Final = 128
LATTICES: Final = 5
COLUMNS: Final = 256
"""RIVER_CELLS, RIVER_LATTICES and RIVER_COLUMNS of water/rivers.wgsl."""
WIDTH_M: Final = 2.7
WIDTH_POWER: Final = 0.352
BANK_M: Final = 4.0
BANK_WIDTHS: Final = 3.0
REACH_CELLS: Final = 0.25
LEAST_CELLS: Final = 1 / 12
"""Pieces of all lattices but the finest are at least so many cells long."""
MOST_IN_CELL: Final = 96
MOST_PIECES: Final = 40_000


class Piece(NamedTuple):
    """A straight part of a river: both ends, half the width at both, metres down the river, how far it is shown."""

    ax: float
    ay: float
    bx: float
    by: float
    half_a: float
    half_b: float
    along: float
    share: float


class _Line(NamedTuple):
    """A river as it is drawn: its points, metres; metres down the river and half the width at each."""

    points: list[tuple[float, float]]
    along: list[float]
    half: list[float]


def river_map(rivers: Sequence[River], size_m: float, wetness: float) -> NDArray[np.float32] | None:
    """The texels, (rows, COLUMNS, 4) float32; None without any river."""
    lines = [_line(river, wetness) for river in rivers]
    cells = [found for k in range(LATTICES) for found in _lattice(lines, size_m, k)]
    pieces = sum(len(found) for found in cells)
    if not pieces:
        return None
    texels = np.zeros((-(-(len(cells) + 2 * pieces) // COLUMNS) * COLUMNS, 4), np.float32)
    at = len(cells)
    for k, found in enumerate(cells):
        texels[k, :2] = at, len(found)
        if found:
            texels[at : at + 2 * len(found)] = np.array(found, np.float64).reshape(-1, 4)
        at += 2 * len(found)
    return texels.reshape(-1, COLUMNS, 4)


def _lattice(lines: Sequence[_Line], size_m: float, lattice: int) -> list[list[Piece]]:
    """What the cells of one lattice hold, row by row from the south."""
    side = CELLS >> lattice
    cell_m = size_m / side
    cells: list[list[Piece]] = [[] for _ in range(side * side)]
    left = MOST_PIECES >> lattice
    for line in lines:
        for piece in _pieces(line, LEAST_CELLS * cell_m if lattice else 0.0):
            for cell in _cells(piece, side, cell_m):
                if len(cells[cell]) < MOST_IN_CELL and left:
                    cells[cell].append(piece)
                    left -= 1
    return cells


def _half_width(area_m2: float, wetness: float) -> float:
    return float(0.5 * WIDTH_M * (wetness * area_m2 / 1e6) ** WIDTH_POWER)


def _line(river: River, wetness: float) -> _Line:
    points = _rounded(river.points)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    head, end = (math.log(area) for area in river.area_m2)
    shares = along / max(along[-1], 1e-6)
    half = [_half_width(math.exp(head + (end - head) * share), wetness) for share in shares]
    return _Line([(float(x), float(y)) for x, y in points], along.tolist(), half)


def _pieces(line: _Line, least_m: float) -> Iterator[Piece]:
    """Points nearer than ``least_m`` to the one before are left out, but for the last."""
    a = 0
    for b in range(1, len(line.points)):
        (ax, ay), (bx, by) = line.points[a], line.points[b]
        if b < len(line.points) - 1 and math.hypot(bx - ax, by - ay) < least_m:
            continue
        yield Piece(ax, ay, bx, by, line.half[a], line.half[b], line.along[a], 1.0)
        a = b


def _rounded(points: Floats) -> Floats:
    """Corners cut once (Chaikin 1974), ends kept."""
    if len(points) < 3:
        return points
    inner = points[1:-1]
    before, after = 0.25 * points[:-2] + 0.75 * inner, 0.25 * points[2:] + 0.75 * inner
    cut = np.stack((before, after), axis=1).reshape(-1, 2)
    return np.concatenate((points[:1], cut, points[-1:]))


def _cells(piece: Piece, side: int, cell_m: float) -> Iterator[int]:
    """The cells of a lattice of ``side`` times ``side`` that a piece with its banks may reach."""
    half = max(piece.half_a, piece.half_b)
    reach = half + BANK_M + 2 * BANK_WIDTHS * half + REACH_CELLS * cell_m

    def at(v: float) -> int:
        return min(side - 1, max(0, math.floor(v / cell_m)))

    ax, ay, bx, by = piece[:4]
    for y in range(at(min(ay, by) - reach), at(max(ay, by) + reach) + 1):
        for x in range(at(min(ax, bx) - reach), at(max(ax, bx) + reach) + 1):
            px, py, dx, dy = (x + 0.5) * cell_m - ax, (y + 0.5) * cell_m - ay, bx - ax, by - ay
            t = min(1.0, max(0.0, (px * dx + py * dy) / max(dx * dx + dy * dy, 1e-12)))
            if math.hypot(px - t * dx, py - t * dy) <= reach + math.sqrt(0.5) * cell_m:
                yield y * side + x
