"""Rivers as lines: where enough ground drains to, cut at heads and confluences, smoothed and simplified.

All of it is whole numbers: points in sixteenths of a cell, areas in samples. So the same heights give the same lines on
every machine, to the bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from esker.compiled import kernel
from esker.contract import QUANTA_PER_CELL, RIVER_AREA_SHARE, RIVER_FALL_SHARE
from esker.flow.water import MOST_QUANTA, Water

Ints = NDArray[np.int32]
Wide = NDArray[np.int64]
Floats = NDArray[np.float64]

UNITS_PER_CELL: Final = 16
"""Points are whole in these: two passes of (1 2 1) / 4 over whole cells are."""
TOLERANCE: Final = (784, 25)
"""The square of 5.6 units, 0.35 of a cell: so far a simplified line may be from its points."""
FAR: Final = 1 << 28
"""Twice a triangle's area that is beyond any tolerance, and whose square still fits."""
NO_REACH: Final = -1


@dataclass(frozen=True, eq=False)
class Reaches:
    """The network. Reach k has points[start[k] : start[k + 1]]; a reach comes before the one that it runs into.

    ``points``: (points, 2) int32, x and y in UNITS_PER_CELL. ``samples``: that lie at the two ends of each reach,
    (reaches, 2). ``areas``: (reaches, 2) int32, samples that drain through its head, and through its last sample before
    the next reach. ``next``: the reach that each runs into, NO_REACH at the border and in the sea.
    """

    start: Ints
    points: Ints
    samples: Ints
    areas: Ints
    next: Ints

    def __len__(self) -> int:
        return len(self.areas)


def least_samples(cells: int, many: float) -> int:
    """How many samples must drain through a river on a grid of ``cells`` a side: fewer for more rivers."""
    return max(1, math.ceil((cells * RIVER_AREA_SHARE) ** 2 / many))


def find_reaches(water: Water, many: float = 1.0) -> Reaches:
    """The rivers of a terrain.

    Parameters
    ----------
    water: of a whole level.
    many: how many rivers; 1 asks for a 256th of the domain's area above each, 2 for half of that. 0 is none.
    """
    cells = max(water.shape) - 1
    if many <= 0 or cells < 1:
        return _none()
    least = least_samples(cells, many)
    receiver, areas = water.receiver.ravel(), water.area.ravel()
    wet = (areas >= least) & (receiver >= 0)
    if not wet.any():
        return _none()
    # A river has come down: on ground that is level all over water gathers too, along lines that mean nothing.
    fall = min(cells * QUANTA_PER_CELL * RIVER_FALL_SHARE, MOST_QUANTA)
    wet &= water.highest().ravel().astype(np.int64) - water.filled.ravel() >= math.ceil(fall)
    into = np.bincount(receiver[wet], minlength=areas.size)
    heads = np.nonzero(wet & (into != 1))[0]
    if not heads.size:
        return _none()
    return _lines(water, heads[np.argsort(areas[heads], kind="stable")], into)


def _none() -> Reaches:
    empty = np.zeros((0, 2), np.int32)
    return Reaches(np.zeros(1, np.int32), empty, empty, empty, np.zeros(0, np.int32))


def _lines(water: Water, heads: NDArray[np.intp], into: NDArray[np.int64]) -> Reaches:
    receiver, areas = water.receiver.ravel(), water.area.ravel()
    is_confluence = (into > 1).astype(np.int8)
    way = np.empty(receiver.size + 1, np.int32)
    reach_of = {int(head): k for k, head in enumerate(heads)}
    lines, ends, flows, following = [], [], [], []
    for head in heads:
        count = down(receiver, is_confluence, head, way)
        last = int(way[count - 1])
        points = smoothed(way[:count], water.shape[1])
        lines.append(points[simplify(points)])
        ends.append((head, last))
        flows.append((areas[head], areas[way[max(count - 2, 0)]]))
        following.append(reach_of.get(last, NO_REACH))
    start = np.cumsum([0, *map(len, lines)]).astype(np.int32)
    points = np.concatenate(lines)
    return Reaches(start, points, np.array(ends, np.int32), np.array(flows, np.int32), np.array(following, np.int32))


@kernel
def down(receiver: Ints, is_confluence: NDArray[np.int8], head: int, way: Ints) -> int:
    """Writes the samples of a reach: from its head to the next confluence, or to where water leaves."""
    way[0] = head
    count, at = 1, receiver[head]
    while at >= 0:
        way[count] = at
        count += 1
        if is_confluence[at]:
            break
        at = receiver[at]
    return count


@kernel
def smoothed(way: Ints, cols: int) -> Ints:
    """The points of a way in UNITS_PER_CELL, after two passes of (1 2 1) / 4 that keep its ends."""
    n = way.size
    a, b = np.empty((n, 2), np.int32), np.empty((n, 2), np.int32)
    for k in range(n):
        a[k, 0], a[k, 1] = way[k] % cols * 16, way[k] // cols * 16
    for _ in range(2):
        for axis in range(2):  # one by one: to set a row at once takes two seconds to compile
            b[0, axis], b[n - 1, axis] = a[0, axis], a[n - 1, axis]
            for k in range(1, n - 1):
                b[k, axis] = (a[k - 1, axis] + 2 * a[k, axis] + a[k + 1, axis]) // 4
        a, b = b, a
    return a


@kernel
def simplify(points: Ints) -> NDArray[np.bool_]:
    """Which points of a line stay (Douglas & Peucker 1973): its ends, and those without which it would lie further than
    TOLERANCE from a point that goes. Compared as whole numbers."""
    n = points.shape[0]
    stays = np.zeros(n, np.bool_)
    stays[0] = stays[n - 1] = True
    todo = [(0, n - 1)]
    while len(todo) > 0:
        i, j = todo.pop()
        dx, dy = np.int64(points[j, 0] - points[i, 0]), np.int64(points[j, 1] - points[i, 1])
        square = dx * dx + dy * dy
        most, at = np.int64(0), -1
        for k in range(i + 1, j):
            x, y = np.int64(points[k, 0] - points[i, 0]), np.int64(points[k, 1] - points[i, 1])
            away = np.int64(abs(x * dy - y * dx) if square > 0 else x * x + y * y)
            if away > most:
                most, at = away, k
        if at < 0:
            continue
        far = np.int64(most if most < FAR else FAR)
        limit = square * TOLERANCE[0] if square > 0 else TOLERANCE[0]
        if (far * far if square > 0 else far) * TOLERANCE[1] > limit:
            stays[at] = True
            todo.append((i, at))
            todo.append((at, j))
    return stays


def bankfull(area_m2: Floats, wetness: float = 1.0) -> tuple[Floats, Floats]:
    """Width and depth, metres, of rivers that so much ground drains to (Bieger et al. 2015, all of the United States).

    ``wetness``: how many times as much water as there a square kilometre gives.
    """
    square_km = np.maximum(area_m2, 0.0) * 1e-6 * wetness
    return 2.70 * square_km**0.352, 0.30 * square_km**0.213
