"""How far each sample is from what strokes fix: crests, plateaux, the inside of closed outlines (channel ``far``).

Gullies keep off what strokes fix by this (docs/synthesis.md, "Gullies"). It is geometry in plan alone, found in NumPy
on every device, so its bits are the same everywhere. What one stroke says of the samples near it is kept as long as the
stroke is the same.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from esker import grid
from esker.contract import BASE_FAR, Stroke, TerrainSettings
from esker.contract.fractal import FAR_SHARE
from esker.solve.constraints.crest import Crest, crest_of
from esker.solve.constraints.outline import spans_of
from esker.solve.injection import frozen, injections

Levels = tuple[NDArray[np.float32], ...]
Floats = NDArray[np.float64]

AT_A_STRETCH = 16
"""Strokes that are measured without a pause, some milliseconds."""
QUICK = 32
"""Strokes that may be new or other for the distances to come before the heights."""


class _Near(NamedTuple):
    """Distances of the samples of a window from a stroke, metres: rows from r0, columns from c0; None of paint."""

    stroke: Stroke
    r0: int
    c0: int
    distance_m: Floats | None


def is_eroded(strokes: Sequence[Stroke], settings: TerrainSettings) -> bool:
    """Whether settings or visible paint ask for gullies: without any, nobody needs distances."""
    return settings.erosion > 0 or any(
        stroke.paint is not None and stroke.paint.channel == "erosion" and stroke.paint.value > 0 and not stroke.hidden
        for stroke in strokes
    )


@lru_cache(maxsize=8)
def nowhere(level: int) -> Levels:
    """Levels 0..``level`` of a terrain on which nothing is fixed: the same arrays every time."""
    n = grid.samples(level)
    return tuple(injections(frozen(np.full((n, n), BASE_FAR, dtype=np.float32))))


class FarField:
    """Distances of the samples of one level. Use it from one thread."""

    def __init__(self, level: int) -> None:
        self.level = level
        self._size_m = 0.0
        self._near: dict[str, _Near] = {}
        self._made: Levels | None = None

    def is_quick(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> bool:
        """Whether few strokes have to be measured anew."""
        if self._size_m != settings.size_m:
            return len(strokes) <= QUICK
        known = self._near
        return sum(1 for s in strokes if s.id not in known or known[s.id].stroke is not s) <= QUICK

    def making(self, strokes: Sequence[Stroke], settings: TerrainSettings) -> Generator[None, None, Levels]:
        """Levels 0..``level``, 0..1 each; the same arrays as last time if nothing changed. It may be left where it
        yields, and another terrain may be measured meanwhile."""
        if not is_eroded(strokes, settings):
            return nowhere(self.level)
        size_m = settings.size_m
        known = self._near if self._size_m == size_m else {}
        near: dict[str, _Near] = {}
        made = 0
        for stroke in strokes:
            found = known.get(stroke.id)
            if found is None or found.stroke is not stroke:
                found = self._measured(stroke, size_m)
                made += 1
                if made % AT_A_STRETCH == 0:
                    yield
            near[stroke.id] = found
        same = self._size_m == size_m and near.keys() == self._near.keys()
        if self._made is None or not same or any(self._near[key] is not found for key, found in near.items()):
            self._made = self._composed(list(near.values()), size_m)
        self._size_m, self._near = size_m, near
        return self._made

    def _composed(self, near: list[_Near], size_m: float) -> Levels:
        n, most = grid.samples(self.level), FAR_SHARE * size_m
        distance_m = np.full((n, n), most)
        for _, r0, c0, found in near:
            if found is None:
                continue
            rows, cols = found.shape
            part = distance_m[r0 : r0 + rows, c0 : c0 + cols]
            np.minimum(part, found, out=part)
        return tuple(injections(frozen((distance_m / most).astype(np.float32))))

    def _measured(self, stroke: Stroke, size_m: float) -> _Near:
        crest = crest_of(stroke)
        if crest is None:
            return _Near(stroke, 0, 0, None)
        s, most = grid.spacing(self.level, size_m), FAR_SHARE * size_m
        line = _plan(crest) / s
        reach = (stroke.plateau_radius_m + most) / s
        last = grid.samples(self.level) - 1
        (c0, r0), (c1, r1) = (
            np.clip(end, 0, last).astype(int)
            for end in (np.floor(line.min(axis=0) - reach), np.ceil(line.max(axis=0) + reach))
        )
        square = np.full((r1 - r0 + 1, c1 - c0 + 1), np.inf)
        for start, end in pairwise(line):
            _approach(square, start - (c0, r0), end - (c0, r0), reach)
        distance_m = np.maximum(np.sqrt(square) * s - stroke.plateau_radius_m, 0)
        if crest.closed:
            _fill(distance_m, line[:-1], r0, c0)
        return _Near(stroke, int(r0), int(c0), distance_m)


def _plan(crest: Crest) -> Floats:
    """A crest's line in plan, metres, of two points at least; a closed one ends where it begins."""
    points = crest.points[:, :2]
    if crest.closed or len(points) == 1:
        return np.vstack([points, points[:1]])
    if crest.stroke.kind == "profile":  # straight in plan, however many knots its heights have
        return points[[0, -1]]
    return points


def _approach(square: Floats, start: Floats, end: Floats, reach: float) -> None:
    """Squares of distances to a segment, where that is nearer than what was. Cells from the window's first sample."""
    low, high = np.minimum(start, end) - reach, np.maximum(start, end) + reach
    c0, r0 = np.maximum(np.ceil(low), 0).astype(int)
    c1, r1 = np.minimum(np.floor(high) + 1, (square.shape[1], square.shape[0])).astype(int)
    if c1 <= c0 or r1 <= r0:
        return
    x, y = np.arange(c0, c1) - start[0], (np.arange(r0, r1) - start[1])[:, None]
    dx, dy = end - start
    length2 = dx * dx + dy * dy
    along = np.clip((x * dx + y * dy) / length2, 0, 1) if length2 > 0 else np.zeros((len(y), len(x)))
    part = square[r0:r1, c0:c1]
    np.minimum(part, (x - along * dx) ** 2 + (y - along * dy) ** 2, out=part)


def _fill(distance_m: Floats, ring: Floats, r0: int, c0: int) -> None:
    """Zero inside of a closed outline (n, 2), cells."""
    rows, cols = distance_m.shape
    index, spans = spans_of(ring, r0, r0 + rows)
    for row in range(rows):
        for x0, x1 in spans[index[row] : index[row + 1]]:
            first, last = max(int(np.ceil(x0)) - c0, 0), min(int(np.floor(x1)) - c0, cols - 1)
            distance_m[row, first : last + 1] = 0
