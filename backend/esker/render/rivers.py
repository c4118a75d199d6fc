"""Rivers as shaders read them (twin of ``frontend/src/tiles/water/rivermap.ts``; shaders/wgsl/rivers.wgsl)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker.flow.rivers import River

Floats = NDArray[np.float64]

CELLS: Final = 128
COLUMNS: Final = 256
"""RIVER_CELLS and RIVER_COLUMNS of rivers.wgsl."""
WIDTH_M: Final = 2.7
WIDTH_POWER: Final = 0.352
BANK_M: Final = 4.0
BANK_WIDTHS: Final = 3.0
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


def river_map(rivers: Sequence[River], size_m: float, wetness: float) -> NDArray[np.float32] | None:
    """The texels, (rows, COLUMNS, 4) float32; None without any river."""
    cells: list[list[Piece]] = [[] for _ in range(CELLS * CELLS)]
    pieces = 0
    for river in rivers:
        for piece in _pieces(river, wetness):
            for cell in _cells(piece, size_m):
                if len(cells[cell]) < MOST_IN_CELL and pieces < MOST_PIECES:
                    cells[cell].append(piece)
                    pieces += 1
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


def _half_width(area_m2: float, wetness: float) -> float:
    return float(0.5 * WIDTH_M * (wetness * area_m2 / 1e6) ** WIDTH_POWER)


def _pieces(river: River, wetness: float) -> Iterator[Piece]:
    points = _rounded(river.points)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    head, end = (math.log(area) for area in river.area_m2)
    shares = along / max(along[-1], 1e-6)
    half = [_half_width(math.exp(head + (end - head) * share), wetness) for share in shares]
    for k, ((ax, ay), (bx, by)) in enumerate(itertools.pairwise(points.tolist())):
        yield Piece(ax, ay, bx, by, half[k], half[k + 1], float(along[k]), 1.0)


def _rounded(points: Floats) -> Floats:
    """Corners cut once (Chaikin 1974), ends kept."""
    if len(points) < 3:
        return points
    inner = points[1:-1]
    before, after = 0.25 * points[:-2] + 0.75 * inner, 0.25 * points[2:] + 0.75 * inner
    cut = np.stack((before, after), axis=1).reshape(-1, 2)
    return np.concatenate((points[:1], cut, points[-1:]))


def _cells(piece: Piece, size_m: float) -> Iterator[int]:
    """The cells of the lattice that a piece with its banks may reach."""
    cell_m = size_m / CELLS
    half = max(piece.half_a, piece.half_b)
    reach = half + BANK_M + 2 * BANK_WIDTHS * half + 0.25 * cell_m

    def at(v: float) -> int:
        return min(CELLS - 1, max(0, math.floor(v / cell_m)))

    ax, ay, bx, by = piece[:4]
    for y in range(at(min(ay, by) - reach), at(max(ay, by) + reach) + 1):
        for x in range(at(min(ax, bx) - reach), at(max(ax, bx) + reach) + 1):
            px, py, dx, dy = (x + 0.5) * cell_m - ax, (y + 0.5) * cell_m - ay, bx - ax, by - ay
            t = min(1.0, max(0.0, (px * dx + py * dy) / max(dx * dx + dy * dy, 1e-12)))
            if math.hypot(px - t * dx, py - t * dy) <= reach + math.sqrt(0.5) * cell_m:
                yield y * CELLS + x
