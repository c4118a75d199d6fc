"""Lines of one height through a grid: marching squares, linked to polylines (Lorensen and Cline 1987, in the plane)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Grid = NDArray[np.float32]
Points = NDArray[np.float64]
FLAT_RUN: Final = 0.5
"""Ground is flat where the next contour would lie farther away than so many sides of the grid."""


class Line(NamedTuple):
    """A polyline in samples from the south-western corner: (n, 2), x before y. A closed one ends where it begins."""

    points: Points
    closed: bool


def interval_for(relief_m: float, wanted: int = 24) -> float:
    """A round contour interval (1, 2 or 5 times a power of ten) that gives at most ``wanted`` lines."""
    raw = max(relief_m, 1e-3) / wanted
    power = 10.0 ** np.floor(np.log10(raw))
    mantissa = raw / power
    return float(power * (1 if mantissa <= 1 else 2 if mantissa <= 2 else 5 if mantissa <= 5 else 10))


def contour(heights: Grid, level: float, keep: NDArray[np.bool_] | None = None) -> list[Line]:
    """All lines at ``level``. A sample at exactly that height counts as above it, so flat ground has no line in it.
    ``keep``: the cells (rows - 1, columns - 1) that may have lines; all without."""
    above = heights >= level
    sides = _sides(above)
    if keep is not None:
        sides = {name: cells & keep for name, cells in sides.items()}
    starts, ends = _segments(heights, level, sides, above)
    if not len(starts):
        return []
    at = _crossings(heights, level, np.unique(np.concatenate([starts, ends])), heights.shape[1])
    return [Line(np.array([at[e] for e in chain]), closed) for chain, closed in _chains(starts, ends)]


def steep_cells(solved: Grid, interval_m: float) -> NDArray[np.bool_]:
    """Cells (rows - 1, columns - 1) whose ground rises by more than a trace, so that the next contour would lie within
    FLAT_RUN sides of the grid. On all others a contour is noise of the detail, which ``solved`` is without."""
    rows, columns = solved.shape
    north, east = np.gradient(solved.astype(np.float64))
    steep = np.hypot(north, east) > interval_m / (FLAT_RUN * max(rows, columns))
    cells: NDArray[np.bool_] = steep[:-1, :-1] | steep[1:, :-1] | steep[:-1, 1:] | steep[1:, 1:]
    return cells


def _sides(above: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Returns which of a cell's four sides a line crosses."""
    sw, se, nw, ne = above[:-1, :-1], above[:-1, 1:], above[1:, :-1], above[1:, 1:]
    return {"south": sw != se, "north": nw != ne, "west": sw != nw, "east": se != ne}


def _segments(
    heights: Grid, level: float, sides: dict[str, NDArray[np.bool_]], above: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of crossed edges that a cell joins. An edge to the east of sample k has the number 2 k, one to the north
    2 k + 1. Where all four sides are crossed the middle of the cell says which pairs belong together."""
    rows, columns = heights.shape
    sample = np.arange(rows * columns, dtype=np.int64).reshape(rows, columns)[:-1, :-1]
    edge = {"south": 2 * sample, "west": 2 * sample + 1, "north": 2 * (sample + columns), "east": 2 * (sample + 1) + 1}
    count = np.sum([cells.astype(np.int8) for cells in sides.values()], axis=0)
    starts: list[NDArray[np.int64]] = []
    ends: list[NDArray[np.int64]] = []
    names = ("south", "west", "north", "east")
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            both = sides[one] & sides[other] & (count == 2)
            starts.append(edge[one][both])
            ends.append(edge[other][both])
    saddle = count == 4
    if saddle.any():
        z = heights.astype(np.float64)
        middle = (z[:-1, :-1] + z[1:, :-1] + z[:-1, 1:] + z[1:, 1:]) / 4 >= level
        # A middle on the side of the south-western corner joins that corner to the north-eastern one.
        together = saddle & (middle == above[:-1, :-1])
        apart = saddle & ~together
        for cells, pairs in (
            (together, (("south", "east"), ("west", "north"))),
            (apart, (("south", "west"), ("north", "east"))),
        ):
            for one, other in pairs:
                starts.append(edge[one][cells])
                ends.append(edge[other][cells])
    return np.concatenate(starts), np.concatenate(ends)


def _crossings(heights: Grid, level: float, edges: NDArray[np.int64], columns: int) -> dict[int, Points]:
    """Where each edge is crossed, in samples."""
    z = heights.reshape(-1).astype(np.float64)
    first, along = edges >> 1, (edges & 1).astype(bool)
    second = first + np.where(along, columns, 1)
    a, b = z[first], z[second]
    t = np.clip((level - a) / (b - a), 0.0, 1.0)
    x = (first % columns) + np.where(along, 0.0, t)
    y = (first // columns) + np.where(along, t, 0.0)
    return dict(zip(edges.tolist(), np.stack([x, y], axis=1), strict=True))


def _chains(starts: NDArray[np.int64], ends: NDArray[np.int64]) -> Iterator[tuple[list[int], bool]]:
    """Segments that share edges, as chains of edges: open ones from end to end, then rings."""
    beside: dict[int, list[int]] = {}
    for a, b in zip(starts.tolist(), ends.tolist(), strict=True):
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    seen: set[int] = set()
    loose = [edge for edge, near in beside.items() if len(near) == 1]
    for begin in (*loose, *beside):
        if begin in seen:
            continue
        chain, at = [begin], begin
        seen.add(begin)
        while (step := next((edge for edge in beside[at] if edge not in seen), None)) is not None:
            chain.append(step)
            seen.add(step)
            at = step
        closed = len(chain) > 2 and begin in beside[at]
        yield ([*chain, begin], True) if closed else (chain, False)
